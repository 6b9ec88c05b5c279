/* Forward kinematics of machines that yield: numbers of limbs that give way by what pulls at the
 * platform.
 *
 * From the pose of the rigid machine, in lanes: forces of the closures by the transposed system, what
 * they make numbers give, and a step of the platform, until both stay. The system is factored once, at
 * the rigid pose; with these factors forces and steps are corrected by what they miss, which makes them
 * as much better as the sag is smaller than the machine, and so are the numbers.
 */
#ifndef LOADED_H
#define LOADED_H

#include "forward.h"
#include "jacobian.h"

enum { MAX_GIVEN = PKM_MAX_LIMBS * SLOTS };
#define EXPECTED 0.05 /* of a change that is none: the factor that changes fall by is an estimate */
#define RESTED 1e-14 /* step of the platform that is none, relative to the size */

typedef struct {
    const forward_call *rigid;
    const int32_t *column; /* of the numbers that yield */
    int columns, steps;
    const double *compliance, *pull;
    ptrdiff_t compliance_stride, pull_stride;
    const double *settled, *most; /* of each number: a change that is none, and what is too much */
} loaded_call;

/* Solve Aᵀ x = b in place with the factors that elimination left. */
INLINE void solve_transposed(int m, const real *A, const mask *swaps, real *b)
{
    for (int c = 0; c < m; c++) {
        for (int i = 0; i < c; i++) b[c] -= A[i * m + c] * b[i];
        b[c] *= A[c * m + c];
    }
    for (int c = m - 1; c >= 0; c--) {
        for (int i = c + 1; i < m; i++) b[c] -= A[i * m + c] * b[i];
        for (int i = m - 1; i > c; i--) {
            const real above = b[c], below = b[i];
            b[c] = select(swaps[i * m + c], below, above);
            b[i] = select(swaps[i * m + c], above, below);
        }
    }
}

/* Moment of a force at a point of the platform, R point, added to `moment`. */
INLINE void add_moment(const real *R, const real *point, const real *force, real *moment)
{
    real arm[3];
    for (int k = 0; k < 3; k++)
        arm[k] = R[3 * k] * point[0] + R[3 * k + 1] * point[1] + R[3 * k + 2] * point[2];
    moment[0] += arm[1] * force[2] - arm[2] * force[1];
    moment[1] += arm[2] * force[0] - arm[0] * force[2];
    moment[2] += arm[0] * force[1] - arm[1] * force[0];
}

/* What pulls, by a map's step with an angle as its arc: pull is Σ m r (3), Σ m, gravity (3), a point
 * (3), the force at it (3) and a moment (3). */
INLINE void pulled_rows(int map, const pkm_machine *machine, const real *state, const real *R,
                        const real *pull, real *row)
{
    real moment[3], force[3];
    for (int k = 0; k < 3; k++) {
        moment[k] = pull[13 + k];
        force[k] = pull[3] * pull[4 + k] + pull[10 + k];
    }
    add_moment(R, pull, pull + 4, moment);
    add_moment(R, pull + 7, pull + 10, moment);
    FN(map_pull)(map, state, moment, force, row);
    for (int j = 0; j < map_m(map); j++)
        if (map_is_angle(map, j)) row[j] *= fill(1.0 / machine->length);
}

/* A system at the rigid pose, and what goes on with it. */
typedef struct {
    real A[36], lambda[6]; /* factors, and the forces of the rows in their order */
    mask swaps[36];
    real change, expected; /* how much a number changed for its limit, and what the next is */
} rest_state;

/* What the numbers of limb i give at its forces, and what that changes of the residual. Returns how
 * many numbers it has. */
INLINE int limb_gives(const loaded_call *call, int i, int c, int r, const limb_numbers *limb,
                      const FN(limb_sphere) *sphere, const real *R, const real *p, real q,
                      const real *lambda, const real *compliance, real *given, real *residual,
                      real *changed, mask *far)
{
    const pkm_machine *machine = call->rigid->machine;
    real slope[5][SLOTS], force[SLOTS], by_q;
    int place[5], rows = 0, end = c;
    while (end < call->columns && call->column[end] / SLOTS == i) end++;
    if (end == c) return 0;
    for (int s = 0; s < SLOTS; s++) force[s] = fill(0.0);
    for (int kind = 0; kind <= ALL_ROWS; kind = kind ? 2 * kind : 1) {
        if (kind && !(machine->rows[i] & kind)) continue;
        real scale = fill(machine->weight[r]);
        if (kind) {
            constraint_derivatives(machine, i, kind, limb, sphere, R, p, q, &by_q, slope[rows]);
        } else {
            sphere_derivatives(machine, i, limb, R, p, q, &by_q, slope[rows]);
            scale /= sphere->rho;
        }
        place[rows] = machine->order[r++];
        for (int k = c; k < end; k++) {
            const int s = call->column[k] % SLOTS;
            slope[rows][s] *= scale;
            force[s] -= lambda[place[rows]] * slope[rows][s];
        }
        rows++;
    }
    for (int k = c; k < end; k++) {
        const int s = call->column[k] % SLOTS;
        const real fresh = compliance[k] * force[s], change = fresh - given[k];
        *changed = larger(*changed, absolute(change) * fill(1.0 / call->settled[k]));
        *far |= ~(absolute(fresh) <= fill(call->most[k]));
        for (int t = 0; t < rows; t++) residual[place[t]] += slope[t][s] * change;
        given[k] = fresh;
    }
    return end - c;
}

/* One step: how far the numbers give at the state, and the step to where the platform follows. */
INLINE void rest_step(int map, const loaded_call *call, const limb_numbers *limb, const real *q,
                      const real *pull, const real *compliance, const real *state, int first,
                      rest_state *at, real *given, real *step, mask *gives, mask *fails)
{
    const pkm_machine *machine = call->rigid->machine;
    const int m = map_m(map);
    FN(limb_sphere) sphere[PKM_MAX_LIMBS];
    real R[9], p[3], residual[PKM_MAX_ROWS], A[PKM_MAX_ROWS * 6], missing[6], pivot = fill(1.0);
    real change = fill(0.0), longest = fill(0.0);
    mask far = fill_mask(0);
    FN(map_frame)(map, state, R, p);
    const mask usable = spheres_at(machine, limb, q, sphere);
    scaled_rows(map, machine, sphere, state, residual, A);
    pulled_rows(map, machine, state, R, pull, missing);
    if (first) {
        memcpy(at->A, A, sizeof(real) * m * m);
        eliminate(m, 0, at->A, NULL, at->swaps, &pivot);
        for (int r = 0; r < m; r++) at->lambda[r] = fill(0.0);
    }
    for (int j = 0; j < m; j++)
        for (int r = 0; r < m; r++) missing[j] -= A[r * m + j] * at->lambda[r];
    solve_transposed(m, at->A, at->swaps, missing);
    for (int r = 0; r < m; r++) at->lambda[r] += missing[r];
    for (int i = 0, r = 0, c = 0; i < machine->limbs; i++) {
        c += limb_gives(call, i, c, r, &limb[i], &sphere[i], R, p, q[machine->actuator[i]],
                        at->lambda, compliance, given, residual, &change, &far);
        r += 1 + __builtin_popcount((unsigned)machine->rows[i]);
    }
    *gives = ~(change <= fill(1.0));
    solve_again(m, at->A, at->swaps, residual);
    for (int j = 0; j < m; j++) {
        longest = larger(longest, absolute(residual[j]));
        step[j] = residual[j] * fill(map_is_angle(map, j) ? -1.0 / machine->length : -1.0);
    }
    /* changes fall by the same factor, and the sum of those to come is next to the first of them */
    change = larger(change, longest * fill(1.0 / (RESTED * machine->size)));
    at->expected = first ? change : change * (change / at->change);
    at->change = change;
    *fails = ~(usable & ~far & (pivot > fill(LEAST_PIVOT)) & (longest <= fill(machine->size)));
}

/* Rows whose rigid pose is known, up to LANES of them: their pose where the numbers come to rest, or
 * PKM_NOT_CONVERGED where they do not by steps of this kind. */
INLINE void rest_rows(int map, const loaded_call *call, const limb_numbers *shared,
                      const ptrdiff_t *row, int count)
{
    const forward_call *rigid = call->rigid;
    const pkm_machine *machine = rigid->machine;
    limb_numbers limb[PKM_MAX_LIMBS];
    real q[PKM_MAX_LIMBS], compliance[MAX_GIVEN], pull[16], before[7], state[MAX_STATE] = {0};
    real given[MAX_GIVEN], fresh[MAX_GIVEN], step[6], moved[MAX_STATE], taken = fill(0.0);
    mask running, gives, fails, changed = fill_mask(0), lost = fill_mask(0);
    rest_state at;
    for (int l = 0; l < LANES; l++) running[l] = rigid->status[row[l]] == PKM_OK ? -1 : 0;
    memcpy(limb, shared, sizeof *limb * (size_t)machine->limbs);
    gather_row(rigid->q, rigid->q_stride, machine->actuators, row, q);
    gather_row(call->compliance, call->compliance_stride, call->columns, row, compliance);
    gather_row(call->pull, call->pull_stride, 16, row, pull);
    gather_row(rigid->pose, 6, 6, row, before);
    before[6] = gather(rigid->residual, 1, row);
    map_from_pose(map, before, state);
    for (int k = 0; k < call->columns; k++) given[k] = fill(0.0);
    for (int k = 0; k < call->steps && any(running); k++) {
        memcpy(fresh, given, sizeof *fresh * (size_t)call->columns);
        rest_step(map, call, limb, q, pull, compliance, state, k == 0, &at, fresh, step, &gives,
                  &fails);
        lost |= running & fails;
        running &= ~fails;
        if (k == 0) running &= gives; /* else the rigid pose stays as it is */
        changed |= running;
        taken = select(running, taken + 1.0, taken);
        FN(map_retract)(map, state, step, moved);
        for (int s = 0; s < MAX_STATE; s++) state[s] = select(running, moved[s], state[s]);
        for (int j = 0; j < call->columns; j++) {
            real *number = &limb[call->column[j] / SLOTS].g[call->column[j] % SLOTS];
            given[j] = select(running, fresh[j], given[j]);
            *number = shared[call->column[j] / SLOTS].g[call->column[j] % SLOTS] + given[j];
        }
        for (int i = 0; i < machine->limbs; i++)
            if (driver_moves(machine->driver[i]) || machine->rows[i]) prepare_limb(machine, i, &limb[i]);
        running &= ~(at.expected <= fill(EXPECTED));
    }
    lost |= running;
    FN(limb_sphere) sphere[PKM_MAX_LIMBS];
    real pose[6], phi[PKM_MAX_ROWS], worst = fill(0.0);
    spheres_at(machine, limb, q, sphere);
    const int rows = scaled_rows(map, machine, sphere, state, phi, NULL);
    for (int r = 0; r < rows; r++)
        worst = larger(worst, absolute(phi[machine->order[r]]) * (1.0 / machine->weight[r]));
    map_to_pose(map, state, pose);
    for (int k = 0; k < 6; k++) pose[k] = select(changed, pose[k], before[k]);
    scatter_row(pose, 6, rigid->pose, 6, row, count);
    scatter(select(changed, worst, before[6]), rigid->residual, 1, row, count);
    for (int l = 0; l < count; l++) {
        rigid->iterations[row[l]] += (int32_t)taken[l];
        if (lost[l]) rigid->status[row[l]] = PKM_NOT_CONVERGED;
    }
}

#define REST_ROWS(NAME, name, ...)                                                                \
    SHARED void rest_##name(const loaded_call *call, const limb_numbers *shared,                  \
                            const ptrdiff_t *row, int count)                                      \
    {                                                                                             \
        rest_rows(MAP_##NAME, call, shared, row, count);                                          \
    }
EACH_MAP(REST_ROWS)
#undef REST_ROWS

int CALL(forward_loaded)(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                         const double *q, const double *guess, ptrdiff_t guess_stride,
                         const int32_t *column, int columns, const double *compliance,
                         ptrdiff_t compliance_stride, const double *pull, ptrdiff_t pull_stride,
                         const double *settled, const double *most, int steps, double *pose,
                         int32_t *status, int32_t *iterations, double *residual)
{
    const forward_call rigid = {machine, n, geometry, 0, q, machine->actuators,
                                guess, guess_stride, pose, status, iterations, residual};
    const loaded_call call = {&rigid, column, columns, steps, compliance, pull,
                              compliance_stride, pull_stride, settled, most};
    limb_numbers shared[PKM_MAX_LIMBS];
    const ptrdiff_t zero[LANES] = {0};
    if (!pkm_prepared(machine) || !is_square(machine)) return PKM_BAD_MACHINE;
    for (int c = 0; c < columns; c++)
        if (column[c] < 0 || column[c] >= SLOTS * machine->limbs || (c && column[c] <= column[c - 1]))
            return PKM_BAD_COLUMN;
    forward_rows(&rigid);
    prepare_limbs(machine, geometry, 0, zero, shared);
    EACH_BLOCK(first, n, row, count) {
        switch (machine->map) {
#define CASE(NAME, name, ...) case MAP_##NAME: rest_##name(&call, shared, row, count); break;
            EACH_MAP(CASE)
#undef CASE
        }
    }
    return 0;
}

#endif
