/* Inverse kinematics: each limb in closed form at the pose as given. */
#ifndef INVERSE_H
#define INVERSE_H

#include "closure.h"

/* q̃ of a limb whose platform joint is h from its base point; not finite out of reach, or so far away
 * that squares overflow. */
INLINE real limb_drive_at(const pkm_machine *machine, int i, const limb_numbers *limb, const real *h)
{
    real qt = fill(NAN);
    switch (machine->driver[i]) {
#define CASE(NAME, name, ...)                                                                     \
    case DRIVER_##NAME:                                                                           \
        FN(name##_inverse)(limb->g, h, limb->first, limb->second, fill(machine->branch[i]), &qt); \
        break;
        EACH_DRIVER(CASE)
#undef CASE
    }
    return qt;
}

INLINE real limb_inverse(const pkm_machine *machine, int i, const limb_numbers *limb, const real *R,
                         const real *p)
{
    real h[3], q;
    FN(limb_joint)(R, p, limb->g + PLATFORM_X, limb->g + BASE_X, h);
    FN(limb_command)(limb_drive_at(machine, i, limb, h), limb->per_gain, limb->g, &q);
    return q;
}

/* Limbs that share an actuator are averaged; one limb out of reach makes the whole row NaN. */
INLINE void inverse_at(const pkm_machine *machine, const limb_numbers *limb, const real *R,
                       const real *p, real *q)
{
    for (int a = 0; a < machine->actuators; a++) q[a] = fill(-0.0); /* -0 + x is x, even for x = -0 */
    for (int i = 0; i < machine->limbs; i++)
        q[machine->actuator[i]] += limb_inverse(machine, i, &limb[i], R, p);
    if (machine->actuators < machine->limbs)
        for (int a = 0; a < machine->actuators; a++) q[a] /= machine->sharing[a];
    whole_or_nan(q, machine->actuators);
}

/* The same at a home or a guess, once a call. */
RARE void inverse_once(const pkm_machine *machine, const limb_numbers *limb, const real *R,
                       const real *p, real *q)
{
    inverse_at(machine, limb, R, p, q);
}

int CALL(inverse)(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                  ptrdiff_t geometry_stride, const double *pose, double *q)
{
    if (!pkm_closure_count(machine)) return PKM_BAD_MACHINE;
    enum { BLOCKS_INVERSE = 2 }; /* side by side: the processor overlaps them */
    limb_numbers limb[PKM_MAX_LIMBS];
    for (ptrdiff_t first = 0; first < n; first += BLOCKS_INVERSE * LANES) {
        ptrdiff_t row[BLOCKS_INVERSE][LANES];
        real lane_pose[BLOCKS_INVERSE][6], R[BLOCKS_INVERSE][9], p[BLOCKS_INVERSE][3];
        real lane_q[BLOCKS_INVERSE][PKM_MAX_LIMBS];
        int count[BLOCKS_INVERSE];
        for (int t = 0; t < BLOCKS_INVERSE; t++) {
            count[t] = block_rows(first + t * LANES, n, row[t]);
            gather_row(pose, 6, 6, row[t], lane_pose[t]);
        }
        for (int t = 0; t < BLOCKS_INVERSE; t++) FN(pose_frame)(lane_pose[t], R[t], p[t]);
        for (int t = 0; t < BLOCKS_INVERSE; t++) {
            if (first + t == 0 || geometry_stride)
                prepare_limbs(machine, geometry, geometry_stride, row[t], limb);
            inverse_at(machine, limb, R[t], p[t], lane_q[t]);
        }
        for (int t = 0; t < BLOCKS_INVERSE; t++)
            scatter_row(lane_q[t], machine->actuators, q, machine->actuators, row[t], count[t]);
    }
    return 0;
}

#endif
