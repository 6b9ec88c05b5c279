/* Inverse kinematics: each limb in closed form at the pose as given. */
#ifndef INVERSE_H
#define INVERSE_H

#include "closure.h"

/* q̃ of a limb whose platform joint is h from its base point; not finite out of reach, or so far away
 * that squares overflow. */
INLINE real limb_drive_at(const pkm_machine *machine, int i, const limb_numbers *limb, const real *h)
{
    real qt;
    switch (machine->driver[i]) {
#define CASE(NAME, name, ...)                                                                     \
    case DRIVER_##NAME:                                                                           \
        FN(name##_inverse)(limb->g, h, limb->first, limb->second, fill(machine->branch[i]), &qt); \
        break;
        EACH_DRIVER(CASE)
        NO_OTHER_CASE;
#undef CASE
    }
    return qt;
}

/* The angle that is `x` up to whole turns and nearest to `near`. */
INLINE real nearest_turn(real x, real near, real turn)
{
    /* the nearest whole number, as in sincos */
    const real shift = fill(6755399441055744.0), turns = (x - near) / turn;
    return x - turn * ((turns + shift) - shift);
}

/* The limb's command; where its drive is an angle, the turn of it that is nearest to `near`. */
INLINE real limb_inverse(const pkm_machine *machine, int i, const limb_numbers *limb, const real *R,
                         const real *p, real near)
{
    real h[3], q;
    FN(limb_joint)(R, p, limb->g + PLATFORM_X, limb->g + BASE_X, h);
    real qt = limb_drive_at(machine, i, limb, h);
    if (machine->angle[i]) qt = nearest_turn(qt, near, fill(TWO_PI));
    FN(limb_command)(qt, limb->per_gain, limb->g, &q);
    return q;
}

/* Does a whole turn of limb i leave another limb of its actuator elsewhere? */
INLINE int geared(const pkm_machine *machine, const limb_numbers *limb, int i)
{
    mask apart = fill_mask(0);
    if (!machine->angle[i]) return 0;
    for (int j = 0; j < machine->limbs; j++)
        if (machine->actuator[j] == machine->actuator[i]) {
            if (!machine->angle[j]) return 1;
            apart |= absolute(limb[j].g[GAIN]) != absolute(limb[i].g[GAIN]);
        }
    return any(apart);
}

#define MOST_TURNS 8  /* either way, in search of one where all limbs of an actuator agree */
#define AGREE 1e-7    /* [rad] of the first limb: rounding of a pose that the machine takes */
#define PER_TURN 1e-2 /* [rad] that limbs have to agree better for each turn that is farther */

/* Of the commands of limb i a whole number of its turns from `own`, the one where the other limbs of
 * its actuator stand as well: of those that agree the nearest to `near`, its drive; else the least
 * apart, with a turn's worth. */
INLINE real agreed_turn(const pkm_machine *machine, const limb_numbers *limb, int i, const real *R,
                        const real *p, real near, real own)
{
    const real gain = absolute(limb[i].g[GAIN]), turn = TWO_PI / gain;
    real about, best = own, least = fill(INFINITY), others[PKM_MAX_LIMBS];
    FN(limb_command)(near, limb[i].per_gain, limb[i].g, &about);
    for (int j = i + 1; j < machine->limbs; j++)
        if (machine->actuator[j] == machine->actuator[i])
            others[j] = limb_inverse(machine, j, &limb[j], R, p, fill(0.0));
    for (int k = MOST_TURNS; k >= -MOST_TURNS; k--) {
        const real at = own + k * turn;
        real apart = fill(0.0);
        for (int j = i + 1; j < machine->limbs; j++)
            if (machine->actuator[j] == machine->actuator[i]) {
                const real period = TWO_PI / absolute(limb[j].g[GAIN]);
                const real there = machine->angle[j] ? nearest_turn(others[j], at, period) : others[j];
                const real miss = gain * absolute(there - at);
                apart = select(miss > apart, miss, apart);
            }
        const real cost = select(apart <= fill(AGREE), 1e-12 * absolute(at - about),
                                 apart + PER_TURN * (1 + (k < 0 ? -k : k)));
        const mask better = cost < least - 1e-15; /* of turns equally far the upper one */
        best = select(better, at, best);
        least = select(better, cost, least);
    }
    return best;
}

/* Limbs that share an actuator are averaged, angles at the turn nearest to the first limb's; one limb
 * out of reach makes the whole row NaN. `near` (NULL: the machine's own) says which turn that is. */
INLINE void inverse_at(const pkm_machine *machine, const limb_numbers *limb, const real *R,
                       const real *p, const real *near, real *q)
{
    real first[PKM_MAX_LIMBS];
    int seen = 0;
    for (int a = 0; a < machine->actuators; a++) q[a] = fill(-0.0); /* -0 + x is x, even for x = -0 */
    for (int i = 0; i < machine->limbs; i++) {
        const int a = machine->actuator[i], others = seen >> a & 1;
        real about = fill(machine->near[i]);
        if (machine->angle[i] && (others || near))
            FN(limb_drive)(others ? first[a] : near[a], limb[i].g, &about);
        real own = limb_inverse(machine, i, &limb[i], R, p, about);
        if (!others && machine->sharing[a] > 1.0 && geared(machine, limb, i))
            own = agreed_turn(machine, limb, i, R, p, about, own);
        if (!others) first[a] = own;
        seen |= 1 << a;
        q[a] += own;
    }
    if (machine->actuators < machine->limbs)
        for (int a = 0; a < machine->actuators; a++) q[a] /= machine->sharing[a];
    whole_or_nan(q, machine->actuators);
}

/* The same at a home or a guess, once a call. */
RARE void inverse_once(const pkm_machine *machine, const limb_numbers *limb, const real *R,
                       const real *p, real *q)
{
    inverse_at(machine, limb, R, p, NULL, q);
}

int CALL(inverse)(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                  ptrdiff_t geometry_stride, const double *pose, const double *near,
                  ptrdiff_t near_stride, double *q)
{
    if (!pkm_prepared(machine)) return PKM_BAD_MACHINE;
    enum { BLOCKS_INVERSE = 2 }; /* side by side: the processor overlaps them */
    limb_numbers limb[PKM_MAX_LIMBS];
    for (ptrdiff_t first = 0; first < n; first += BLOCKS_INVERSE * LANES) {
        ptrdiff_t row[BLOCKS_INVERSE][LANES];
        real lane_pose[BLOCKS_INVERSE][6], R[BLOCKS_INVERSE][9], p[BLOCKS_INVERSE][3];
        real lane_q[BLOCKS_INVERSE][PKM_MAX_LIMBS], about[PKM_MAX_LIMBS];
        int count[BLOCKS_INVERSE];
        for (int t = 0; t < BLOCKS_INVERSE; t++) {
            count[t] = block_rows(first + t * LANES, n, row[t]);
            gather_row(pose, 6, 6, row[t], lane_pose[t]);
        }
        for (int t = 0; t < BLOCKS_INVERSE; t++) FN(pose_frame)(lane_pose[t], R[t], p[t]);
        for (int t = 0; t < BLOCKS_INVERSE; t++) {
            prepare_block(machine, geometry, geometry_stride, first + t, row[t], limb);
            if (near) gather_row(near, near_stride, machine->actuators, row[t], about);
            inverse_at(machine, limb, R[t], p[t], near ? about : NULL, lane_q[t]);
        }
        for (int t = 0; t < BLOCKS_INVERSE; t++)
            scatter_row(lane_q[t], machine->actuators, q, machine->actuators, row[t], count[t]);
    }
    return 0;
}

#endif
