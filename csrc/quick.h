/* Mixed-precision Newton: the same steps for every row, so no lane waits for another.
 *
 * From the guess a linear prediction, Newton steps and one factorisation in floats; then two steps of
 * the state in doubles, whose closures are found in doubles and solved with those factors. The last
 * residual and the contraction of the two steps decide whether a row is solved; so do small pivots,
 * and a determinant of another sign than at the guess.
 * Every stage runs over all blocks of a batch before the next begins: the processor overlaps them.
 */
#ifndef QUICK_H
#define QUICK_H

#include "inverse.h"
#include "jacobian.h"
#include "newton.h"

enum { BLOCKS = 2, PARTS = JOINED * BLOCKS, BATCH = PARTS * LANES }; /* narrow, wide, rows */
enum { STEPS_PREDICTED = 2, STEPS_GUESSED = 3 }; /* Newton steps in floats */
#define SAFE_PIVOT 1e-3 /* of a scaled system: below it row exchanges may be needed */

/* Where all rows start from: the step per actuator coordinate, and the sign of the determinant. */
typedef struct {
    int known;
    real q[PKM_MAX_LIMBS], turn[PKM_MAX_LIMBS]; /* a turn of the actuator; 0: it is no angle */
    narrow slope[6 * PKM_MAX_LIMBS], state[MAX_STATE];
    narrow_mask sign;
} prediction;

/* LANES rows as they come in, and what may stop them from being solved. */
typedef struct {
    real q[PKM_MAX_LIMBS], guess[6];
    FN(limb_sphere) sphere[PKM_MAX_LIMBS];
    mask usable;
} rows_in;

/* The rows of one batch between the stages. */
typedef struct {
    rows_in in[PARTS];
    limb_sphere_narrow sphere[BLOCKS][PKM_MAX_LIMBS];
    narrow state[BLOCKS][MAX_STATE], factors[BLOCKS][36];
    real fine[PARTS][MAX_STATE], worst[PARTS];
    mask solved[PARTS];
    ptrdiff_t row[PARTS][LANES];
    int count[PARTS], parts, blocks; /* that hold rows: fewer at the end of the rows */
} batch;

/* Sign bits of the determinant, from the factors. */
INLINE narrow_mask determinant_sign(int m, const narrow *factors)
{
    narrow_mask sign = (narrow_mask)factors[0];
    for (int c = 1; c < m; c++) sign ^= (narrow_mask)factors[c * m + c];
    return sign & (narrow_mask)(-fill_narrow(0));
}

/* The step the closures ask for at the guess per actuator coordinate, and the determinant there. */
INLINE void predict(int map, const pkm_machine *machine, const limb_numbers *limb,
                    const double *guess, prediction *start)
{
    const int m = map_m(map), actuators = machine->actuators;
    real pose[6], R[9], p[3], phi[PKM_MAX_ROWS], A[1][36], X[1][PKM_MAX_ROWS], by_g[SLOTS];
    real state[MAX_STATE] = {0}, slope[6 * PKM_MAX_LIMBS];
    narrow factors[36];
    FN(limb_sphere) sphere[PKM_MAX_LIMBS];
    for (int k = 0; k < 6; k++) pose[k] = fill(guess[k]);
    map_from_pose(map, pose, state);
    FN(map_frame)(map, state, R, p);
    inverse_once(machine, limb, R, p, start->q);
    mask usable = spheres_at(machine, limb, start->q, sphere);
    for (int k = 0; k < m * actuators; k++) slope[k] = fill(0.0);
    FN(closure_rows)(map, PLAIN, machine, sphere, state, phi, A[0]);
    FN(factor)(m, 1, A);
    for (int i = 0, r = 0; i < machine->limbs; i++) {
        const int a = machine->actuator[i];
        real by_q;
        start->turn[a] = machine->angle[i] ? TWO_PI * limb[i].per_gain : fill(0.0);
        sphere_derivatives_called(machine, i, &limb[i], R, p, start->q[a], &by_q, by_g);
        for (int j = 0; j < m; j++) X[0][j] = fill(0.0);
        X[0][machine->order[r++]] = by_q;
        for (int kind = 1; kind <= ALL_ROWS; kind *= 2) { /* in the size of PLAIN rows */
            if (!(machine->rows[i] & kind)) continue;
            if (driver_moves(machine->driver[i])) {
                constraint_derivatives(machine, i, kind, &limb[i], &sphere[i], R, p, start->q[a], &by_q,
                                       by_g);
                X[0][machine->order[r]] = by_q * machine->size;
            }
            r++;
        }
        FN(substitute)(m, 1, A, X);
        for (int j = 0; j < m; j++) {
            slope[j * actuators + a] -= X[0][j];
            usable &= is_finite(X[0][j]);
        }
    }
    for (int k = 0; k < m * m; k++) factors[k] = join(A[0][k], A[0][k]);
    for (int k = 0; k < m * actuators; k++) start->slope[k] = join(slope[k], slope[k]);
    for (int s = 0; s < MAX_STATE; s++) start->state[s] = join(state[s], state[s]);
    start->sign = determinant_sign(m, factors);
    start->known = usable[0] != 0;
}

#define PREDICT(NAME, name, ...)                                                                    \
    RARE void predict_##name(const pkm_machine *machine, const limb_numbers *limb,                \
                             const double *guess, prediction *start)                              \
    {                                                                                             \
        predict(MAP_##NAME, machine, limb, guess, start);                                         \
    }
EACH_MAP(PREDICT)
#undef PREDICT

/* Where the rows of a block start, in floats: predicted, or at their own guesses. */
INLINE void start_states(int map, const pkm_machine *machine, const rows_in *first,
                         const rows_in *last, const prediction *start, narrow *state)
{
    const int m = map_m(map), actuators = machine->actuators;
    narrow step[6], change[PKM_MAX_LIMBS], turn = fill_narrow(0);
    if (!start->known) {
        real low[MAX_STATE] = {0}, high[MAX_STATE] = {0};
        map_from_pose(map, first->guess, low);
        map_from_pose(map, last->guess, high);
        for (int s = 0; s < MAX_STATE; s++) state[s] = join(low[s], high[s]);
        return;
    }
    for (int a = 0; a < actuators; a++) {
        real low = first->q[a], high = last->q[a];
        if (start->turn[a][0] != 0.0) {
            low = nearest_turn(low, start->q[a], start->turn[a]);
            high = nearest_turn(high, start->q[a], start->turn[a]);
        }
        change[a] = join(low - start->q[a], high - start->q[a]);
    }
    for (int j = 0; j < m; j++) {
        step[j] = start->slope[j * actuators] * change[0];
        for (int a = 1; a < actuators; a++) step[j] += start->slope[j * actuators + a] * change[a];
        if (map_is_angle(map, j)) turn = larger_narrow(turn, absolute_narrow(step[j]));
    }
    const narrow limit = fill_narrow((float)MAX_TURN);
    const narrow share = limit / larger_narrow(turn, limit);
    for (int j = 0; j < m; j++) step[j] *= share;
    map_retract_narrow(map, start->state, step, state);
}

/* Wide spheres as one narrow; the constants of shared numbers only `once`. */
INLINE void join_spheres(const pkm_machine *machine, int i, int once, const FN(limb_sphere) *first,
                         const FN(limb_sphere) *last, limb_sphere_narrow *both)
{
    if (once || driver_moves(machine->driver[i]))
        for (int k = 0; k < 3; k++) both->c[k] = join(first->c[k], last->c[k]);
    if (once || driver_stretches(machine->driver[i])) both->rho = join(first->rho, last->rho);
    if (!once) return;
    for (int k = 0; k < 3; k++) both->b[k] = join(first->b[k], last->b[k]);
    if (!machine->rows[i]) return;
    for (int a = 0; a < AXES; a++)
        for (int k = 0; k < 3; k++) both->axis[a][k] = join(first->axis[a][k], last->axis[a][k]);
}

/* Newton in floats; the factors are those at the last state. */
INLINE void steps_in_floats(int map, const pkm_machine *machine, int steps,
                            const prediction *start, batch *all)
{
    const int m = map_m(map);
    const double pivot = SAFE_PIVOT * machine->size;
    const float least[2] = {(float)pivot, (float)(pivot * machine->length)};
    narrow phi[BLOCKS][PKM_MAX_ROWS], moved[MAX_STATE];
    for (int k = 0;; k++) {
        for (int t = 0; t < all->blocks; t++)
            closure_rows_narrow(map, PLAIN, machine, all->sphere[t], all->state[t], phi[t],
                                all->factors[t]);
        factor_narrow(m, BLOCKS, all->factors);
        if (k == steps) break;
        substitute_narrow(m, BLOCKS, all->factors, phi);
        for (int t = 0; t < all->blocks; t++) {
            for (int j = 0; j < m; j++) phi[t][j] = -phi[t][j];
            map_retract_narrow(map, all->state[t], phi[t], moved);
            memcpy(all->state[t], moved, sizeof moved);
        }
    }
    for (int t = 0; t < all->blocks; t++) {
        const narrow *factors = all->factors[t];
        narrow large = fill_narrow(0);
        for (int c = 0; c < m; c++)
            large = larger_narrow(large, absolute_narrow(factors[c * m + c]) * least[map_is_angle(map, c)]);
        narrow_mask sound = large < fill_narrow(1);
        if (start->known) sound &= determinant_sign(m, factors) == start->sign;
        const narrow one = select_narrow(sound, fill_narrow(1), fill_narrow(0));
        for (int h = 0; h < JOINED; h++)
            all->solved[JOINED * t + h] = all->in[JOINED * t + h].usable & (part(one, h) > fill(0.0));
    }
}

/* What is left of the closures of a block: in doubles, for they nearly cancel, then as floats. */
INLINE void closures_of_block(int map, const pkm_machine *machine, const batch *all, int t,
                              narrow *phi)
{
    real fine[JOINED][PKM_MAX_ROWS];
    for (int h = 0; h < JOINED; h++)
        FN(closure_rows)(map, PLAIN, machine, all->in[JOINED * t + h].sphere,
                         all->fine[JOINED * t + h], fine[h], NULL);
    for (int r = 0; r < map_m(map); r++) phi[r] = join(fine[0][r], fine[JOINED - 1][r]);
}

/* Two steps in doubles with the factors found in floats: of a step that small floats hold enough. */
INLINE void steps_in_doubles(int map, const pkm_machine *machine, batch *all)
{
    const int m = map_m(map);
    const real size = fill(machine->size);
    const narrow angular = fill_narrow((float)machine->length);
    narrow phi[BLOCKS][PKM_MAX_ROWS], longest[BLOCKS][2];
    real step[6], moved[MAX_STATE];
    for (int h = 0; h < JOINED * all->blocks; h++) {
        for (int s = 0; s < MAX_STATE; s++) moved[s] = part(all->state[h / JOINED][s], h % JOINED);
        FN(map_tidy)(map, moved, all->fine[h]);
    }
    for (int round = 0; round < 2; round++) {
        for (int t = 0; t < all->blocks; t++) closures_of_block(map, machine, all, t, phi[t]);
        substitute_narrow(m, BLOCKS, all->factors, phi);
        for (int t = 0; t < all->blocks; t++) {
            longest[t][round] = fill_narrow(0);
            for (int j = 0; j < m; j++) {
                const narrow length = absolute_narrow(phi[t][j]);
                longest[t][round] = larger_narrow(longest[t][round],
                                                  map_is_angle(map, j) ? length * angular : length);
            }
            for (int h = JOINED * t; h < JOINED * (t + 1); h++) {
                for (int j = 0; j < m; j++) step[j] = -part(phi[t][j], h % JOINED);
                FN(map_retract)(map, all->fine[h], step, moved);
                memcpy(all->fine[h], moved, sizeof moved);
            }
        }
    }
    for (int t = 0; t < all->blocks; t++) {
        closures_of_block(map, machine, all, t, phi[t]);
        narrow worst = fill_narrow(0);
        for (int i = 0, r = 0; i < machine->limbs; i++) { /* in mm */
            narrow scale = 1.0f / all->sphere[t][i].rho;
            for (int kinds = 2 * machine->rows[i] + 1; kinds; kinds &= kinds - 1) {
                worst = larger_narrow(worst, absolute_narrow(phi[t][machine->order[r++]]) * scale);
                scale = fill_narrow((float)(1.0 / machine->size));
            }
        }
        for (int h = JOINED * t; h < JOINED * (t + 1); h++) {
            /* what is left after two steps a, b that contract is about b²/a */
            const real a = part(longest[t][0], h % JOINED), second = part(longest[t][1], h % JOINED);
            const real first = larger(a, second);
            all->worst[h] = part(worst, h % JOINED);
            all->solved[h] &= (all->worst[h] <= CLOSED * size)
                            & (second * second <= SETTLED * size * first);
        }
    }
}

#endif
