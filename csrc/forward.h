/* Forward kinematics of many rows: mixed-precision Newton for all, safeguarded Newton for
 * what it did not solve. */
#ifndef FORWARD_H
#define FORWARD_H

#include "quick.h"

enum { CHUNK = 16 * BATCH }; /* rows between two looks at what is left for Newton */

typedef struct {
    const pkm_machine *machine;
    ptrdiff_t n;
    const double *geometry;
    ptrdiff_t geometry_stride;
    const double *q;
    ptrdiff_t q_stride; /* 0 where all rows share them */
    const double *guess;
    ptrdiff_t guess_stride;
    double *pose;
    int32_t *status, *iterations;
    double *residual;
} forward_call;

SHARED void load_rows(const forward_call *call, const limb_numbers *limb, const ptrdiff_t *row,
                      int once, rows_in *in)
{
    const pkm_machine *machine = call->machine;
    in->usable = fill_mask(-1);
    gather_row(call->q, call->q_stride, machine->actuators, row, in->q);
    if (once || call->guess_stride || !call->q_stride)
        gather_row(call->guess, call->guess_stride, 6, row, in->guess);
    for (int i = 0; i < machine->limbs; i++) {
        if (once) sphere_of_numbers(machine->driver[i], &limb[i], &in->sphere[i]);
        sphere_at(machine->driver[i], &limb[i], in->q[machine->actuator[i]], &in->sphere[i],
                  &in->usable);
    }
}

/* Rows with a number that is not finite, in what came in or in their own geometry. */
SHARED mask invalid_rows(const forward_call *call, const limb_numbers *limb, const rows_in *in)
{
    mask valid = fill_mask(-1);
    for (int a = 0; a < call->machine->actuators; a++) valid &= is_finite(in->q[a]);
    for (int k = 0; k < 6; k++) valid &= is_finite(in->guess[k]);
    for (int i = 0; i < call->machine->limbs; i++)
        for (int s = 0; s < SLOTS; s++) valid &= is_finite(limb[i].g[s]);
    return ~valid;
}

INLINE void store_rows(int map, const forward_call *call, const real *state, mask status,
                       real iterations, real residual, const ptrdiff_t *row, int count)
{
    real pose[6];
    const mask good = status == fill_mask(PKM_OK);
    map_to_pose(map, state, pose);
    for (int k = 0; k < 6; k++) pose[k] = select(good, pose[k], fill(NAN));
    scatter_row(pose, 6, call->pose, 6, row, count);
    const mask closest = good | (status == fill_mask(PKM_NOT_CLOSED));
    scatter(select(closest, residual, fill(NAN)), call->residual, 1, row, count);
    for (int l = 0; l < count; l++) {
        call->status[row[l]] = (int32_t)status[l];
        call->iterations[row[l]] = (int32_t)iterations[l];
    }
}

/* Safeguarded Newton for up to LANES rows anywhere in the batch. */
INLINE void newton_rows(int map, const forward_call *call, const limb_numbers *shared,
                        const ptrdiff_t *row, int count)
{
    limb_numbers own[PKM_MAX_LIMBS];
    const limb_numbers *limb = shared ? shared : own;
    rows_in in;
    real state[MAX_STATE] = {0}, iterations, worst;
    mask status;
    if (!shared) prepare_limbs(call->machine, call->geometry, call->geometry_stride, row, own);
    load_rows(call, limb, row, 1, &in);
    map_from_pose(map, in.guess, state);
    newton(map, call->machine, in.sphere, in.usable, state, &status, &iterations, &worst);
    status = select_mask(in.usable, status, fill_mask(PKM_INFEASIBLE));
    status = select_mask(invalid_rows(call, limb, &in), fill_mask(PKM_INVALID), status);
    store_rows(map, call, state, status, iterations, worst, row, count);
}

#define NEWTON_ROWS(NAME, name, ...)                                                                \
    SHARED void newton_##name(const forward_call *call, const limb_numbers *shared,               \
                              const ptrdiff_t *row, int count)                                    \
    {                                                                                             \
        newton_rows(MAP_##NAME, call, shared, row, count);                                        \
    }
EACH_MAP(NEWTON_ROWS)
#undef NEWTON_ROWS

/* Those `count` of a call's rows that mixed-precision Newton did not solve. */
INLINE void solve_rest(int map, const forward_call *call, const limb_numbers *shared,
                       const ptrdiff_t *unsolved, int count)
{
    for (int k = 0; k < count; k += LANES) {
        ptrdiff_t row[LANES];
        const int some = count - k < LANES ? count - k : LANES;
        for (int l = 0; l < LANES; l++) row[l] = unsolved[k + (l < some ? l : 0)];
        switch (map) {
#define CASE(NAME, name, ...) case MAP_##NAME: newton_##name(call, shared, row, some); break;
            EACH_MAP(CASE)
#undef CASE
        }
    }
}

/* The rows from `first` on; numbers that each has of its own land in `own`. */
INLINE void begin_batch(const forward_call *call, ptrdiff_t first, limb_numbers *own, batch *all)
{
    const ptrdiff_t left = (call->n - first + LANES - 1) / LANES;
    all->parts = left < PARTS ? (int)left : PARTS;
    all->blocks = (all->parts + JOINED - 1) / JOINED;
    for (int h = 0; h < JOINED * all->blocks; h++) {
        all->count[h] = block_rows(first + h * LANES, call->n, all->row[h]);
        if (own)
            prepare_limbs(call->machine, call->geometry, call->geometry_stride, all->row[h],
                          own + h * PKM_MAX_LIMBS);
    }
}

/* A batch of rows by mixed-precision Newton, the constants of their numbers loaded only `once`; those
 * it does not solve are appended to `unsolved`. */
INLINE int quick_rows(int map, const forward_call *call, const limb_numbers *shared,
                      const limb_numbers *own, const prediction *start, int once, batch *all,
                      ptrdiff_t *unsolved)
{
    const pkm_machine *machine = call->machine;
    const int steps = start->known ? STEPS_PREDICTED : STEPS_GUESSED;
    int pending = 0;
    for (int h = 0; h < JOINED * all->blocks; h++)
        load_rows(call, shared ? shared : own + h * PKM_MAX_LIMBS, all->row[h], once, &all->in[h]);
    for (int t = 0; t < all->blocks; t++) {
        const rows_in *low = &all->in[JOINED * t], *high = low + JOINED - 1;
        for (int i = 0; i < machine->limbs; i++)
            join_spheres(machine, i, once, &low->sphere[i], &high->sphere[i], &all->sphere[t][i]);
        start_states(map, machine, low, high, start, all->state[t]);
    }
    steps_in_floats(map, machine, steps, start, all);
    steps_in_doubles(map, machine, all);
    for (int h = 0; h < all->parts; h++) {
        const mask status = select_mask(all->solved[h], fill_mask(PKM_OK), fill_mask(-1));
        store_rows(map, call, all->fine[h], status, fill(steps + 2.0), all->worst[h], all->row[h],
                   all->count[h]);
        if (any(status))
            for (int l = 0; l < all->count[h]; l++)
                if (status[l]) unsolved[pending++] = all->row[h][l];
    }
    return pending;
}

#define QUICK_ROWS(NAME, name, ...)                                                                 \
    SHARED int quick_##name(const forward_call *call, const limb_numbers *shared,                 \
                            const limb_numbers *own, const prediction *start, int once,           \
                            batch *all, ptrdiff_t *unsolved)                                      \
    {                                                                                             \
        return quick_rows(MAP_##NAME, call, shared, own, start, once, all, unsolved);             \
    }
EACH_MAP(QUICK_ROWS)
#undef QUICK_ROWS

INLINE int quick(int map, const forward_call *call, const limb_numbers *shared,
                 const limb_numbers *own, const prediction *start, int once, batch *all,
                 ptrdiff_t *unsolved)
{
    switch (map) {
#define CASE(NAME, name, ...) case MAP_##NAME: return quick_##name(call, shared, own, start, once, all, unsolved);
        EACH_MAP(CASE)
#undef CASE
    }
    return 0;
}

INLINE void clear_batch(batch *all)
{
    memset(all->state, 0, sizeof all->state);
    memset(all->fine, 0, sizeof all->fine);
    memset(all->factors, 0, sizeof all->factors);
}

/* Whether a machine has as many rows as free coordinates: others are for Newton alone. */
SHARED int is_square(const pkm_machine *machine)
{
    int rows = 0;
    for (int i = 0; i < machine->limbs; i++) rows += 1 + __builtin_popcount((unsigned)machine->rows[i]);
    return rows == map_m(machine->map);
}

SHARED void forward_rows(const forward_call *call)
{
    const pkm_machine *machine = call->machine;
    const int map = machine->map;
    limb_numbers numbers[PARTS * PKM_MAX_LIMBS];
    prediction start;
    batch all;
    ptrdiff_t unsolved[CHUNK + LANES], zero[LANES] = {0};
    int pending = 0;
    const int square = is_square(machine);
    const limb_numbers *shared = call->geometry_stride ? NULL : numbers;
    limb_numbers *own = shared ? NULL : numbers;
    if (shared) prepare_limbs(machine, call->geometry, 0, zero, numbers);
    start.known = 0;
    if (shared && square && !call->guess_stride)
        switch (map) {
#define CASE(NAME, name, ...) case MAP_##NAME: predict_##name(machine, shared, call->guess, &start); break;
            EACH_MAP(CASE)
#undef CASE
        }
    clear_batch(&all);
    for (ptrdiff_t first = 0; first < call->n;) {
        const ptrdiff_t end = first + CHUNK < call->n ? first + CHUNK : call->n;
        if (square)
            for (; first < end; first += BATCH) {
                begin_batch(call, first, own, &all);
                const int once = own || first == 0; /* is there anything but actuators to load? */
                pending += quick(map, call, shared, own, &start, once, &all, unsolved + pending);
            }
        else
            for (; first < end; first++) unsolved[pending++] = first;
        /* full blocks of what is left now, the rest with the next chunk or at the end */
        const int whole = first < call->n ? pending - pending % LANES : pending;
        solve_rest(map, call, shared, unsolved, whole);
        pending -= whole;
        memmove(unsolved, unsolved + whole, (size_t)pending * sizeof *unsolved);
    }
}

/* Machines at one place after the other, for which their numbers are prepared once. */
SHARED void forward_places(const forward_call *call, ptrdiff_t places)
{
    const ptrdiff_t n = call->n;
    const int map = call->machine->map, square = is_square(call->machine);
    limb_numbers own[PARTS * PKM_MAX_LIMBS];
    prediction start;
    batch all;
    ptrdiff_t unsolved[BATCH];
    start.known = 0;
    clear_batch(&all);
    for (ptrdiff_t first = 0; first < n; first += BATCH) {
        begin_batch(call, first, own, &all);
        for (ptrdiff_t k = 0; k < places; k++) {
            forward_call at = *call;
            at.q += k * call->machine->actuators, at.guess += 6 * k;
            at.pose += 6 * n * k, at.residual += n * k, at.status += n * k, at.iterations += n * k;
            int pending = 0;
            if (square)
                pending = quick(map, &at, NULL, own, &start, k == 0, &all, unsolved);
            else
                for (; pending < BATCH && first + pending < n; pending++) unsolved[pending] = first + pending;
            solve_rest(map, &at, NULL, unsolved, pending);
        }
    }
}

int CALL(forward)(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                  ptrdiff_t geometry_stride, const double *q, const double *guess,
                  ptrdiff_t guess_stride, double *pose, int32_t *status, int32_t *iterations,
                  double *residual)
{
    const forward_call call = {machine, n, geometry, geometry_stride, q, machine->actuators,
                               guess, guess_stride, pose, status, iterations, residual};
    if (!pkm_prepared(machine)) return PKM_BAD_MACHINE;
    forward_rows(&call);
    return 0;
}

int CALL(forward_machines)(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                           ptrdiff_t places, const double *q, const double *guess, double *pose,
                           int32_t *status, int32_t *iterations, double *residual)
{
    const ptrdiff_t stride = (ptrdiff_t)SLOTS * machine->limbs;
    const forward_call call = {machine, n, geometry, stride, q, 0, guess, 0,
                               pose, status, iterations, residual};
    if (!pkm_prepared(machine)) return PKM_BAD_MACHINE;
    forward_places(&call, places);
    return 0;
}

#endif
