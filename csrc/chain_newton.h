/* Newton on machines of chains, from a pose at which every chain is closed with the actuators at
 * coordinates of their own; the first step goes to those asked for (see chain_system.h). */
#ifndef CHAIN_NEWTON_H
#define CHAIN_NEWTON_H

#include "chain_system.h"
#include "newton.h"

enum { PATH_PARTS = 8, PATH_STEPS = 5, SERVES = 3 };
#define CHAIN_CLOSED 2e-13 /* residual at which chains close, relative to the machine's size */
#define EXACT 2e-15        /* the step to come of a pose that is known to rounding */
#define NEAR 3e-4          /* a step, relative likewise, after which the matrix serves once more */
#define FALLING 0.1        /* and steps with it fall to this or less */
#define LEAST_COLUMN 1e-6  /* of a passive joint beside the others: below, they do not say where it is */

/* The platform and the passive joints of a block. */
typedef struct {
    real state[MAX_STATE], theta[PKM_MAX_JOINTS];
} chain_state;

typedef struct {
    real step[6], turns[PKM_MAX_JOINTS]; /* of the pose map, of the passive joints */
    real longest, turn;
} chain_step;

/* Newton's matrix at a state, in factors, and the chains there; their r may be renewed. */
typedef struct {
    chain_view view[PKM_MAX_LIMBS];
    real jacobian[PKM_MAX_CHAIN_ROWS * MAX_CHAIN_UNKNOWNS];
    real A[MAX_CHAIN_UNKNOWNS * MAX_CHAIN_UNKNOWNS];
    mask swaps[MAX_CHAIN_UNKNOWNS * MAX_CHAIN_UNKNOWNS];
    int rows;
    mask known; /* do the rows say where the platform is, and the platform where the joints are? */
} chain_matrix;

INLINE void cross(const real *a, const real *b, real *out)
{
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        out[i] = a[j] * b[k] - a[k] * b[j];
    }
}

/* The platform's twist (ω, v) as a hybrid one, turns as arcs; where chain l ends in a ball, of that. */
INLINE void chain_met(const pkm_chains *machine, int l, const real *lever, const real *twist, real *out)
{
    real moved[3];
    cross(twist, lever, moved);
    for (int i = 0; i < 3; i++) {
        out[i] = twist[i] * machine->length;
        out[3 + i] = machine->ball[l] ? twist[3 + i] + moved[i] : twist[3 + i];
    }
}

/* A wrench's product with a twist's closing rows. */
INLINE real wrench_on(int rows, const real *N, const real *x)
{
    real sum = fill(0.0);
    for (int i = 0; i < rows; i++) sum += N[i] * x[i];
    return sum;
}

/* How the rows Φ = -Nᵀ r of chain l follow r; returns how many there are. */
INLINE int chain_pull(const chain_view *view, const real *r, real *rows)
{
    const int count = view->rows - view->own;
    for (int n = 0; n < count; n++) rows[n] = -wrench_on(view->rows, view->N[n], r);
    return count;
}

/* The change of r by the coordinate of actuator a; 0, and returns so, where the chain has it not. */
INLINE int chain_by_drive(const pkm_chains *machine, int l, const motion *frame, int a, real *change)
{
    const int first = machine->first[l], k = machine->first[l + 1] - first;
    int found = 0;
    for (int i = 0; i < 6; i++) change[i] = fill(0.0);
    for (int j = 0; j < k; j++) {
        const int joint = machine->member[first + j];
        real column[6];
        if (machine->actuator[joint] != a) continue;
        chain_column(machine, l, joint, &frame[j], &frame[k], column);
        for (int i = 0; i < (machine->ball[l] ? 3 : 6); i++)
            change[i] += column[i] * (machine->prismatic[joint] ? 1.0 : machine->length);
        found = 1;
    }
    return found;
}

/* The derivatives of the rows of chain l by the scaled step and what chains share. */
INLINE void chain_rows(const pkm_chains *machine, int l, const chain_view *view, const real *state,
                       real *jacobian)
{
    const int m = map_m(machine->map), unknowns = m + machine->shared;
    const int count = view->rows - view->own, *which;
    group_rows(machine->map, &which);
    for (int n = 0; n < count; n++) {
        const real *N = view->N[n];
        real omega[3] = {fill(0.0), fill(0.0), fill(0.0)}, v[3] = {fill(0.0), fill(0.0), fill(0.0)};
        real *row = jacobian + n * unknowns, phi;
        if (machine->ball[l]) {
            cross(view->lever, N, omega);
            for (int i = 0; i < 3; i++) v[i] = N[i];
        } else {
            for (int i = 0; i < view->rows; i++)
                if (which[i] < 3) omega[which[i]] = N[i] * machine->length;
                else v[which[i] - 3] = N[i];
        }
        FN(store_row)(machine->map, 1, state, fill(0.0), omega, v, fill(1.0),
                      fill(1.0 / machine->length), &phi, row);
        for (int s = 0; s < machine->shared; s++) row[m + s] = fill(0.0);
        for (int s = 0; s < view->sharing; s++)
            row[m + view->which[s]] -= wrench_on(view->rows, N, view->shared[s]);
    }
}

/* All chains at a state: views, residual and Jacobian, the rows one chain after the other. */
SHARED int chain_views(const pkm_chains *machine, const chain_numbers *numbers,
                       const chain_state *at, const real *drive, chain_view *view, real *residual,
                       real *jacobian, real *worst, real *flat)
{
    const int unknowns = map_m(machine->map) + machine->shared;
    real R[9], p[3];
    int rows = 0;
    FN(map_frame)(machine->map, at->state, R, p);
    *worst = *flat = fill(0.0);
    for (int l = 0; l < machine->chains; l++) {
        *worst = larger(*worst, chain_look(machine, l, numbers, at->theta, drive, R, p, &view[l]));
        chain_eliminate(machine->over, &view[l], flat);
        chain_rows(machine, l, &view[l], at->state, jacobian + rows * unknowns);
        rows += chain_pull(&view[l], view[l].r, residual + rows);
    }
    return rows;
}

/* The matrix at a state; returns what closures miss there. */
SHARED real chain_matrix_at(const pkm_chains *machine, const chain_numbers *numbers,
                            const chain_state *at, const real *drive, chain_matrix *matrix)
{
    const int unknowns = map_m(machine->map) + machine->shared;
    real residual[PKM_MAX_CHAIN_ROWS], worst, flat, pivot;
    matrix->rows = chain_views(machine, numbers, at, drive, matrix->view, residual, matrix->jacobian,
                               &worst, &flat);
    normal_matrix(unknowns, matrix->rows, matrix->jacobian, matrix->A);
    eliminate(unknowns, 0, matrix->A, NULL, matrix->swaps, &pivot);
    if (matrix->rows > unknowns) pivot = FN(root)(pivot); /* the normal equations square it */
    matrix->known = (pivot > fill(LEAST_PIVOT)) & (flat < fill(1.0 / LEAST_COLUMN));
    return worst;
}

/* What closures miss at a state, as r of the chains of a matrix that stays as it is. */
SHARED real chain_renew(const pkm_chains *machine, const chain_numbers *numbers,
                        const chain_state *at, const real *drive, chain_matrix *matrix)
{
    real R[9], p[3], worst = fill(0.0);
    FN(map_frame)(machine->map, at->state, R, p);
    for (int l = 0; l < machine->chains; l++)
        worst = larger(worst, chain_missed(machine, l, numbers, R, p, at->theta, drive,
                                           matrix->view[l].r));
    return worst;
}

/* R⁻¹ Qᵀ x, in place. */
INLINE void chain_turns(int rows, const chain_view *view, real *x)
{
    UNROLL for (int c = 0; c < rows; c++) {
        if (c >= view->own) break;
        const real t = products(c, rows, view->J[c], x) * view->tau[c];
        for (int i = c; i < rows; i++) x[i] -= t * view->J[c][i];
    }
    UNROLL for (int c = rows - 1; c >= 0; c--) {
        if (c >= view->own) continue;
        x[c] *= view->R[c];
        for (int i = 0; i < c; i++) x[i] -= view->J[c][i] * x[c];
    }
}

/* The passive joints of chain l as the platform steps: R δθ = Qᵀ L⁻¹ (ξ - shared - r), as arcs. */
INLINE void chain_follow(const pkm_chains *machine, int l, chain_view *view, const real *twist,
                         const real *shared, chain_step *out)
{
    const int first = machine->first[l];
    real x[6], all[6];
    chain_met(machine, l, view->lever, twist, all);
    chain_cut(machine, l, all, x);
    for (int i = 0; i < view->rows; i++) {
        x[i] -= view->r[i];
        for (int s = 0; s < view->sharing; s++) x[i] -= view->shared[s][i] * shared[view->which[s]];
    }
    if (machine->over) divide_by(view->rows, view->L, x);
    if (view->rows == 6) chain_turns(6, view, x);
    else chain_turns(3, view, x);
    for (int j = first, c = 0; j < machine->first[l + 1]; j++) {
        const int joint = machine->member[j], coordinate = machine->coordinate[joint];
        if (coordinate < machine->shared) continue; /* also an actuated one */
        out->turns[coordinate] = x[c++];
    }
}

/* The step by a matrix and r of its chains, from a state. */
SHARED void chain_correct(const pkm_chains *machine, chain_matrix *matrix,
                          const chain_state *at, chain_step *out)
{
    const int m = map_m(machine->map), unknowns = m + machine->shared;
    const real inverse_length = fill(1.0 / machine->length);
    real phi[PKM_MAX_CHAIN_ROWS], x[MAX_CHAIN_UNKNOWNS], twist[6];
    for (int l = 0, r = 0; l < machine->chains; l++)
        r += chain_pull(&matrix->view[l], matrix->view[l].r, phi + r);
    normal_side(unknowns, matrix->rows, matrix->jacobian, phi, x);
    solve_again(unknowns, matrix->A, matrix->swaps, x);
    out->longest = out->turn = fill(0.0);
    for (int j = 0; j < unknowns; j++) {
        x[j] = -x[j];
        out->longest = larger(out->longest, absolute(x[j]));
    }
    for (int j = 0; j < m; j++) {
        const int angle = map_is_angle(machine->map, j);
        out->step[j] = angle ? x[j] * inverse_length : x[j];
        if (angle) out->turn = larger(out->turn, absolute(out->step[j]));
    }
    memcpy(out->turns, x + m, sizeof(real) * machine->shared);
    map_twist(machine->map, at->state, out->step, twist);
    for (int l = 0; l < machine->chains; l++)
        chain_follow(machine, l, &matrix->view[l], twist, x + m, out);
    real longest = out->longest, turn = out->turn;
    for (int i = 0; i < machine->joints; i++) {
        const int c = machine->coordinate[i];
        if (c < 0) continue;
        longest = larger(longest, absolute(out->turns[c]));
        if (machine->prismatic[i]) continue;
        out->turns[c] *= inverse_length;
        turn = larger(turn, absolute(out->turns[c]));
    }
    out->longest = longest, out->turn = turn;
}

/* The part of a step that turns nothing by more than MAX_TURN. */
SHARED void chain_move(const pkm_chains *machine, const chain_step *step, mask usable,
                       chain_state *at)
{
    const real share = 1.0 / larger(step->turn * (1.0 / MAX_TURN), fill(1.0));
    real moved[MAX_STATE] = {0}, partial[6];
    for (int j = 0; j < map_m(machine->map); j++) partial[j] = share * step->step[j];
    FN(map_retract)(machine->map, at->state, partial, moved);
    for (int s = 0; s < MAX_STATE; s++) at->state[s] = select(usable, moved[s], at->state[s]);
    for (int c = 0; c < machine->passive; c++)
        at->theta[c] = select(usable, at->theta[c] + share * step->turns[c], at->theta[c]);
}

/* Newton at the drives `to`, with at most `most` matrices; lanes that are not `running` stay. Near the
 * end a matrix SERVES for more steps, where there are no more rows than unknowns: least squares would
 * rest elsewhere. A lane waits while others use theirs, so that its way is its own. It is done when
 * the step that would come, by how steps fall, is too small to matter. Returns the lanes that
 * settled, and what closures miss where they are. */
SHARED mask chain_iterate(const pkm_chains *machine, const chain_numbers *numbers, const real *to,
                          int most, mask running, chain_state *at, mask *known, real *iterations,
                          real *residual)
{
    const real closed = fill(CLOSED * machine->size), settled = fill(SETTLED * machine->size);
    const real loose = fill(CHAIN_CLOSED * machine->size), exactly = fill(EXACT * machine->size);
    const real near = fill(machine->over ? 0.0 : NEAR * machine->size);
    mask solved = fill_mask(0), falling = solved;
    real last = fill(INFINITY), next = last;
    chain_matrix matrix;
    for (int k = 0; k < most && any(running); k++) {
        mask going = running;
        for (int served = 0; served <= SERVES && any(going); served++) {
            chain_step step;
            const real worst = served ? chain_renew(machine, numbers, at, to, &matrix)
                                      : chain_matrix_at(machine, numbers, at, to, &matrix);
            const mask still = (last <= settled) & ~falling; /* steps of rounding */
            const mask exact = next <= exactly;
            const mask open = machine->over ? ~is_finite(worst) : ~(worst <= select(still, loose, closed));
            const mask done = going & ~open & matrix.known & (exact | still);
            *known = select_mask(going, matrix.known, *known);
            *residual = select(going, worst, *residual);
            solved |= done;
            running &= ~done;
            going &= ~done;
            if (!any(going)) break;
            chain_correct(machine, &matrix, at, &step);
            const mask usable = is_finite(step.longest) & going;
            chain_move(machine, &step, usable, at);
            *iterations = select(going, *iterations + 1.0, *iterations);
            falling = select_mask(going, step.longest <= FALLING * last, falling);
            next = select(going, step.longest * (step.longest / last), next);
            if (!k && !served) next = step.longest;
            last = select(going, step.longest, last);
            running &= usable | ~going;
            going = usable & ((falling & (step.longest <= near)) | (next <= exactly));
        }
    }
    return solved;
}

/* How a machine goes from a state, where the drives are `from`, as these change: the step without a
 * change, and by a unit of each. */
typedef struct {
    chain_step still, by[PKM_MAX_LIMBS];
} chain_prediction;

SHARED void chain_predict(const pkm_chains *machine, const chain_numbers *numbers,
                          const chain_state *at, const real *from, chain_prediction *start)
{
    chain_matrix matrix;
    motion frame[PKM_MAX_CHAIN + 1];
    chain_matrix_at(machine, numbers, at, from, &matrix);
    chain_correct(machine, &matrix, at, &start->still);
    for (int a = 0; a < machine->actuators; a++) {
        for (int l = 0; l < machine->chains; l++) {
            chain_walk(machine, l, numbers, at->theta, from, frame);
            chain_by_drive(machine, l, frame, a, matrix.view[l].r);
        }
        chain_correct(machine, &matrix, at, &start->by[a]);
    }
}

/* The first step to the drives `to`. */
SHARED void chain_begin(const pkm_chains *machine, const chain_prediction *start, const real *from,
                        const real *to, mask running, chain_state *at)
{
    const int m = map_m(machine->map);
    chain_step step = start->still;
    for (int a = 0; a < machine->actuators; a++) {
        const real ahead = to[a] - from[a];
        for (int j = 0; j < m; j++) step.step[j] += start->by[a].step[j] * ahead;
        for (int c = 0; c < machine->passive; c++) step.turns[c] += start->by[a].turns[c] * ahead;
    }
    step.turn = step.longest = fill(0.0);
    for (int j = 0; j < m; j++) {
        if (map_is_angle(machine->map, j)) step.turn = larger(step.turn, absolute(step.step[j]));
        step.longest = larger(step.longest, absolute(step.step[j]));
    }
    for (int i = 0; i < machine->joints; i++) {
        const int c = machine->coordinate[i];
        if (c < 0) continue;
        step.longest = larger(step.longest, absolute(step.turns[c]));
        if (!machine->prismatic[i]) step.turn = larger(step.turn, absolute(step.turns[c]));
    }
    chain_move(machine, &step, running & is_finite(step.longest), at);
}

#endif
