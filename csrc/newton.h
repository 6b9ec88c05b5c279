/* Newton on the closures with everything that makes it safe: exchanges of rows in the elimination,
 * bounded turns, steps halved until they improve. It runs where mixed-precision Newton in forward.h
 * does not settle.
 *
 * A lane is done when its closures hold to rounding and the last step was so small that the next
 * cannot matter. Near a singularity the closures hold long before the pose is known: there the
 * step stays large or a pivot vanishes, and the row is called singular, not good.
 */
#ifndef NEWTON_H
#define NEWTON_H

#include "closure.h"
#include "solve.h"

enum { MAX_ITERATIONS = 60, MAX_HALVINGS = 20 };
#define MAX_TURN 0.5      /* rad, the longest rotation of one step */
#define CLOSED 2e-14      /* residual at which a closure holds, relative to the machine's size */
#define SETTLED 5e-12     /* step after which the pose is known, relative likewise */
#define LEAST_PIVOT 2e-5  /* relative pivot under which 1e-11 of the size is not assured */

/* One block: status, iterations and residual of each lane; state holds the guess and the answer. */
INLINE void newton(int map, const pkm_machine *machine, const FN(limb_sphere) *limb, mask running,
                   real *state, mask *status, real *iterations, real *residual)
{
    const int m = map_m(map);
    const real zero = fill(0.0), inverse_length = fill(1.0 / machine->length);
    real phi[PKM_MAX_ROWS], jacobian[PKM_MAX_ROWS * 6], A[36], step[6] = {0}, trial[MAX_STATE];
    real merit = fill(INFINITY), worst = merit, share = fill(1.0), pivot = zero;
    const real size = fill(machine->size);
    const real closed = CLOSED * size, settled = SETTLED * size;
    double heaviest = 1.0;
    for (int r = 0; r < PKM_MAX_ROWS; r++) heaviest = fmax(heaviest, machine->weight[r]);
    const real rounding = closed * closed * (heaviest * heaviest);
    *status = fill_mask(PKM_NOT_CONVERGED);
    *iterations = zero;
    memcpy(trial, state, sizeof(real) * MAX_STATE);
    for (int k = 0; k <= MAX_ITERATIONS && any(running); k++) {
        const int rows = scaled_rows(map, machine, limb, trial, phi, jacobian);
        real squares = zero, trial_worst = zero;
        for (int r = 0; r < rows; r++) {
            squares += phi[r] * phi[r];
            trial_worst = larger(trial_worst, absolute(phi[r]));
        }
        /* a step is taken if it does not make things worse, rounding apart */
        const mask better = (squares <= merit * (1.0 + 1e-9) + rounding) & running;
        const mask halved = running & ~better;
        share = select(halved, 0.5 * share, fill(1.0));
        real fresh[6], trial_pivot;
        normal_matrix(m, rows, jacobian, A);
        normal_side(m, rows, jacobian, phi, fresh);
        solve(m, 1, A, fresh, &trial_pivot);
        if (rows > m) trial_pivot = FN(root)(trial_pivot); /* the normal equations square it */
        real longest = zero, turn = zero;
        for (int j = 0; j < m; j++) {
            longest = larger(longest, absolute(fresh[j]));
            if (map_is_angle(map, j)) turn = larger(turn, absolute(fresh[j]) * inverse_length);
        }
        const mask solvable = is_finite(longest);
        const mask known = trial_pivot > fill(LEAST_PIVOT);
        const mask holds = rows > m ? solvable : trial_worst <= closed;
        const mask done = better & holds & known & (longest <= settled);
        const real excess = larger(larger(turn * (1.0 / MAX_TURN), longest / size), fill(1.0));
        const real bound = 1.0 / excess;
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
        FN(map_retract)(map, state, partial, trial);
        for (int s = 0; s < MAX_STATE; s++) state[s] = select(done, trial[s], state[s]);
        *status = select_mask(done, fill_mask(PKM_OK), *status);
        running &= ~done & (share > fill(1.0 / (1 << MAX_HALVINGS)))
                   & (solvable | ~better);
    }
    /* closures that hold where the pose does not follow from them, or no way on: singular */
    const mask unsolved = *status == fill_mask(PKM_NOT_CONVERGED);
    const mask flat = ~(pivot > fill(LEAST_PIVOT));
    *status = select_mask(unsolved & ((worst <= closed) | flat), fill_mask(PKM_SINGULAR), *status);
    /* of the pose itself, and without the weights; more rows than m meet each other or they do not */
    const int rows = scaled_rows(map, machine, limb, state, phi, NULL);
    *residual = zero;
    for (int r = 0; r < rows; r++)
        *residual = larger(*residual, absolute(phi[machine->order[r]]) * (1.0 / machine->weight[r]));
    if (rows > m) {
        const mask open = (*status == fill_mask(PKM_OK)) & ~(*residual <= fill(machine->closure_tolerance));
        *status = select_mask(open, fill_mask(PKM_NOT_CLOSED), *status);
    }
}

#endif
