/* Inverse kinematics: each limb in closed form at the pose as given. */
#ifndef INVERSE_H
#define INVERSE_H

#include "closure.h"

/* q̃ of a limb whose platform joint is h from its base point; not finite out of reach, or so far away
 * that squares overflow. */
INLINE real limb_drive_at(const pkm_machine *machine, int i, const limb_numbers *limb, const real *h)
{
    real qt;
    if (machine->driver[i] == DRIVER_LENGTH) {
        FN(length_inverse)(limb->g, h, &qt);
    } else if (machine->driver[i] == DRIVER_SLIDER) {
        FN(slider_inverse)(limb->g, h, limb->first, fill(machine->branch[i]), &qt);
    } else {
        real sine, cosine;
        FN(crank_inverse)(limb->g, h, limb->first, limb->second, fill(machine->branch[i]), &sine,
                          &cosine);
        qt = arctangent2(sine, cosine);
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
    real lane[PKM_MAX_LIMBS];
    double sharing[PKM_MAX_LIMBS] = {0};
    for (int i = 0; i < machine->limbs; i++) {
        lane[i] = limb_inverse(machine, i, &limb[i], R, p);
        sharing[machine->actuator[i]] += 1.0;
    }
    for (int a = 0; a < machine->actuators; a++) q[a] = fill(0.0);
    for (int i = 0; i < machine->limbs; i++) q[machine->actuator[i]] += lane[i];
    for (int a = 0; a < machine->actuators; a++)
        if (sharing[a] > 1.0) q[a] /= sharing[a];
    whole_or_nan(q, machine->actuators);
}

INLINE void inverse_rows(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                         ptrdiff_t geometry_stride, const double *pose, double *q)
{
    limb_numbers limb[PKM_MAX_LIMBS];
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_pose[6], R[9], p[3], lane_q[PKM_MAX_LIMBS];
        const int count = block_rows(first, n, row);
        if (first == 0 || geometry_stride)
            prepare_limbs(machine, geometry, geometry_stride, row, limb);
        gather_row(pose, 6, 6, row, lane_pose);
        FN(pose_frame)(lane_pose, R, p);
        inverse_at(machine, limb, R, p, lane_q);
        scatter_row(lane_q, machine->actuators, q, machine->actuators, row, count);
    }
}

#endif
