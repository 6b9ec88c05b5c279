/* A chain alone: its joints to a pose of the platform, whatever the others do (see chain_system.h). */
#ifndef CHAIN_ALONE_H
#define CHAIN_ALONE_H

#include "chain_newton.h"

enum { MAX_ASSEMBLY = 40, FEW_ASSEMBLY = 14, FEW_POSTURES = 12, MOST_POSTURES = 24 };

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
        real longest = fill(0.0), turn = fill(0.0);
        chain_walk(machine, l, numbers, theta, drive ? drive : own, frame);
        const real worst = chain_misses(machine, l, numbers, &frame[k], R, p, r, lever);
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
        const mask usable = is_finite(longest) & running;
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
    real trial[PKM_MAX_JOINTS], own[PKM_MAX_LIMBS], r[6];
    memcpy(own, drive, sizeof(real) * machine->actuators);
    mask good = chain_assemble(machine, l, numbers, R, p, drive, MAX_ASSEMBLY, theta, own);
    *missed = chain_missed(machine, l, numbers, R, p, theta, drive, r);
    for (int attempt = -1; attempt < (nearly ? FEW_POSTURES : MOST_POSTURES); attempt++) {
        const mask open = *missed > closed;
        if (!any(open)) break;
        memcpy(trial, theta, sizeof(real) * machine->passive);
        chain_posture(machine, l, attempt < 0 ? 0 : attempt, trial);
        if (attempt < 0) {
            for (int a = 0; a < machine->actuators; a++)
                own[a] = of_tail(machine, a) ? drive[a] : fill(0.0);
            chain_assemble(machine, l, numbers, R, p, NULL, MAX_ASSEMBLY, trial, own);
        }
        const mask settled = chain_assemble(machine, l, numbers, R, p, drive,
                                            attempt < 3 ? FEW_ASSEMBLY : MAX_ASSEMBLY, trial, own);
        const real misses = chain_missed(machine, l, numbers, R, p, trial, drive, r);
        const mask found = settled & open & (misses <= (nearly ? *missed : closed));
        for (int c = 0; c < machine->passive; c++) theta[c] = select(found, trial[c], theta[c]);
        *missed = select(found, misses, *missed);
        good |= found;
    }
    return good;
}

/* What chains miss at a state with the joints that they share in one place: those that reach every pose,
 * or all. */
SHARED real chains_miss(const pkm_chains *machine, const chain_numbers *numbers, const real *R,
                        const real *p, int all, const real *theta, const real *drive)
{
    const int *which, rows = group_rows(machine->map, &which);
    real worst = fill(0.0), r[6];
    for (int l = 0; l < machine->chains; l++) {
        const int k = machine->first[l + 1] - machine->first[l];
        const real missed = chain_missed(machine, l, numbers, R, p, theta, drive, r);
        if (all || k >= (machine->ball[l] ? 3 : rows)) worst = larger(worst, missed);
    }
    return worst;
}

/* Every chain alone, and the mean of what they share. Where the actuators are not given, with `missed`
 * NULL, they follow, into `drive`, but those of the tail, which are. Else `nearly` is that of
 * chain_reclose, and `missed` is what all chains miss, or without it those that reach every pose. */
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
        if (missed && (nearly || k >= rows)) *missed = larger(*missed, misses);
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
    if (missed && machine->shared) *missed = chains_miss(machine, numbers, R, p, nearly, theta, drive);
    return good;
}

#endif
