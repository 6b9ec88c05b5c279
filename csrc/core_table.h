/* What each ISA's core offers to the flat interface (the same arguments, already checked). */
#ifndef CORE_TABLE_H
#define CORE_TABLE_H

#include "pkmcal.h"

typedef struct {
    void (*inverse)(const pkm_machine *, ptrdiff_t n, const double *geometry, ptrdiff_t stride,
                    const double *pose, double *q);
    void (*forward)(const pkm_machine *, ptrdiff_t n, const double *geometry, ptrdiff_t stride,
                    const double *q, const double *guess, ptrdiff_t guess_stride, double *pose,
                    int32_t *status, int32_t *iterations, double *residual);
    void (*jacobian)(const pkm_machine *, ptrdiff_t n, const double *geometry, ptrdiff_t stride,
                     const double *pose, double *jacobian);
    void (*response)(const pkm_machine *, ptrdiff_t n, const double *geometry, ptrdiff_t stride,
                     const double *pose, const double *q, const int32_t *column, int columns,
                     int twists, double *jacobian);
    void (*tpr2tps)(ptrdiff_t n, const double *size, const double *free, double *lengths,
                    double *jacobian);
    int (*home)(const pkm_machine *, const double *geometry, const double *home, double *jacobian);
    void (*closure)(const pkm_machine *, ptrdiff_t n, const double *geometry, const double *pose,
                    const double *q, double *residual, double *by_step, double *by_free,
                    double *by_q);
    void (*limbs)(const pkm_machine *, ptrdiff_t n, const double *geometry, const double *pose,
                  double *drive, double *on_base, double *on_platform);
    void (*spheres)(const pkm_machine *, ptrdiff_t n, const double *geometry, const double *q,
                    double *sphere);
    void (*compose)(ptrdiff_t n, const double *a, ptrdiff_t a_stride, const double *b,
                    ptrdiff_t b_stride, double *out);
    void (*invert)(ptrdiff_t n, const double *a, double *out);
    void (*compose_rates)(ptrdiff_t n, const double *a, const double *pose, const double *c,
                          ptrdiff_t c_stride, const double *composed, double *rates);
    void (*compose_twists)(ptrdiff_t n, const double *a, const double *pose, const double *c,
                           double *twists);
    void (*points)(ptrdiff_t n, const double *pose, const double *target, ptrdiff_t target_stride,
                   double *point, double *by_twist, double *by_target);
    void (*seen_points)(ptrdiff_t n, const double *frame, const double *point, double *seen,
                        double *by_frame, double *by_point);
    void (*seen_poses)(ptrdiff_t n, const double *frame, const double *seen, double *by_twist);
    void (*distances)(ptrdiff_t n, const double *pose, const double *target,
                      ptrdiff_t target_stride, const double *anchor, ptrdiff_t anchor_stride,
                      double *distance, double *by_twist, double *by_target, double *by_anchor);
    void (*normals)(ptrdiff_t n, uint64_t *state, double *out);
    void (*swarm_start)(const pkm_swarm *, uint64_t seed, const double *lower, const double *upper,
                        double *state);
    void (*swarm_move)(const pkm_swarm *, const double *lower, const double *upper, double *state);
    void (*swarm_judge)(const pkm_swarm *, double *state);
    void (*swarm_eq18)(const pkm_swarm *, int iterations, uint64_t seed, ptrdiff_t start,
                       ptrdiff_t n, ptrdiff_t rows, const double *off, const double *lower,
                       const double *upper, double *state, double *correction, double *history);
    void (*closure_cost)(const pkm_machine *, ptrdiff_t particles, const double *geometry,
                         ptrdiff_t n, const double *pose, const double *q, double *cost);
    void (*exp)(ptrdiff_t n, const double *twist, double *motion);
    void (*log)(ptrdiff_t n, const double *motion, double *twist);
    void (*adjoint)(ptrdiff_t n, const double *motion, double *adjoint);
    void (*motion_pose)(ptrdiff_t n, const double *motion, double *pose);
    void (*exp_jacobian)(int inverse, ptrdiff_t n, const double *twist, double *jacobian);
    void (*joint_motions)(ptrdiff_t n, const double *error, const double *point, double *motion);
    void (*arm_links)(const pkm_arm *, ptrdiff_t n, const double *error, double *link);
    void (*arm_forward)(const pkm_arm *, const pkm_links *, ptrdiff_t n, const double *theta,
                        double *motion);
    void (*arm_jacobian)(const pkm_arm *, const pkm_links *, int frame, ptrdiff_t n,
                         const double *theta, double *jacobian);
    void (*arm_error_jacobian)(const pkm_arm *, const pkm_links *, const double *error, int frame,
                               ptrdiff_t n, const double *theta, double *jacobian);
    void (*rates)(const pkm_machine *, ptrdiff_t n, const double *geometry, const double *motion,
                  double *q1, double *q2);
    void (*motion)(const pkm_machine *, ptrdiff_t n, const double *geometry, const double *pose,
                   const double *q, const double *q1, const double *q2, double *motion,
                   double *pose_rates);
} pkm_core;

/* pkm_paths, the arguments already checked: scalar, so the same for every ISA. */
void paths_follow(const pkm_machine *machine, ptrdiff_t n, const double *start,
                  const double *target, double *state, double accuracy, double *frame,
                  int32_t *status, int32_t *steps, double *reached);

extern const pkm_core pkm_base, pkm_v3, pkm_v4;

#endif
