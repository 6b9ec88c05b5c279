/* Newton on machines of chains, from a pose at which every chain is closed with the actuators at
 * coordinates of their own; the first step goes to those asked for (see chain_system.h). */
#ifndef CHAIN_NEWTON_H
#define CHAIN_NEWTON_H

#include "chain_system.h"
#include "newton.h"

enum { MAX_ASSEMBLY = 40, FEW_ASSEMBLY = 14, FEW_POSTURES = 12, MOST_POSTURES = 24, PATH_PARTS = 8, PATH_STEPS = 5 };
#define CHAIN_CLOSED 2e-13 /* residual at which chains close, relative to the machine's size */
#define LEAST_COLUMN 1e-6  /* of a passive joint beside the others: below, they do not say where it is */

/* The platform and the passive joints of a block. */
typedef struct {
    real state[MAX_STATE], theta[PKM_MAX_JOINTS];
} chain_state;

typedef struct {
    real step[6], turns[PKM_MAX_JOINTS]; /* of the pose map, of the passive joints */
    real longest, turn, worst;
    mask known;
} chain_step;

/* All chains at a state: views, residual and Jacobian, the rows one chain after the other. */
SHARED int chain_views(const pkm_chains *machine, const chain_numbers *numbers,
                       const chain_state *at, const real *drive, const real *ahead,
                       chain_view *view, real *residual, real *jacobian, real *worst, real *flat)
{
    const int unknowns = map_m(machine->map) + machine->shared;
    real R[9], p[3];
    int rows = 0;
    FN(map_frame)(machine->map, at->state, R, p);
    *worst = *flat = fill(0.0);
    for (int l = 0; l < machine->chains; l++) {
        chain_look(machine, l, numbers, at->theta, drive, ahead, R, p, &view[l]);
        for (int i = 0; i < view[l].rows; i++) *worst = larger(*worst, absolute(view[l].r[i]));
        chain_eliminate(machine->over, &view[l], flat);
        rows += chain_rows(machine, l, &view[l], at->state, residual + rows,
                           jacobian + rows * unknowns);
    }
    return rows;
}

/* The passive joints of chain l as the platform steps: R δθ = Qᵀ L⁻¹ (ξ - shared - r), as arcs. */
INLINE void chain_follow(const pkm_chains *machine, int l, chain_view *view, const real *twist,
                         const real *shared, chain_step *out)
{
    const int first = machine->first[l];
    real x[6], all[6];
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        all[i] = twist[i] * machine->length;
        all[3 + i] = twist[3 + i];
        if (machine->ball[l]) all[3 + i] += twist[j] * view->lever[k] - twist[k] * view->lever[j];
    }
    chain_cut(machine, l, all, x);
    for (int i = 0; i < view->rows; i++) {
        x[i] -= view->r[i];
        for (int s = 0; s < view->sharing; s++) x[i] -= view->shared[s][i] * shared[view->which[s]];
    }
    if (machine->over) divide_by(view->rows, view->L, x);
    for (int c = 0; c < view->own; c++) {
        real t = fill(0.0);
        for (int i = c; i < view->rows; i++) t += view->J[c][i] * x[i];
        t *= view->tau[c];
        for (int i = c; i < view->rows; i++) x[i] -= t * view->J[c][i];
    }
    for (int c = view->own - 1; c >= 0; c--) {
        x[c] /= view->R[c];
        for (int i = 0; i < c; i++) x[i] -= view->J[c][i] * x[c];
    }
    for (int j = first, c = 0; j < machine->first[l + 1]; j++) {
        const int joint = machine->member[j], coordinate = machine->coordinate[joint];
        if (coordinate < machine->shared) continue; /* also an actuated one */
        out->turns[coordinate] = x[c++];
    }
}

/* The Newton step at a state. */
SHARED void chain_newton_step(const pkm_chains *machine, const chain_numbers *numbers,
                              const chain_state *at, const real *drive, const real *ahead,
                              chain_step *out)
{
    const int m = map_m(machine->map), unknowns = m + machine->shared;
    const real inverse_length = fill(1.0 / machine->length);
    chain_view view[PKM_MAX_LIMBS];
    real residual[PKM_MAX_CHAIN_ROWS], jacobian[PKM_MAX_CHAIN_ROWS * MAX_CHAIN_UNKNOWNS];
    real A[MAX_CHAIN_UNKNOWNS * MAX_CHAIN_UNKNOWNS], x[MAX_CHAIN_UNKNOWNS], twist[6], pivot, flat;
    const int rows = chain_views(machine, numbers, at, drive, ahead, view, residual, jacobian,
                                 &out->worst, &flat);
    normal_system(unknowns, rows, 1, jacobian, residual, A, x);
    solve(unknowns, 1, A, x, &pivot);
    if (rows > unknowns) pivot = FN(root)(pivot); /* the normal equations square it */
    out->known = (pivot > fill(LEAST_PIVOT)) & (flat < fill(1.0 / LEAST_COLUMN));
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
        chain_follow(machine, l, &view[l], twist, x + m, out);
    for (int i = 0; i < machine->joints; i++) {
        const int c = machine->coordinate[i];
        if (c < 0) continue;
        out->longest = larger(out->longest, absolute(out->turns[c]));
        if (machine->prismatic[i]) continue;
        out->turns[c] *= inverse_length;
        out->turn = larger(out->turn, absolute(out->turns[c]));
    }
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

/* Newton at the drives `to`, at most `steps`; lanes that are not `running` stay. Returns the lanes
 * that settled. */
SHARED mask chain_iterate(const pkm_chains *machine, const chain_numbers *numbers, const real *to,
                          int steps, mask running, chain_state *at, mask *known, real *iterations)
{
    const real closed = fill(CHAIN_CLOSED * machine->size), settled = fill(SETTLED * machine->size);
    mask solved = fill_mask(0);
    for (int k = 0; k < steps && any(running); k++) {
        chain_step step;
        chain_newton_step(machine, numbers, at, to, NULL, &step);
        const mask usable = finite(step.longest) & running;
        const mask holds = machine->over ? usable : step.worst <= closed;
        const mask done = usable & holds & step.known & (step.longest <= settled);
        chain_move(machine, &step, usable, at);
        *iterations = select(running, *iterations + 1.0, *iterations);
        *known = select_mask(running, step.known, *known);
        solved |= done;
        running = usable & ~done;
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
    real ahead[PKM_MAX_LIMBS];
    chain_newton_step(machine, numbers, at, from, NULL, &start->still);
    for (int a = 0; a < machine->actuators; a++) {
        chain_step *by = &start->by[a];
        for (int b = 0; b < machine->actuators; b++) ahead[b] = fill(a == b ? 1.0 : 0.0);
        chain_newton_step(machine, numbers, at, from, ahead, by);
        for (int j = 0; j < map_m(machine->map); j++) by->step[j] -= start->still.step[j];
        for (int c = 0; c < machine->passive; c++) by->turns[c] -= start->still.turns[c];
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
    chain_move(machine, &step, running & finite(step.longest), at);
}

/* What the end of a chain misses with its joints there; infinite where that is no number, and beyond a
 * quarter turn, where vee falls again and is 0 after half a turn. */
INLINE real chain_missed(const pkm_chains *machine, int l, const chain_numbers *numbers,
                         const real *R, const real *p, const real *theta, const real *drive)
{
    const int k = machine->first[l + 1] - machine->first[l];
    const int *which, rows = machine->ball[l] ? 3 : group_rows(machine->map, &which);
    motion frame[PKM_MAX_CHAIN + 1];
    real r[6], lever[3], worst = fill(0.0);
    chain_walk(machine, l, numbers, theta, drive, frame);
    chain_misses(machine, l, numbers, &frame[k], R, p, r, lever);
    for (int i = 0; i < rows; i++) worst = larger(worst, absolute(r[i]));
    if (!machine->ball[l]) {
        real trace = fill(0.0);
        for (int i = 0; i < 9; i++) trace += frame[k].R[i] * R[i];
        worst = select(trace > fill(1.0), worst, fill(INFINITY));
    }
    return select(finite(worst), worst, fill(INFINITY));
}

/* What closures miss at a state. */
SHARED real chain_worst(const pkm_chains *machine, const chain_numbers *numbers,
                        const chain_state *at, const real *drive)
{
    real R[9], p[3], worst = fill(0.0);
    FN(map_frame)(machine->map, at->state, R, p);
    for (int l = 0; l < machine->chains; l++)
        worst = larger(worst, chain_missed(machine, l, numbers, R, p, at->theta, drive));
    return worst;
}

/* Does an actuator move a joint behind the platform? */
INLINE int of_tail(const pkm_chains *machine, int actuator) { return actuator >= machine->tail; }

/* A chain alone: its joints to a frame of the platform, by Gauss and Newton in `most` steps. With `drive` the
 * actuated joints stay there, else they follow and `own` gets them, but those of the tail, which stay as
 * `own` has them. Returns where it settled. */
SHARED mask chain_assemble(const pkm_chains *machine, int l, const chain_numbers *numbers,
                           const real *R, const real *p, const real *drive, int most, real *theta,
                           real *own)
{
    const int first = machine->first[l], k = machine->first[l + 1] - first;
    const int *which, rows = machine->ball[l] ? 3 : group_rows(machine->map, &which);
    const real settled = fill(SETTLED * machine->size);
    int movable[PKM_MAX_CHAIN], count = 0;
    mask running = fill_mask(-1), good = fill_mask(0);
    for (int j = 0; j < k; j++) {
        const int a = machine->actuator[machine->member[first + j]];
        if (a < 0 || (!drive && !of_tail(machine, a))) movable[count++] = j;
    }
    for (int step = 0; step < most && any(running) && count; step++) {
        motion frame[PKM_MAX_CHAIN + 1];
        real J[PKM_MAX_CHAIN][6], r[6], lever[3], A[36], x[PKM_MAX_CHAIN], pivot, y[6];
        real longest = fill(0.0), turn = fill(0.0), worst = fill(0.0);
        chain_walk(machine, l, numbers, theta, drive ? drive : own, frame);
        chain_misses(machine, l, numbers, &frame[k], R, p, r, lever);
        for (int i = 0; i < rows; i++) worst = larger(worst, absolute(r[i]));
        for (int c = 0; c < count; c++)
            chain_column(machine, l, machine->member[first + movable[c]], &frame[movable[c]],
                         &frame[k], J[c]);
        if (count > rows) { /* the shortest step of many */
            for (int i = 0; i < rows; i++)
                for (int j = 0; j < rows; j++) {
                    A[i * rows + j] = fill(0.0);
                    for (int c = 0; c < count; c++) A[i * rows + j] += J[c][i] * J[c][j];
                }
            memcpy(y, r, sizeof y);
            solve(rows, 1, A, y, &pivot);
            for (int c = 0; c < count; c++) x[c] = wrench_on(rows, y, J[c]);
        } else {
            for (int i = 0; i < count; i++) {
                for (int j = 0; j < count; j++) A[i * count + j] = wrench_on(rows, J[i], J[j]);
                x[i] = wrench_on(rows, J[i], r);
            }
            solve(count, 1, A, x, &pivot);
        }
        for (int c = 0; c < count; c++) {
            const int slides = machine->prismatic[machine->member[first + movable[c]]];
            longest = larger(longest, absolute(x[c]));
            if (!slides) x[c] *= 1.0 / machine->length;
            if (!slides) turn = larger(turn, absolute(x[c]));
        }
        const mask usable = finite(longest) & running;
        const real share = 1.0 / larger(turn * (1.0 / MAX_TURN), fill(1.0));
        for (int c = 0; c < count; c++) {
            const int joint = machine->member[first + movable[c]], a = machine->actuator[joint];
            real *value = a >= 0 ? &own[a] : &theta[machine->coordinate[joint]];
            *value = select(usable, *value - share * x[c], *value);
        }
        const mask reaches = count < rows || drive ? usable
                                                   : worst <= fill(1e-9 * machine->size);
        const mask done = usable & reaches & (longest <= settled);
        good |= done;
        running = usable & ~done;
    }
    return count ? good : fill_mask(-1);
}

/* A posture of a chain to start from: home, turned ones, and others that spread over all turns. */
INLINE void chain_posture(const pkm_chains *machine, int l, int attempt, real *theta)
{
    static const double turned[] = {0.0, 2.0, -2.0};
    for (int j = machine->first[l]; j < machine->first[l + 1]; j++) {
        const int joint = machine->member[j], c = machine->coordinate[joint];
        const double step = (j - machine->first[l] + 1) * 0.7548776662466927; /* of a sequence that */
        double place = attempt * (step - (int)step);                          /* fills a cube evenly */
        place = 2.0 * (place - (int)place) - 1.0;
        if (c < 0) continue;
        if (attempt < 3) theta[c] = fill(machine->prismatic[joint] ? 0.0 : turned[attempt]);
        else theta[c] = fill(place * (machine->prismatic[joint] ? machine->length : 3.14159265358979));
    }
}

/* The passive joints of a chain with its actuators at `drive`, from `theta`. Where that does not close,
 * from where the chain alone is assembled from home, as for the inverse, and from other postures, of
 * which one that closes is taken, or if `nearly` one that misses less: a leg that points the other way
 * is a place where Gauss and Newton rest too. Returns where they rest, and what is missed there. */
SHARED mask chain_reclose(const pkm_chains *machine, int l, const chain_numbers *numbers,
                          const real *R, const real *p, const real *drive, int nearly, real *theta,
                          real *missed)
{
    const real closed = fill(machine->over ? machine->closure_tolerance : 1e-9 * machine->size);
    real trial[PKM_MAX_JOINTS], own[PKM_MAX_LIMBS];
    memcpy(own, drive, sizeof(real) * machine->actuators);
    mask good = chain_assemble(machine, l, numbers, R, p, drive, MAX_ASSEMBLY, theta, own);
    *missed = chain_missed(machine, l, numbers, R, p, theta, drive);
    for (int attempt = -1; attempt < (nearly ? FEW_POSTURES : MOST_POSTURES); attempt++) {
        const mask open = *missed > closed;
        if (!any(open)) break;
        memcpy(trial, theta, sizeof(real) * machine->passive);
        chain_posture(machine, l, attempt < 0 ? 0 : attempt, trial);
        for (int a = 0; a < machine->actuators; a++)
            own[a] = attempt < 0 && !of_tail(machine, a) ? fill(0.0) : drive[a];
        if (attempt < 0)
            chain_assemble(machine, l, numbers, R, p, NULL, MAX_ASSEMBLY, trial, own);
        const mask settled = chain_assemble(machine, l, numbers, R, p, drive,
                                            attempt < 3 ? FEW_ASSEMBLY : MAX_ASSEMBLY, trial, own);
        const real misses = chain_missed(machine, l, numbers, R, p, trial, drive);
        const mask found = settled & open & (misses <= (nearly ? *missed : closed));
        for (int c = 0; c < machine->passive; c++) theta[c] = select(found, trial[c], theta[c]);
        *missed = select(found, misses, *missed);
        good |= found;
    }
    return good;
}

/* Every chain alone, and the mean of what they share. Where the actuators are not given, with `missed`
 * NULL, they follow, into `drive`, but those of the tail, which are. Else `nearly` is that of chain_reclose, and what chains miss is told
 * that reach every pose. */
SHARED mask chains_assembled(const pkm_chains *machine, const chain_numbers *numbers, const real *R,
                             const real *p, real *missed, int nearly, real *theta, real *drive)
{
    real sum[PKM_MAX_LIMBS], joint_sum[PKM_MAX_SHARED];
    double drives[PKM_MAX_LIMBS] = {0}, times[PKM_MAX_SHARED] = {0};
    mask good = fill_mask(-1);
    if (missed) *missed = fill(0.0);
    for (int a = 0; a < machine->actuators; a++) sum[a] = fill(0.0);
    for (int s = 0; s < machine->shared; s++) joint_sum[s] = fill(0.0);
    for (int c = 0; c < machine->passive; c++) theta[c] = fill(0.0);
    for (int l = 0; l < machine->chains; l++) {
        const int k = machine->first[l + 1] - machine->first[l], *which;
        const int rows = machine->ball[l] ? 3 : group_rows(machine->map, &which);
        real own[PKM_MAX_LIMBS], misses;
        for (int a = 0; a < machine->actuators; a++)
            own[a] = missed || of_tail(machine, a) ? drive[a] : fill(0.0);
        for (int s = 0; s < machine->shared; s++) theta[s] = fill(0.0);
        const mask settled = chain_assemble(machine, l, numbers, R, p, NULL, MAX_ASSEMBLY, theta, own);
        if (!missed) good &= settled;
        else good &= chain_reclose(machine, l, numbers, R, p, drive, nearly, theta, &misses);
        if (missed && k >= rows) *missed = larger(*missed, misses);
        for (int j = machine->first[l]; j < machine->first[l + 1]; j++) {
            const int joint = machine->member[j], a = machine->actuator[joint];
            const int c = machine->coordinate[joint];
            if (a >= 0) sum[a] += own[a], drives[a] += 1.0;
            else if (c < machine->shared) joint_sum[c] += theta[c], times[c] += 1.0;
        }
    }
    for (int a = 0; a < machine->actuators; a++)
        if (!missed) drive[a] = sum[a] / drives[a];
    for (int s = 0; s < machine->shared; s++) theta[s] = joint_sum[s] / times[s];
    return good;
}

#endif
