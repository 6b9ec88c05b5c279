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
                     double *jacobian);
    void (*tpr2tps)(ptrdiff_t n, const double *size, const double *free, double *lengths,
                    double *jacobian);
    int (*home)(const pkm_machine *, const double *geometry, const double *home, double *jacobian);
    void (*closure)(const pkm_machine *, ptrdiff_t n, const double *geometry, const double *pose,
                    const double *q, double *residual, double *by_step, double *by_free,
                    double *by_q);
    void (*limbs)(const pkm_machine *, ptrdiff_t n, const double *geometry, const double *pose,
                  double *drive, double *on_base, double *on_platform);
    void (*compose)(ptrdiff_t n, const double *a, ptrdiff_t a_stride, const double *b,
                    ptrdiff_t b_stride, double *out);
    void (*invert)(ptrdiff_t n, const double *a, double *out);
    void (*compose_rates)(ptrdiff_t n, const double *a, const double *pose, const double *c,
                          ptrdiff_t c_stride, const double *composed, double *rates);
    void (*points)(ptrdiff_t n, const double *pose, ptrdiff_t pose_stride, const double *target,
                   ptrdiff_t target_stride, double *point, double *by_pose, double *by_target);
    void (*distances)(ptrdiff_t n, const double *pose, const double *target,
                      ptrdiff_t target_stride, const double *anchor, ptrdiff_t anchor_stride,
                      double *distance, double *by_pose, double *by_target, double *by_anchor);
} pkm_core;

extern const pkm_core pkm_base, pkm_v3, pkm_v4;

#endif
