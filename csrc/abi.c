/* The flat interface: checks the call, picks the ISA, and hands over. */
#include <math.h>

#include "pkmcal.h"
#include "core_table.h"
#include "names.h"

const char *pkm_slot_names(void) { return SLOT_NAMES; }
const char *pkm_driver_names(void) { return DRIVER_NAMES; }
const char *pkm_row_names(void) { return ROW_NAMES; }
const char *pkm_map_names(void) { return MAP_NAMES; }
const char *pkm_map_free(void) { return MAP_FREE; }

int pkm_best_isa(void)
{
#ifdef __x86_64__
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq")
        && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512cd")
        && __builtin_cpu_supports("avx512vl"))
        return 2;
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")
        && __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2"))
        return 1;
#endif
    return 0;
}

static const pkm_core *core(int isa)
{
    if (isa < 0 || isa > pkm_best_isa()) return NULL;
#ifdef __x86_64__
    if (isa == 2) return &pkm_v4;
    if (isa == 1) return &pkm_v3;
#endif
    return &pkm_base;
}

static int free_coordinates(const pkm_machine *machine)
{
#define CASE(NAME, name, M) if (machine->map == MAP_##NAME) return M;
    EACH_MAP(CASE)
#undef CASE
    return 0;
}

/* The number of closure rows, or 0 for a machine the core cannot take. */
static int closure_count(const pkm_machine *machine)
{
    const int free = free_coordinates(machine);
    int rows = 0;
    if (!free || machine->limbs < 1 || machine->limbs > PKM_MAX_LIMBS || !(machine->length > 0)
        || machine->actuators < 1 || machine->actuators > machine->limbs)
        return 0;
    for (int i = 0; i < machine->limbs; i++) {
        if (machine->driver[i] < DRIVER_LENGTH || machine->driver[i] > DRIVER_CRANK
            || machine->actuator[i] < 0 || machine->actuator[i] >= machine->actuators
            || machine->rows[i] & ~(ROW_BASE_PLANE | ROW_PLATFORM_PLANE | ROW_COUPLE)
            || (machine->rows[i] && machine->driver[i] != DRIVER_LENGTH))
            return 0;
        rows += 1 + __builtin_popcount((unsigned)machine->rows[i]);
    }
    return rows >= free && rows <= PKM_MAX_ROWS ? rows : 0;
}

#define CHECKED(isa)                                                                              \
    const pkm_core *chosen = core(isa);                                                           \
    if (!chosen) return PKM_BAD_ISA

#define CHECKED_MACHINE(machine, isa)                                                             \
    CHECKED(isa);                                                                                 \
    if (!closure_count(machine)) return PKM_BAD_MACHINE

int pkm_order_rows(pkm_machine *machine, const double *geometry, const double *home)
{
    double A[PKM_MAX_ROWS * 6];
    int row[PKM_MAX_ROWS];
    const int m = free_coordinates(machine), rows = closure_count(machine);
    if (!rows) return PKM_BAD_MACHINE;
    for (int r = 0; r < rows; r++) machine->order[r] = row[r] = r;
    if (rows > m) return 0; /* the normal equations need no order */
    pkm_base.home(machine, geometry, home, A);
    for (int c = 0; c < m; c++) {
        int best = c;
        for (int i = c + 1; i < m; i++)
            if (fabs(A[row[i] * m + c]) > fabs(A[row[best] * m + c])) best = i;
        const int swapped = row[c];
        row[c] = row[best];
        row[best] = swapped;
        for (int i = c + 1; i < m; i++) {
            const double factor = A[row[i] * m + c] / A[row[c] * m + c];
            for (int j = c; j < m; j++) A[row[i] * m + j] -= factor * A[row[c] * m + j];
        }
    }
    for (int c = 0; c < m; c++) machine->order[row[c]] = c;
    return 0;
}

int pkm_inverse(const pkm_machine *machine, int isa, ptrdiff_t n, const double *geometry,
                ptrdiff_t geometry_stride, const double *pose, double *q)
{
    CHECKED_MACHINE(machine, isa);
    chosen->inverse(machine, n, geometry, geometry_stride, pose, q);
    return 0;
}

int pkm_forward(const pkm_machine *machine, int isa, ptrdiff_t n, const double *geometry,
                ptrdiff_t geometry_stride, const double *q, const double *guess,
                ptrdiff_t guess_stride, double *pose, int32_t *status, int32_t *iterations,
                double *residual)
{
    CHECKED_MACHINE(machine, isa);
    chosen->forward(machine, n, geometry, geometry_stride, q, guess, guess_stride, pose, status,
                    iterations, residual);
    return 0;
}

int pkm_jacobian(const pkm_machine *machine, int isa, ptrdiff_t n, const double *geometry,
                 ptrdiff_t geometry_stride, const double *pose, double *jacobian)
{
    CHECKED_MACHINE(machine, isa);
    chosen->jacobian(machine, n, geometry, geometry_stride, pose, jacobian);
    return 0;
}

int pkm_forward_jacobian(const pkm_machine *machine, int isa, ptrdiff_t n, const double *geometry,
                         ptrdiff_t geometry_stride, const double *pose, const double *q,
                         double *jacobian)
{
    CHECKED_MACHINE(machine, isa);
    chosen->response(machine, n, geometry, geometry_stride, pose, q, NULL, machine->actuators, 0,
                     jacobian);
    return 0;
}

int pkm_error_jacobian(const pkm_machine *machine, int isa, ptrdiff_t n, const double *geometry,
                       ptrdiff_t geometry_stride, const double *pose, const double *q,
                       const int32_t *column, int columns, int twists, double *jacobian)
{
    CHECKED_MACHINE(machine, isa);
    for (int c = 0; c < columns; c++)
        if (column[c] < 0 || column[c] >= SLOTS * machine->limbs || (c && column[c] <= column[c - 1]))
            return PKM_BAD_COLUMN;
    chosen->response(machine, n, geometry, geometry_stride, pose, q, column, columns, twists,
                     jacobian);
    return 0;
}

int pkm_closure(const pkm_machine *machine, int isa, ptrdiff_t n, const double *geometry,
                const double *pose, const double *q, double *residual, double *by_step,
                double *by_free, double *by_q)
{
    CHECKED_MACHINE(machine, isa);
    chosen->closure(machine, n, geometry, pose, q, residual, by_step, by_free, by_q);
    return 0;
}

int pkm_limbs(const pkm_machine *machine, int isa, ptrdiff_t n, const double *geometry,
              const double *pose, double *drive, double *on_base, double *on_platform)
{
    CHECKED_MACHINE(machine, isa);
    chosen->limbs(machine, n, geometry, pose, drive, on_base, on_platform);
    return 0;
}

int pkm_rates(const pkm_machine *machine, int isa, ptrdiff_t n, const double *geometry,
              const double *motion, double *q1, double *q2)
{
    CHECKED_MACHINE(machine, isa);
    chosen->rates(machine, n, geometry, motion, q1, q2);
    return 0;
}

int pkm_spheres(const pkm_machine *machine, int isa, ptrdiff_t n, const double *geometry,
                const double *q, double *sphere)
{
    CHECKED_MACHINE(machine, isa);
    chosen->spheres(machine, n, geometry, q, sphere);
    return 0;
}

int pkm_state_size(void) { return MAX_STATE; }

int pkm_paths(const pkm_machine *machine, ptrdiff_t n, const double *start, const double *target,
              double *state, double accuracy, double *frame, int32_t *status, int32_t *steps,
              double *reached)
{
    if (closure_count(machine) != free_coordinates(machine)) return PKM_BAD_MACHINE;
    paths_follow(machine, n, start, target, state, accuracy, frame, status, steps, reached);
    return 0;
}

int pkm_motion(const pkm_machine *machine, int isa, ptrdiff_t n, const double *geometry,
               const double *pose, const double *q, const double *q1, const double *q2,
               double *motion, double *pose_rates)
{
    CHECKED_MACHINE(machine, isa);
    chosen->motion(machine, n, geometry, pose, q, q1, q2, motion, pose_rates);
    return 0;
}

int pkm_compose(int isa, ptrdiff_t n, const double *a, ptrdiff_t a_stride, const double *b,
                ptrdiff_t b_stride, double *out)
{
    CHECKED(isa);
    chosen->compose(n, a, a_stride, b, b_stride, out);
    return 0;
}

int pkm_invert(int isa, ptrdiff_t n, const double *a, double *out)
{
    CHECKED(isa);
    chosen->invert(n, a, out);
    return 0;
}

int pkm_compose_rates(int isa, ptrdiff_t n, const double *a, const double *pose, const double *c,
                      ptrdiff_t c_stride, const double *composed, double *rates)
{
    CHECKED(isa);
    chosen->compose_rates(n, a, pose, c, c_stride, composed, rates);
    return 0;
}

int pkm_compose_twists(int isa, ptrdiff_t n, const double *a, const double *pose, const double *c,
                       double *twists)
{
    CHECKED(isa);
    chosen->compose_twists(n, a, pose, c, twists);
    return 0;
}

int pkm_points(int isa, ptrdiff_t n, const double *pose, const double *target,
               ptrdiff_t target_stride, double *point, double *by_twist, double *by_target)
{
    CHECKED(isa);
    chosen->points(n, pose, target, target_stride, point, by_twist, by_target);
    return 0;
}

int pkm_seen_points(int isa, ptrdiff_t n, const double *frame, const double *point, double *seen,
                    double *by_frame, double *by_point)
{
    CHECKED(isa);
    chosen->seen_points(n, frame, point, seen, by_frame, by_point);
    return 0;
}

int pkm_seen_poses(int isa, ptrdiff_t n, const double *frame, const double *seen, double *by_twist)
{
    CHECKED(isa);
    chosen->seen_poses(n, frame, seen, by_twist);
    return 0;
}

int pkm_distances(int isa, ptrdiff_t n, const double *pose, const double *target,
                  ptrdiff_t target_stride, const double *anchor, ptrdiff_t anchor_stride,
                  double *distance, double *by_twist, double *by_target, double *by_anchor)
{
    CHECKED(isa);
    chosen->distances(n, pose, target, target_stride, anchor, anchor_stride, distance, by_twist,
                      by_target, by_anchor);
    return 0;
}

int pkm_tpr2tps_lengths(int isa, ptrdiff_t n, const double *size, const double *free,
                        double *lengths)
{
    CHECKED(isa);
    chosen->tpr2tps(n, size, free, lengths, NULL);
    return 0;
}

int pkm_tpr2tps_jacobian(int isa, ptrdiff_t n, const double *size, const double *free,
                         double *jacobian)
{
    CHECKED(isa);
    chosen->tpr2tps(n, size, free, NULL, jacobian);
    return 0;
}

static int swarm_fits(const pkm_swarm *swarm) { return swarm->particles > 0 && swarm->dims > 0; }

ptrdiff_t pkm_swarm_size(const pkm_swarm *swarm)
{
    const ptrdiff_t width = ((ptrdiff_t)swarm->particles + 7) / 8 * 8;
    return swarm_fits(swarm) ? (3 * swarm->dims + 6) * width + swarm->dims + 1 : 0;
}

#define CHECKED_SWARM(swarm, isa)                                                                 \
    CHECKED(isa);                                                                                 \
    if (!swarm_fits(swarm)) return PKM_BAD_SWARM

int pkm_with_errors(ptrdiff_t n, int k, const double *error, const int32_t *place, ptrdiff_t size,
                    const double *ideal, double *out)
{
    for (int j = 0; j < k; j++)
        if (place[j] < 0 || place[j] >= size) return PKM_BAD_COLUMN;
    for (ptrdiff_t i = 0; i < n; i++)
        for (int j = 0; j < k; j++) out[i * size + place[j]] = ideal[place[j]] + error[i * k + j];
    return 0;
}

int pkm_count(int k, ptrdiff_t n, const double *value, const double *low, const double *width,
              int bins, int64_t *count)
{
    for (int j = 0; j < k; j++, value += n, count += bins + 2)
        for (ptrdiff_t i = 0; i < n; i++) {
            const double place = (value[i] - low[j]) / width[j] + 1.0;
            const double most = bins + 1.0;
            count[place >= most ? bins + 1 : place >= 0.0 ? (ptrdiff_t)place : 0]++;
        }
    return 0;
}

int pkm_normals(int isa, ptrdiff_t n, uint64_t *state, double *out)
{
    CHECKED(isa);
    chosen->normals(n, state, out);
    return 0;
}

int pkm_swarm_start(const pkm_swarm *swarm, int isa, uint64_t seed, const double *lower,
                    const double *upper, double *state)
{
    CHECKED_SWARM(swarm, isa);
    chosen->swarm_start(swarm, seed, lower, upper, state);
    return 0;
}

int pkm_swarm_judge(const pkm_swarm *swarm, int isa, double *state)
{
    CHECKED_SWARM(swarm, isa);
    chosen->swarm_judge(swarm, state);
    return 0;
}

int pkm_swarm_move(const pkm_swarm *swarm, int isa, const double *lower, const double *upper,
                   double *state)
{
    CHECKED_SWARM(swarm, isa);
    chosen->swarm_move(swarm, lower, upper, state);
    return 0;
}

int pkm_swarm_eq18(const pkm_swarm *swarm, int isa, int iterations, uint64_t seed, ptrdiff_t start,
                   ptrdiff_t n, ptrdiff_t rows, const double *off, const double *lower,
                   const double *upper, double *state, double *correction, double *history)
{
    CHECKED_SWARM(swarm, isa);
    if (iterations < 0 || rows < 1) return PKM_BAD_SWARM;
    chosen->swarm_eq18(swarm, iterations, seed, start, n, rows, off, lower, upper, state, correction,
                       history);
    return 0;
}

int pkm_closure_cost(const pkm_machine *machine, int isa, ptrdiff_t particles,
                     const double *geometry, ptrdiff_t n, const double *pose, const double *q,
                     double *cost)
{
    CHECKED_MACHINE(machine, isa);
    chosen->closure_cost(machine, particles, geometry, n, pose, q, cost);
    return 0;
}

int pkm_exp(int isa, ptrdiff_t n, const double *twist, double *motion)
{
    CHECKED(isa);
    chosen->exp(n, twist, motion);
    return 0;
}

int pkm_log(int isa, ptrdiff_t n, const double *motion, double *twist)
{
    CHECKED(isa);
    chosen->log(n, motion, twist);
    return 0;
}

int pkm_adjoint(int isa, ptrdiff_t n, const double *motion, double *adjoint)
{
    CHECKED(isa);
    chosen->adjoint(n, motion, adjoint);
    return 0;
}

int pkm_motion_pose(int isa, ptrdiff_t n, const double *motion, double *pose)
{
    CHECKED(isa);
    chosen->motion_pose(n, motion, pose);
    return 0;
}

int pkm_exp_jacobian(int isa, int inverse, ptrdiff_t n, const double *twist, double *jacobian)
{
    CHECKED(isa);
    chosen->exp_jacobian(inverse, n, twist, jacobian);
    return 0;
}

int pkm_joint_motions(int isa, ptrdiff_t n, const double *error, const double *point,
                      double *motion)
{
    CHECKED(isa);
    chosen->joint_motions(n, error, point, motion);
    return 0;
}

#define CHECKED_ARM(arm, isa)                                                                     \
    CHECKED(isa);                                                                                 \
    if (arm->joints < 1) return PKM_BAD_MACHINE

int pkm_arm_links(const pkm_arm *arm, int isa, ptrdiff_t n, const double *error, double *link)
{
    CHECKED_ARM(arm, isa);
    chosen->arm_links(arm, n, error, link);
    return 0;
}

int pkm_arm_forward(const pkm_arm *arm, const pkm_links *links, int isa, ptrdiff_t n,
                    const double *theta, double *motion)
{
    CHECKED_ARM(arm, isa);
    chosen->arm_forward(arm, links, n, theta, motion);
    return 0;
}

int pkm_arm_jacobian(const pkm_arm *arm, const pkm_links *links, int isa, int frame, ptrdiff_t n,
                     const double *theta, double *jacobian)
{
    CHECKED_ARM(arm, isa);
    chosen->arm_jacobian(arm, links, frame, n, theta, jacobian);
    return 0;
}

int pkm_arm_error_jacobian(const pkm_arm *arm, const pkm_links *links, const double *error, int isa,
                           int frame, ptrdiff_t n, const double *theta, double *jacobian)
{
    CHECKED_ARM(arm, isa);
    chosen->arm_error_jacobian(arm, links, error, frame, n, theta, jacobian);
    return 0;
}
