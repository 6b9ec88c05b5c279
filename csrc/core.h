/* One ISA's core: every function of the flat interface at LANES rows at a time.
 *
 * core_base.c, core_v3.c and core_v4.c each include this with their own LANES and CORE.
 */
#include "core_table.h"
#include "forward.h"
#include "inverse.h"
#include "inspect.h"
#include "jacobian.h"
#include "motion.h"
#include "poses.h"
#include "pso.h"
#include "random.h"
#include "readings.h"
#include "serial.h"
#include "tpr2tps.h"

static void core_inverse(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                  ptrdiff_t geometry_stride, const double *pose, double *q)
{
    inverse_rows(machine, n, geometry, geometry_stride, pose, q);
}

static void core_forward(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                         ptrdiff_t geometry_stride, const double *q, const double *guess,
                         ptrdiff_t guess_stride, double *pose, int32_t *status,
                         int32_t *iterations, double *residual)
{
    const forward_call call = {machine, n, geometry, geometry_stride, q, guess, guess_stride,
                               pose, status, iterations, residual};
    switch (machine->map) {
#define CASE(NAME, name, M) case MAP_##NAME: forward_map(MAP_##NAME, &call); break;
        EACH_MAP(CASE)
#undef CASE
    }
}

static void core_rates(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                       const double *motion, double *q1, double *q2)
{
    rates_rows(machine, n, geometry, motion, q1, q2);
}

static void core_motion(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                        const double *pose, const double *q, const double *q1, const double *q2,
                        double *motion, double *pose_rates)
{
    switch (machine->map) {
#define CASE(NAME, name, M)                                                                       \
    case MAP_##NAME:                                                                              \
        motion_map(MAP_##NAME, machine, n, geometry, pose, q, q1, q2, motion, pose_rates);        \
        break;
        EACH_MAP(CASE)
#undef CASE
    }
}

static void core_jacobian(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                   ptrdiff_t geometry_stride, const double *pose, double *jacobian)
{
    switch (machine->map) {
#define CASE(NAME, name, M)                                                                       \
    case MAP_##NAME:                                                                              \
        jacobian_map(MAP_##NAME, machine, n, geometry, geometry_stride, pose, jacobian);          \
        break;
        EACH_MAP(CASE)
#undef CASE
    }
}

static void core_response(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                   ptrdiff_t geometry_stride, const double *pose, const double *q,
                   const int32_t *column, int columns, int twists, double *jacobian)
{
    switch (machine->map) {
#define CASE(NAME, name, M)                                                                       \
    case MAP_##NAME:                                                                              \
        response_map(MAP_##NAME, machine, n, geometry, geometry_stride, pose, q, column, columns, \
                     twists, jacobian);                                                           \
        break;
        EACH_MAP(CASE)
#undef CASE
    }
}

static void core_tpr2tps(ptrdiff_t n, const double *size, const double *free, double *lengths,
                         double *jacobian)
{
    real lane_size[6];
    for (int k = 0; k < 6; k++) lane_size[k] = fill(size[k]);
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_free[4], out[16];
        const int count = block_rows(first, n, row);
        gather_row(free, 4, 4, row, lane_free);
        if (lengths) {
            FN(tpr2tps_lengths)(lane_size, lane_free, out);
            scatter_row(out, 4, lengths, 4, row, count);
        } else {
            FN(tpr2tps_jacobian)(lane_size, lane_free, out);
            scatter_row(out, 16, jacobian, 16, row, count);
        }
    }
}

/* The closure rows' derivatives at home (rows x m, limb by limb): what pkm_order_rows eliminates. */
RARE int core_home(const pkm_machine *machine, const double *geometry, const double *home,
                     double *jacobian)
{
    limb_numbers limb[PKM_MAX_LIMBS];
    FN(limb_sphere) sphere[PKM_MAX_LIMBS];
    ptrdiff_t zero[LANES] = {0};
    real pose[6], state[MAX_STATE], R[9], p[3], q[PKM_MAX_LIMBS], phi[PKM_MAX_ROWS];
    real A[PKM_MAX_ROWS * 6];
    int rows = 0;
    prepare_limbs(machine, geometry, 0, zero, limb);
    for (int k = 0; k < 6; k++) pose[k] = fill(home[k]);
    switch (machine->map) {
#define CASE(NAME, name, M)                                                                       \
    case MAP_##NAME:                                                                              \
        map_from_pose(MAP_##NAME, pose, state);                                                   \
        FN(map_frame)(MAP_##NAME, state, R, p);                                                   \
        inverse_once(machine, limb, R, p, q);                                                     \
        spheres_at(machine, limb, q, sphere);                                                     \
        rows = scaled_rows(MAP_##NAME, machine, sphere, state, phi, A);                           \
        for (int k = 0; k < rows * M; k++) jacobian[k] = A[k][0];                                 \
        break;
        EACH_MAP(CASE)
#undef CASE
    }
    return rows;
}

static void core_closure(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                         const double *pose, const double *q, double *residual, double *by_step,
                         double *by_free, double *by_q)
{
    const closure_out out = {residual, by_step, by_free, by_q};
    switch (machine->map) {
#define CASE(NAME, name, M)                                                                       \
    case MAP_##NAME: closure_map(MAP_##NAME, machine, n, geometry, pose, q, &out); break;
        EACH_MAP(CASE)
#undef CASE
    }
}

static void core_limbs(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                       const double *pose, double *drive, double *on_base, double *on_platform)
{
    limb_rows(machine, n, geometry, pose, drive, on_base, on_platform);
}

static void core_spheres(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                         const double *q, double *sphere)
{
    sphere_rows(machine, n, geometry, q, sphere);
}

static void core_compose(ptrdiff_t n, const double *a, ptrdiff_t a_stride, const double *b,
                         ptrdiff_t b_stride, double *out)
{
    compose_rows(n, a, a_stride, b, b_stride, out);
}

static void core_invert(ptrdiff_t n, const double *a, double *out) { invert_rows(n, a, out); }

static void core_compose_rates(ptrdiff_t n, const double *a, const double *pose, const double *c,
                               ptrdiff_t c_stride, const double *composed, double *rates)
{
    compose_rates_rows(n, a, pose, c, c_stride, composed, rates);
}

static void core_compose_twists(ptrdiff_t n, const double *a, const double *pose, const double *c,
                                double *twists)
{
    compose_twists_rows(n, a, pose, c, twists);
}

static void core_points(ptrdiff_t n, const double *pose, const double *target,
                        ptrdiff_t target_stride, double *point, double *by_twist,
                        double *by_target)
{
    point_rows(n, pose, target, target_stride, point, by_twist, by_target);
}

static void core_seen_points(ptrdiff_t n, const double *frame, const double *point, double *seen,
                             double *by_frame, double *by_point)
{
    seen_point_rows(n, frame, point, seen, by_frame, by_point);
}

static void core_seen_poses(ptrdiff_t n, const double *frame, const double *seen, double *by_twist)
{
    seen_pose_rows(n, frame, seen, by_twist);
}

static void core_distances(ptrdiff_t n, const double *pose, const double *target,
                           ptrdiff_t target_stride, const double *anchor, ptrdiff_t anchor_stride,
                           double *distance, double *by_twist, double *by_target, double *by_anchor)
{
    distance_rows(n, pose, target, target_stride, anchor, anchor_stride, distance, by_twist,
                  by_target, by_anchor);
}

static void core_normals(ptrdiff_t n, uint64_t *state, double *out)
{
    normal_numbers(n, state, out);
}

static void core_swarm_start(const pkm_swarm *swarm, uint64_t seed, const double *lower,
                             const double *upper, double *state)
{
    swarm_start(swarm, seed, 0, lower, upper, state);
}

static void core_swarm_move(const pkm_swarm *swarm, const double *lower, const double *upper,
                            double *state)
{
    swarm_move(swarm, lower, upper, state);
}

static void core_swarm_judge(const pkm_swarm *swarm, double *state) { swarm_judge(swarm, state); }

static void core_swarm_eq18(const pkm_swarm *swarm, int iterations, uint64_t seed, ptrdiff_t start,
                            ptrdiff_t n, ptrdiff_t rows, const double *off, const double *lower,
                            const double *upper, double *state, double *correction,
                            double *history)
{
    swarm_eq18(swarm, iterations, seed, start, n, rows, off, lower, upper, state, correction,
               history);
}

static void core_closure_cost(const pkm_machine *machine, ptrdiff_t particles,
                              const double *geometry, ptrdiff_t n, const double *pose,
                              const double *q, double *cost)
{
    closure_cost_rows(machine, particles, geometry, n, pose, q, cost);
}

static void core_exp(ptrdiff_t n, const double *twist, double *motion)
{
    exp_rows(n, twist, motion);
}

static void core_log(ptrdiff_t n, const double *motion, double *twist)
{
    log_rows(n, motion, twist);
}

static void core_adjoint(ptrdiff_t n, const double *motion, double *adjoint)
{
    adjoint_rows(n, motion, adjoint);
}

static void core_motion_pose(ptrdiff_t n, const double *motion, double *pose)
{
    pose_rows(n, motion, pose);
}

static void core_exp_jacobian(int inverse, ptrdiff_t n, const double *twist, double *jacobian)
{
    exp_jacobian_rows(inverse, n, twist, jacobian);
}

static void core_joint_motions(ptrdiff_t n, const double *error, const double *point, double *motion)
{
    joint_error_rows(n, error, point, motion);
}

static void core_arm_links(const pkm_arm *arm, ptrdiff_t n, const double *error, double *link)
{
    arm_link_rows(arm, n, error, link);
}

static void core_arm_forward(const pkm_arm *arm, const pkm_links *links, ptrdiff_t n,
                             const double *theta, double *motion)
{
    arm_forward_rows(arm, links, n, theta, motion);
}

static void core_arm_jacobian(const pkm_arm *arm, const pkm_links *links, int frame, ptrdiff_t n,
                              const double *theta, double *jacobian)
{
    arm_jacobian_rows(arm, links, frame, n, theta, jacobian);
}

static void core_arm_error_jacobian(const pkm_arm *arm, const pkm_links *links, const double *error,
                                    int frame, ptrdiff_t n, const double *theta, double *jacobian)
{
    arm_error_jacobian_rows(arm, links, error, frame, n, theta, jacobian);
}

const pkm_core CORE = {
    .inverse = core_inverse,
    .forward = core_forward,
    .jacobian = core_jacobian,
    .response = core_response,
    .tpr2tps = core_tpr2tps,
    .home = core_home,
    .closure = core_closure,
    .limbs = core_limbs,
    .spheres = core_spheres,
    .compose = core_compose,
    .invert = core_invert,
    .compose_rates = core_compose_rates,
    .compose_twists = core_compose_twists,
    .points = core_points,
    .seen_points = core_seen_points,
    .seen_poses = core_seen_poses,
    .distances = core_distances,
    .normals = core_normals,
    .swarm_start = core_swarm_start,
    .swarm_move = core_swarm_move,
    .swarm_judge = core_swarm_judge,
    .swarm_eq18 = core_swarm_eq18,
    .closure_cost = core_closure_cost,
    .exp = core_exp,
    .log = core_log,
    .adjoint = core_adjoint,
    .motion_pose = core_motion_pose,
    .exp_jacobian = core_exp_jacobian,
    .joint_motions = core_joint_motions,
    .arm_links = core_arm_links,
    .arm_forward = core_arm_forward,
    .arm_jacobian = core_arm_jacobian,
    .arm_error_jacobian = core_arm_error_jacobian,
    .rates = core_rates,
    .motion = core_motion,
};
