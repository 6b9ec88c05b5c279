/* Forward kinematics: Newton on the closures, LANES rows at a time.
 *
 * A lane is done when its closures hold to rounding and the last step was so small that the next
 * cannot matter. Near a singularity the closures hold long before the pose is known: there the
 * step stays large or a pivot vanishes, and the row is called singular, not good.
 */
#ifndef FORWARD_H
#define FORWARD_H

#include "closure.h"
#include "solve.h"

enum { MAX_ITERATIONS = 60, MAX_HALVINGS = 20 };
#define MAX_TURN 0.5            /* rad, the longest rotation of one step */
#define CLOSED 2e-14            /* residual at which a closure holds, relative to the limb's size */
#define SETTLED 5e-12           /* step after which the pose is known, relative likewise */
#define LEAST_PIVOT 2e-5        /* relative pivot under which 1e-11 of the size is not assured */

/* One block: status, iterations and residual of each lane; state holds the guess and the answer. */
INLINE void newton(int map, const pkm_machine *machine, const limb_numbers *limb,
                   const limb_anchor *anchor, mask running, real *state, mask *status,
                   real *iterations, real *residual)
{
    const int m = map_m(map);
    const real zero = FN(fill)(0.0), inverse_length = FN(fill)(1.0 / machine->length);
    real phi[PKM_MAX_ROWS], jacobian[PKM_MAX_ROWS * 6], A[36], step[6] = {0}, trial[MAX_STATE];
    real merit = FN(fill)(INFINITY), worst = merit, share = FN(fill)(1.0), pivot = zero;
    real size = zero;
    for (int i = 0; i < machine->limbs; i++) {
        real limb_size = 1.0 / anchor[i].inverse_rho;
        for (int k = 0; k < 3; k++)
            limb_size += absolute(anchor[i].c[k]) + absolute(limb[i].g[PLATFORM_X + k]);
        size = maximum(size, limb_size);
    }
    const real closed = CLOSED * size, settled = SETTLED * size;
    *status = fill_mask(PKM_NOT_CONVERGED);
    *iterations = zero;
    memcpy(trial, state, sizeof(real) * MAX_STATE);
    for (int k = 0; k <= MAX_ITERATIONS && any(running); k++) {
        const int rows = closure_rows(map, machine, limb, anchor, trial, phi, jacobian);
        real squares = zero, trial_worst = zero;
        for (int r = 0; r < rows; r++) {
            squares += phi[r] * phi[r];
            trial_worst = maximum(trial_worst, absolute(phi[r]));
        }
        /* a step is taken if it does not make things worse, rounding apart */
        const mask better = (squares <= merit * (1.0 + 1e-9) + closed * closed) & running;
        const mask halved = running & ~better;
        share = select(halved, 0.5 * share, FN(fill)(1.0));
        real fresh[6], trial_pivot;
        normal_system(m, rows, 1, jacobian, phi, A, fresh);
        solve(m, 1, A, fresh, &trial_pivot);
        real longest = zero, turn = zero;
        for (int j = 0; j < m; j++) {
            longest = maximum(longest, absolute(fresh[j]));
            if (map_is_angle(map, j)) turn = maximum(turn, absolute(fresh[j]) * inverse_length);
        }
        const mask solvable = finite(longest);
        const mask known = trial_pivot > FN(fill)(LEAST_PIVOT);
        const mask holds = rows > m ? solvable : trial_worst <= closed;
        const mask done = better & holds & known & (longest <= settled);
        const real bound = minimum(FN(fill)(1.0),
                                   minimum(MAX_TURN / maximum(turn, FN(fill)(MAX_TURN)),
                                           size / maximum(longest, size)));
        for (int s = 0; s < MAX_STATE; s++) state[s] = select(better, trial[s], state[s]);
        for (int j = 0; j < m; j++) {
            real bounded = -bound * fresh[j];
            if (map_is_angle(map, j)) bounded *= inverse_length;
            step[j] = select(better, select(solvable, bounded, zero), step[j]);
        }
        merit = select(better, squares, merit);
        worst = select(better, trial_worst, worst);
        pivot = select(better, trial_pivot, pivot);
        *iterations = select(running, *iterations + 1.0, *iterations);
        real partial[6];
        for (int j = 0; j < m; j++) partial[j] = share * step[j];
        map_retract(map, state, partial, trial);
        for (int s = 0; s < MAX_STATE; s++) state[s] = select(done, trial[s], state[s]);
        *status = select_mask(done, fill_mask(PKM_OK), *status);
        running &= ~done & (share > FN(fill)(1.0 / (1 << MAX_HALVINGS)))
                   & (solvable | ~better);
    }
    /* closures that hold where the pose does not follow from them, or no way on: singular */
    const mask lost = *status == fill_mask(PKM_NOT_CONVERGED);
    const mask flat = ~(pivot > FN(fill)(LEAST_PIVOT));
    *status = select_mask(lost & ((worst <= closed) | flat), fill_mask(PKM_SINGULAR), *status);
    *residual = worst;
}

INLINE void forward_block(int map, const pkm_machine *machine, const limb_numbers *limb,
                          const real *q, const real *guess, ptrdiff_t rows, double *pose,
                          int32_t *status, int32_t *iterations, double *residual)
{
    limb_anchor anchor[PKM_MAX_LIMBS];
    real state[MAX_STATE] = {0}, count, worst, out[6];
    mask valid = fill_mask(-1), reachable = fill_mask(-1), code;
    for (int a = 0; a < machine->actuators; a++) valid &= finite(q[a]);
    for (int k = 0; k < 6; k++) valid &= finite(guess[k]);
    for (int i = 0; i < machine->limbs; i++) {
        for (int s = 0; s < SLOTS; s++) valid &= finite(limb[i].g[s]);
        anchor_limb(machine->driver[i], &limb[i], q[machine->actuator[i]], &anchor[i], &reachable);
        reachable &= finite(anchor[i].rho2) & finite(anchor[i].inverse_rho);
        for (int k = 0; k < 3; k++) reachable &= absolute(anchor[i].c[k]) < FN(fill)(1e100);
    }
    map_from_pose(map, guess, state);
    newton(map, machine, limb, anchor, valid & reachable, state, &code, &count, &worst);
    code = select_mask(reachable, code, fill_mask(PKM_INFEASIBLE));
    code = select_mask(valid, code, fill_mask(PKM_INVALID));
    map_to_pose(map, state, out);
    const mask good = code == fill_mask(PKM_OK);
    worst = select(good, worst, FN(fill)(NAN));
    for (int k = 0; k < 6; k++)
        scatter(select(good, out[k], FN(fill)(NAN)), pose + k, 6, rows);
    scatter(worst, residual, 1, rows);
    for (int l = 0; l < LANES && l < rows; l++) {
        status[l] = (int32_t)code[l];
        iterations[l] = (int32_t)count[l];
    }
}

INLINE void forward_map(int map, const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                        ptrdiff_t geometry_stride, const double *q, const double *guess,
                        ptrdiff_t guess_stride, double *pose, int32_t *status, int32_t *iterations,
                        double *residual)
{
    limb_numbers limb[PKM_MAX_LIMBS];
    const int actuators = machine->actuators;
    for (ptrdiff_t row = 0; row < n; row += LANES) {
        const ptrdiff_t rows = n - row;
        real lane_q[PKM_MAX_LIMBS], lane_guess[6];
        if (row == 0 || geometry_stride)
            prepare_limbs(machine, geometry + row * geometry_stride, geometry_stride, rows, limb);
        for (int a = 0; a < actuators; a++)
            lane_q[a] = gather(q + row * actuators + a, actuators, rows);
        for (int k = 0; k < 6; k++)
            lane_guess[k] = gather(guess + row * guess_stride + k, guess_stride, rows);
        forward_block(map, machine, limb, lane_q, lane_guess, rows, pose + 6 * row, status + row,
                      iterations + row, residual + row);
    }
}

#endif
