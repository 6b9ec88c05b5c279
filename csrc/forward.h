/* Forward kinematics of a batch: a quick way that nearly always settles, and Newton for the rest.
 *
 * The quick way is the same for every row, so lanes never wait for each other: from the guess a
 * linear prediction, Newton steps and one factorisation in floats, then two steps in doubles with
 * those factors. The last residual and the contraction of the two steps decide whether the row is
 * solved; a row that is not, or whose elimination met a small pivot or another sign of the
 * determinant than the guess has, starts again at its guess with newton.h.
 */
#ifndef FORWARD_H
#define FORWARD_H

#include "inverse.h"
#include "jacobian.h"
#include "newton.h"

enum { BLOCK = 2 * LANES, CHUNK = 32 };
enum { STEPS_PREDICTED = 2, STEPS_GUESSED = 3 }; /* Newton steps in floats */
#define SAFE_PIVOT 1e-3f

typedef struct {
    const pkm_machine *machine;
    ptrdiff_t n;
    const double *geometry;
    ptrdiff_t geometry_stride;
    const double *q, *guess;
    ptrdiff_t guess_stride;
    double *pose;
    int32_t *status, *iterations;
    double *residual;
} forward_call;

/* Where all rows start from: the step per actuator coordinate, and the sign of the determinant. */
typedef struct {
    int known;
    real q[PKM_MAX_LIMBS], slope[6 * PKM_MAX_LIMBS], state[MAX_STATE];
    double sign;
} prediction;

/* What of one row comes in, and what may stop it from being solved. */
typedef struct {
    real q[PKM_MAX_LIMBS], guess[6];
    FN(limb_sphere) sphere[PKM_MAX_LIMBS];
    mask valid, reachable;
} forward_rows;

INLINE void load_rows(const forward_call *call, const limb_numbers *limb, const ptrdiff_t *row,
                      forward_rows *in)
{
    const pkm_machine *machine = call->machine;
    in->valid = in->reachable = fill_mask(-1);
    for (int a = 0; a < machine->actuators; a++) {
        in->q[a] = gather(call->q + a, machine->actuators, row);
        in->valid &= finite(in->q[a]);
    }
    for (int k = 0; k < 6; k++) {
        in->guess[k] = gather(call->guess + k, call->guess_stride, row);
        in->valid &= finite(in->guess[k]);
    }
    for (int i = 0; i < machine->limbs; i++) {
        for (int s = 0; call->geometry_stride && s < SLOTS; s++) in->valid &= finite(limb[i].g[s]);
        sphere_of_limb(machine->driver[i], &limb[i], in->q[machine->actuator[i]], &in->sphere[i],
                       &in->reachable);
    }
}

INLINE void store_rows(int map, const forward_call *call, const real *state, mask status,
                       int32_t iterations, const int32_t *counts, real residual,
                       const ptrdiff_t *row, int count)
{
    real pose[6];
    const mask good = status == fill_mask(PKM_OK);
    map_to_pose(map, state, pose);
    for (int k = 0; k < 6; k++)
        scatter(select(good, pose[k], fill(NAN)), call->pose + k, 6, row, count);
    scatter(select(good, residual, fill(NAN)), call->residual, 1, row, count);
    for (int l = 0; l < count; l++) {
        call->status[row[l]] = (int32_t)status[l];
        call->iterations[row[l]] = counts ? counts[l] : iterations;
    }
}

/* The slow and safe way for up to LANES rows anywhere in the batch. */
INLINE void newton_rows(int map, const forward_call *call, const limb_numbers *shared,
                        const ptrdiff_t *row, int count)
{
    limb_numbers own[PKM_MAX_LIMBS];
    forward_rows in;
    real state[MAX_STATE] = {0}, taken, worst;
    mask status;
    int32_t counts[LANES];
    if (!shared) prepare_limbs(call->machine, call->geometry, call->geometry_stride, row, own);
    load_rows(call, shared ? shared : own, row, &in);
    map_from_pose(map, in.guess, state);
    newton(map, call->machine, in.sphere, in.valid & in.reachable, state, &status, &taken, &worst);
    status = select_mask(in.reachable, status, fill_mask(PKM_INFEASIBLE));
    status = select_mask(in.valid, status, fill_mask(PKM_INVALID));
    for (int l = 0; l < LANES; l++) counts[l] = (int32_t)taken[l];
    store_rows(map, call, state, status, 0, counts, worst, row, count);
}

/* The step the closures ask for at the guess per actuator coordinate, and the determinant there. */
INLINE void predict(int map, const forward_call *call, const limb_numbers *limb, prediction *start)
{
    const pkm_machine *machine = call->machine;
    const int m = map_m(map), actuators = machine->actuators;
    real pose[6], R[9], p[3], phi[PKM_MAX_ROWS], A[PKM_MAX_ROWS * 6], X[36], by_g[SLOTS], pivot;
    real sign = fill(1.0);
    FN(limb_sphere) sphere[PKM_MAX_LIMBS];
    mask reachable = fill_mask(-1);
    for (int k = 0; k < 6; k++) pose[k] = fill(call->guess[k]);
    memset(start->state, 0, sizeof start->state);
    map_from_pose(map, pose, start->state);
    FN(map_frame)(map, start->state, R, p);
    inverse_at(machine, limb, R, p, start->q);
    for (int i = 0; i < machine->limbs; i++)
        sphere_of_limb(machine->driver[i], &limb[i], start->q[machine->actuator[i]], &sphere[i],
                       &reachable);
    FN(closure_rows)(map, machine, sphere, start->state, phi, A);
    FN(factor)(m, A, &pivot);
    for (int c = 0; c < m; c++) sign *= A[c * m + c];
    for (int a = 0; a < actuators * m; a++) start->slope[a] = fill(0.0);
    for (int i = 0, r = 0; i < machine->limbs; i++) {
        const int a = machine->actuator[i];
        real by_q;
        sphere_derivatives(machine, i, &limb[i], R, p, start->q[a], &by_q, by_g);
        for (int j = 0; j < m; j++) X[j] = fill(0.0);
        X[machine->order[r]] = by_q * sphere[i].inverse_rho * machine->weight[r];
        FN(substitute)(m, A, X);
        for (int j = 0; j < m; j++)
            start->slope[j * actuators + a] -= X[j] * (map_is_angle(map, j) ? 1.0 / machine->length : 1.0);
        r += 1 + __builtin_popcount((unsigned)machine->rows[i]);
    }
    start->sign = sign[0] > 0.0 ? 1.0 : -1.0;
    start->known = (reachable & (pivot > fill((double)SAFE_PIVOT)))[0] != 0;
}

INLINE void start_state(int map, const forward_call *call, const forward_rows *in,
                        const prediction *start, real *state)
{
    const int m = map_m(map), actuators = call->machine->actuators;
    real step[6];
    if (!start) {
        map_from_pose(map, in->guess, state);
        return;
    }
    real turn = fill(0.0);
    for (int j = 0; j < m; j++) {
        step[j] = fill(0.0);
        for (int a = 0; a < actuators; a++)
            step[j] += start->slope[j * actuators + a] * (in->q[a] - start->q[a]);
        if (map_is_angle(map, j)) turn = maximum(turn, absolute(step[j]));
    }
    const real share = MAX_TURN / maximum(turn, fill(MAX_TURN));
    for (int j = 0; j < m; j++) step[j] *= share;
    FN(map_retract)(map, start->state, step, state);
}

/* Two steps in doubles with the factors found in floats, from half `which` of the float state;
 * `solved` says where that was enough. */
INLINE void polish(int map, const pkm_machine *machine, const FN(limb_sphere) *sphere,
                   const narrow *factors, const narrow *float_state, int which, real *state,
                   real *worst, mask *solved)
{
    const int m = map_m(map);
    real phi[PKM_MAX_ROWS], unused[PKM_MAX_ROWS * 6], A[36], moved[MAX_STATE], longest[2];
    const real size = machine_size(machine, sphere);
    for (int k = 0; k < m * m; k++) A[k] = half(factors[k], which);
    for (int s = 0; s < MAX_STATE; s++) moved[s] = half(float_state[s], which);
    for (int j = 0; j < m; j++) phi[j] = fill(0.0);
    FN(map_retract)(map, moved, phi, state); /* unit length to double precision */
    for (int round = 0; round < 2; round++) {
        FN(closure_rows)(map, machine, sphere, state, phi, unused);
        FN(substitute)(m, A, phi);
        longest[round] = fill(0.0);
        for (int j = 0; j < m; j++) {
            longest[round] = maximum(longest[round], absolute(phi[j]));
            phi[j] *= map_is_angle(map, j) ? -1.0 / machine->length : -1.0;
        }
        FN(map_retract)(map, state, phi, moved);
        memcpy(state, moved, sizeof moved);
    }
    FN(closure_rows)(map, machine, sphere, state, phi, unused);
    *worst = fill(0.0);
    for (int r = 0; r < m; r++) *worst = maximum(*worst, absolute(phi[r]));
    /* what is left after two steps a, b that contract is about b²/a */
    *solved = (*worst <= CLOSED * size)
            & (longest[1] * longest[1] <= SETTLED * size * maximum(longest[0], longest[1]));
}

/* BLOCK rows the quick way; those that are not solved are appended to `lost`. */
INLINE int quick_block(int map, const forward_call *call, const limb_numbers *shared,
                       const prediction *start, ptrdiff_t first, ptrdiff_t *lost)
{
    const pkm_machine *machine = call->machine;
    const int m = map_m(map), limbs = machine->limbs;
    const int steps = start ? STEPS_PREDICTED : STEPS_GUESSED;
    ptrdiff_t row[2][LANES];
    forward_rows in[2];
    real state[2][MAX_STATE] = {0};
    narrow float_state[MAX_STATE], moved[MAX_STATE], phi[PKM_MAX_ROWS], A[PKM_MAX_ROWS * 6], pivot;
    limb_sphere_narrow sphere[PKM_MAX_LIMBS];
    int count[2], losses = 0;
    for (int h = 0; h < 2; h++) {
        limb_numbers own[PKM_MAX_LIMBS];
        count[h] = block_rows(first + h * LANES, call->n, row[h]);
        if (!shared)
            prepare_limbs(machine, call->geometry, call->geometry_stride, row[h], own);
        load_rows(call, shared ? shared : own, row[h], &in[h]);
        start_state(map, call, &in[h], start, state[h]);
    }
    for (int i = 0; i < limbs; i++) {
        const real *low = (const real *)&in[0].sphere[i], *high = (const real *)&in[1].sphere[i];
        narrow *both = (narrow *)&sphere[i];
        const int used = machine->rows[i] ? sizeof sphere[i] / sizeof *both : 8;
        for (int k = 0; k < used; k++) both[k] = join(low[k], high[k]);
    }
    for (int s = 0; s < MAX_STATE; s++) float_state[s] = join(state[0][s], state[1][s]);
    for (int k = 0;; k++) {
        closure_rows_narrow(map, machine, sphere, float_state, phi, A);
        factor_narrow(m, A, &pivot);
        if (k == steps) break;
        substitute_narrow(m, A, phi);
        for (int j = 0; j < m; j++)
            phi[j] *= map_is_angle(map, j) ? (float)(-1.0 / machine->length) : -1.0f;
        map_retract_narrow(map, float_state, phi, moved);
        memcpy(float_state, moved, sizeof moved);
    }
    narrow sign = fill_narrow(start ? (float)start->sign : 0.0f);
    for (int c = 0; c < m; c++) sign *= A[c * m + c];
    const narrow_mask sound = (pivot > fill_narrow(SAFE_PIVOT)) & (sign >= fill_narrow(0.0f));
    const narrow soundness = (narrow)(sound & (narrow_mask)fill_narrow(1.0f));
    for (int h = 0; h < 2 && count[h] > 0; h++) {
        mask solved;
        real worst;
        polish(map, machine, in[h].sphere, A, float_state, h, state[h], &worst, &solved);
        solved &= in[h].valid & in[h].reachable & (half(soundness, h) > fill(0.0));
        store_rows(map, call, state[h], select_mask(solved, fill_mask(0), fill_mask(-1)),
                   steps + 2, NULL, worst, row[h], count[h]);
        if (any(~solved))
            for (int l = 0; l < count[h]; l++)
                if (!solved[l]) lost[losses++] = row[h][l];
    }
    return losses;
}

INLINE void forward_map(int map, const forward_call *call)
{
    const pkm_machine *machine = call->machine;
    limb_numbers shared[PKM_MAX_LIMBS];
    prediction start = {0};
    ptrdiff_t lost[CHUNK * BLOCK + LANES], zero[LANES] = {0};
    int rows = 0, losses = 0;
    for (int i = 0; i < machine->limbs; i++) rows += 1 + __builtin_popcount((unsigned)machine->rows[i]);
    if (!call->geometry_stride) prepare_limbs(machine, call->geometry, 0, zero, shared);
    const limb_numbers *numbers = call->geometry_stride ? NULL : shared;
    if (rows == map_m(map) && numbers && !call->guess_stride) predict(map, call, shared, &start);
    for (ptrdiff_t first = 0; first < call->n;) {
        const ptrdiff_t end = first + CHUNK * BLOCK < call->n ? first + CHUNK * BLOCK : call->n;
        if (rows == map_m(map))
            for (; first < end; first += BLOCK)
                losses += quick_block(map, call, numbers, start.known ? &start : NULL, first, lost + losses);
        else
            for (; first < end; first++) lost[losses++] = first;
        /* full blocks of what was lost now, the rest with the next chunk or at the end */
        const int whole = first < call->n ? losses - losses % LANES : losses;
        for (int k = 0; k < whole; k += LANES) {
            ptrdiff_t row[LANES];
            const int count = losses - k < LANES ? losses - k : LANES;
            for (int l = 0; l < LANES; l++) row[l] = lost[k + (l < count ? l : 0)];
            newton_rows(map, call, numbers, row, count);
        }
        losses -= whole;
        memmove(lost, lost + whole, (size_t)losses * sizeof *lost);
    }
}

#endif
