/* The flat C interface of the core: what `pkmcal._core` offers to Python.
 *
 * Every call takes n rows, contiguous, row by row. It returns 0, or a negative number for a bad
 * call, in which case nothing was written. No memory is allocated and no state is kept.
 * `geometry` holds limbs x SLOTS numbers; `geometry_stride` is 0 where all rows share it, else the
 * distance from one row's geometry to the next. `isa` is 0 (baseline), 1 (AVX2) or 2 (AVX-512).
 */
#ifndef PKMCAL_H
#define PKMCAL_H

#include <stddef.h>
#include <stdint.h>

/* cffi begin */
enum { PKM_MAX_LIMBS = 12, PKM_MAX_ROWS = 24 };
enum { PKM_OK, PKM_NOT_CONVERGED, PKM_SINGULAR, PKM_INFEASIBLE, PKM_INVALID };
enum { PKM_BAD_ISA = -1, PKM_BAD_MACHINE = -2, PKM_BAD_COLUMN = -3, PKM_BAD_SWARM = -4 };

/* A machine: its pose map and its limbs, without the numbers that calibration changes. */
typedef struct {
    int map;                        /* MAP_... */
    int limbs;                      /* how many, at most PKM_MAX_LIMBS */
    int actuators;
    double size;                    /* [mm] what rounding is measured against */
    double length;                  /* characteristic length [mm]: rotations times it are mm */
    int driver[12];                 /* DRIVER_... of each limb */
    int rows[12];                   /* set of ROW_... beside the sphere */
    int actuator[12];               /* which actuator drives the limb */
    double branch[12];              /* +1 or -1 for slider and crank */
    double frame[108];              /* base-side axis frame of each limb, 3 x 3 row by row */
    double platform_frame[108];     /* platform-side axis frame of each limb */
    double lever[12];               /* of the couple row [mm] */
    double weight[24];              /* of each row, limb by limb, the sphere first */
    int order[24];                  /* place of each row in the elimination: see pkm_order_rows */
} pkm_machine;

/* A swarm in `dims` dimensions and the factors of eq. 19. Its state, pkm_swarm_size numbers, begins
 * with x (dims, width), width = the particles rounded up to eights, and ends with the value of each
 * particle (width), gBest (dims) and the value there. */
typedef struct {
    int particles, dims;
    double inertia, cognitive, social;
} pkm_swarm;

const char *pkm_slot_names(void);
const char *pkm_driver_names(void);
const char *pkm_row_names(void);
const char *pkm_map_names(void);
const char *pkm_map_free(void);

/* The best ISA of this processor. */
int pkm_best_isa(void);

/* Set `order` from an elimination with exchanges at the home pose: later ones run in that order. */
int pkm_order_rows(pkm_machine *machine, const double *geometry, const double *home);

/* pose (n, 6) -> q (n, actuators); a row a limb cannot reach is NaN. */
int pkm_inverse(const pkm_machine *machine, int isa, ptrdiff_t n, const double *geometry,
                ptrdiff_t geometry_stride, const double *pose, double *q);

/* q (n, actuators), guess (6 or n x 6 by guess_stride) -> pose (n, 6), status, iterations and the
 * closure residual [mm] of each row. */
int pkm_forward(const pkm_machine *machine, int isa, ptrdiff_t n, const double *geometry,
                ptrdiff_t geometry_stride, const double *q, const double *guess,
                ptrdiff_t guess_stride, double *pose, int32_t *status, int32_t *iterations,
                double *residual);

/* pose (n, 6) -> dq/dfree (n, actuators, m), limb by limb. */
int pkm_jacobian(const pkm_machine *machine, int isa, ptrdiff_t n, const double *geometry,
                 ptrdiff_t geometry_stride, const double *pose, double *jacobian);

/* pose (n, 6), q (n, actuators) -> dpose/dq (n, 6, actuators). */
int pkm_forward_jacobian(const pkm_machine *machine, int isa, ptrdiff_t n, const double *geometry,
                         ptrdiff_t geometry_stride, const double *pose, const double *q,
                         double *jacobian);

/* pose (n, 6), q (n, actuators) -> dpose/d(numbers) (n, 6, columns) at held actuators, or with
 * `twists` the twist (omega, v) of the platform's origin in base axes by them; columns are indices
 * into limbs x SLOTS. */
int pkm_error_jacobian(const pkm_machine *machine, int isa, ptrdiff_t n, const double *geometry,
                       ptrdiff_t geometry_stride, const double *pose, const double *q,
                       const int32_t *column, int columns, int twists, double *jacobian);

/* pose (n, 6), q (n, actuators) -> the closure rows, limb by limb and the sphere first: residual
 * (n, rows) [mm]; their derivatives by a scaled twist (n, rows, m), by the free coordinates
 * (n, rows, m) and by q (n, rows, actuators). */
int pkm_closure(const pkm_machine *machine, int isa, ptrdiff_t n, const double *geometry,
                const double *pose, const double *q, double *residual, double *by_step,
                double *by_free, double *by_q);

/* What a limb is at given actuators, for homotopies: its joint b, its anchor c, its length and its axes
 * at the base and at the platform, in that order. Zero where it has no axis. */
enum { PKM_SPHERE = 13 };

/* q (n, actuators) -> the limbs (n, limbs, PKM_SPHERE); lengths are NaN where one of them is not
 * positive. */
int pkm_spheres(const pkm_machine *machine, int isa, ptrdiff_t n, const double *geometry,
                const double *q, double *sphere);

/* What became of a path. */
enum { PKM_ARRIVED, PKM_LOST, PKM_FAR };

/* Solutions of closures at `start`, as many as there are free coordinates, followed to `target`, while the limbs go there in a straight
 * line. Complex numbers are pairs: limbs (limbs, PKM_SPHERE), states of the pose map at the start
 * (n, pkm_state_size), which become those at the end. Steps are so small that predictions are within
 * `accuracy`. -> the frames (n, 12), R row by row and p, how each path ended, after how many steps, and
 * where on the line (1: target). */
int pkm_state_size(void);
int pkm_paths(const pkm_machine *machine, ptrdiff_t n, const double *start, const double *target,
              double *state, double accuracy, double *frame, int32_t *status, int32_t *steps,
              double *reached);

/* pose (n, 6) as given -> of each limb its drive coordinate (n, limbs), NaN out of reach, and the
 * unit vector from its anchor to the platform joint in base and platform axes (n, limbs, 3). */
int pkm_limbs(const pkm_machine *machine, int isa, ptrdiff_t n, const double *geometry,
              const double *pose, double *drive, double *on_base, double *on_platform);

/* motion (n, 3, 4, 4), the platform's homogeneous matrix with its first and second derivative by time
 * -> velocity and acceleration of the actuators, (n, actuators) each; NaN out of reach. */
int pkm_rates(const pkm_machine *machine, int isa, ptrdiff_t n, const double *geometry,
              const double *motion, double *q1, double *q2);

/* pose (n, 6), q and its first and second derivative by time (n, actuators) -> motion (n, 3, 4, 4) as
 * above, and the first and second derivative of the pose (n, 2, 6); NaN where singular. */
int pkm_motion(const pkm_machine *machine, int isa, ptrdiff_t n, const double *geometry,
               const double *pose, const double *q, const double *q1, const double *q2,
               double *motion, double *pose_rates);

/* Poses as frames: out = A B (strides 0 or 6), out = A^-1, and the rates (n, 6, 6) of A T C by those
 * of T, or its twists by those of T: A and C are (6,) there, T (n, 6). */
int pkm_compose(int isa, ptrdiff_t n, const double *a, ptrdiff_t a_stride, const double *b,
                ptrdiff_t b_stride, double *out);
int pkm_invert(int isa, ptrdiff_t n, const double *a, double *out);
int pkm_compose_rates(int isa, ptrdiff_t n, const double *a, const double *pose, const double *c,
                      ptrdiff_t c_stride, const double *composed, double *rates);

int pkm_compose_twists(int isa, ptrdiff_t n, const double *a, const double *pose, const double *c,
                       double *twists);

/* Targets of the platform (stride 0 or 3) as points (n, 3) of the base, and their derivatives by the
 * twist (n, 3, 6) and by the target (n, 3, 3). */
int pkm_points(int isa, ptrdiff_t n, const double *pose, const double *target,
               ptrdiff_t target_stride, double *point, double *by_twist, double *by_target);

/* Points (n, 3) of the base in a frame (6,) and their derivatives by the frame (n, 3, 6) and by the
 * point (n, 3, 3); and of poses (n, 6) as seen from it the derivatives by the twist (n, 6, 6). */
int pkm_seen_points(int isa, ptrdiff_t n, const double *frame, const double *point, double *seen,
                    double *by_frame, double *by_point);
int pkm_seen_poses(int isa, ptrdiff_t n, const double *frame, const double *seen,
                   double *by_twist);

/* Distances (n,) from anchors of the base to targets of the platform, and their derivatives by the
 * twist (n, 6), by the target (n, 3) and by the anchor (n, 3); strides 0 or 3. */
int pkm_distances(int isa, ptrdiff_t n, const double *pose, const double *target,
                  ptrdiff_t target_stride, const double *anchor, ptrdiff_t anchor_stride,
                  double *distance, double *by_twist, double *by_target, double *by_anchor);

/* 2TPR&2TPS in closed form: size a b c d e f, free (n, 4) = y z alpha beta -> lengths (n, 4) of
 * eq. 8, and their derivatives (n, 4, 4) of eq. 12. */
int pkm_tpr2tps_lengths(int isa, ptrdiff_t n, const double *size, const double *free,
                        double *lengths);
int pkm_tpr2tps_jacobian(int isa, ptrdiff_t n, const double *size, const double *free,
                         double *jacobian);

/* Geometries that differ: of each row of out (n, size) the numbers at `place` (k) become those of
 * `ideal` (size) plus the row's errors (n, k); the others are left. */
int pkm_with_errors(ptrdiff_t n, int k, const double *error, const int32_t *place, ptrdiff_t size,
                    const double *ideal, double *out);

/* Of each quantity of value (k, n), finite, how many numbers are in each bin: count (k, bins + 2) goes
 * up, its first and last column by what is below and above the bins. */
int pkm_count(int k, ptrdiff_t n, const double *value, const double *low, const double *width,
              int bins, int64_t *count);

/* Standard normal numbers (n), of one state the same bits with every isa. The state, any bits but
 * zeros alone, is 4 words of each of eight generators (4, 8) and moves on; what is left of the last
 * sixteen numbers is dropped. */
int pkm_normals(int isa, ptrdiff_t n, uint64_t *state, double *out);

/* A swarm step by step: start within the bounds; set the particles' values in the state and judge
 * (pBest, gBest); move (eq. 19); judge again. Of one seed the same bits with every isa. */
ptrdiff_t pkm_swarm_size(const pkm_swarm *swarm);
int pkm_swarm_start(const pkm_swarm *swarm, int isa, uint64_t seed, const double *lower,
                    const double *upper, double *state);
int pkm_swarm_judge(const pkm_swarm *swarm, int isa, double *state);
int pkm_swarm_move(const pkm_swarm *swarm, int isa, const double *lower, const double *upper,
                   double *state);

/* Eq. 18 by swarms start, start + 1, ... start + n - 1 of a seed, one for each set of `rows` poses:
 * off (n, rows, dims) = L* - L -> the correction of each set (n, dims) and its best E after each
 * iteration (n, iterations + 1). */
int pkm_swarm_eq18(const pkm_swarm *swarm, int isa, int iterations, uint64_t seed, ptrdiff_t start,
                   ptrdiff_t n, ptrdiff_t rows, const double *off, const double *lower,
                   const double *upper, double *state, double *correction, double *history);

/* geometry (particles, limbs, SLOTS), pose (n, 6), q (n, actuators) -> of each geometry the sum over
 * the poses of its squared closures (particles) [mm²]. */
int pkm_closure_cost(const pkm_machine *machine, int isa, ptrdiff_t particles,
                     const double *geometry, ptrdiff_t n, const double *pose, const double *q,
                     double *cost);

/* Twists (n, 6) are (omega, v); motions (n, 16) are 4 x 4 matrices, row by row. */
int pkm_exp(int isa, ptrdiff_t n, const double *twist, double *motion);
int pkm_log(int isa, ptrdiff_t n, const double *motion, double *twist);
int pkm_adjoint(int isa, ptrdiff_t n, const double *motion, double *adjoint);
int pkm_motion_pose(int isa, ptrdiff_t n, const double *motion, double *pose);

/* At a twist (n, 6): dT T^-1 by dtwist (n, 6, 6), or with `inverse` dtwist by dT T^-1. */
int pkm_exp_jacobian(int isa, int inverse, ptrdiff_t n, const double *twist, double *jacobian);

/* The motion (n, 16) by joint errors dx dy dz dphi dtheta dpsi (n, 6) at points (n, 3), or by poses
 * where the points are 0. */
int pkm_joint_motions(int isa, ptrdiff_t n, const double *error, const double *point,
                      double *motion);

/* A serial arm at zero: of each joint its kind, its frame's axes (joints, 9) with the joint's own as
 * the third column, and its point (joints, 3); and the tool. */
typedef struct {
    int joints;
    const int32_t *prismatic;
    const double *axes, *point, *home;
} pkm_arm;

/* What is between the joints: (joints + 1, 12), or (n, joints + 1, 12) by row. See pkm_arm_links. */
typedef struct {
    int by_row;
    const double *link;
} pkm_links;

enum { PKM_SPACE, PKM_BODY, PKM_TIP }; /* tip: velocity of the tool's origin, in base axes */

/* Joint errors (n, joints, 6) -> links (n, joints + 1, 12). */
int pkm_arm_links(const pkm_arm *arm, int isa, ptrdiff_t n, const double *error, double *link);

/* theta (n, joints) -> the tool (n, 16); its twist by theta (n, 6, joints); its twist by the joint
 * errors (n, 6, 6 joints), which are those the links were made of. */
int pkm_arm_forward(const pkm_arm *arm, const pkm_links *links, int isa, ptrdiff_t n,
                    const double *theta, double *motion);
int pkm_arm_jacobian(const pkm_arm *arm, const pkm_links *links, int isa, int frame, ptrdiff_t n,
                     const double *theta, double *jacobian);
int pkm_arm_error_jacobian(const pkm_arm *arm, const pkm_links *links, const double *error, int isa,
                           int frame, ptrdiff_t n, const double *theta, double *jacobian);
/* cffi end */

#endif
