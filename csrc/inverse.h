/* Inverse kinematics: each limb in closed form at the pose as given. */
#ifndef INVERSE_H
#define INVERSE_H

#include "closure.h"

INLINE real limb_inverse(const pkm_machine *machine, int i, const limb_numbers *limb, const real *R,
                         const real *p)
{
    real h[3], qt, q;
    FN(limb_joint)(R, p, limb->g + PLATFORM_X, limb->g + BASE_X, h);
    if (machine->driver[i] == DRIVER_LENGTH) {
        FN(length_inverse)(limb->g, h, &qt);
    } else if (machine->driver[i] == DRIVER_SLIDER) {
        FN(slider_inverse)(limb->g, h, limb->first, FN(fill)(machine->branch[i]), &qt);
    } else {
        real sine[2], cosine[2];
        FN(crank_inverse)(limb->g, h, limb->first, limb->second, sine, cosine);
        qt = arctangent2(sine[0], cosine[0]) - machine->branch[i] * arctangent2(sine[1], cosine[1]);
        qt = select(qt > FN(fill)(PI), qt - 2.0 * PI, qt);
        qt = select(qt < FN(fill)(-PI), qt + 2.0 * PI, qt);
    }
    FN(limb_command)(qt, limb->g, &q);
    return q;
}

/* Limbs that share an actuator are averaged; one limb out of reach makes the whole row NaN. */
INLINE void inverse_block(const pkm_machine *machine, const limb_numbers *limb, const real *pose,
                          real *q)
{
    real R[9], p[3], lane[PKM_MAX_LIMBS];
    double sharing[PKM_MAX_LIMBS] = {0};
    mask reached = fill_mask(-1);
    FN(pose_frame)(pose, R, p);
    for (int i = 0; i < machine->limbs; i++) {
        lane[i] = limb_inverse(machine, i, &limb[i], R, p);
        reached &= finite(lane[i]);
        sharing[machine->actuator[i]] += 1.0;
    }
    for (int a = 0; a < machine->actuators; a++) q[a] = FN(fill)(0.0);
    for (int i = 0; i < machine->limbs; i++) q[machine->actuator[i]] += lane[i];
    for (int a = 0; a < machine->actuators; a++)
        q[a] = select(reached, q[a] / sharing[a], FN(fill)(NAN));
}

INLINE void inverse_rows(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                         ptrdiff_t geometry_stride, const double *pose, double *q)
{
    limb_numbers limb[PKM_MAX_LIMBS];
    for (ptrdiff_t row = 0; row < n; row += LANES) {
        const ptrdiff_t rows = n - row;
        real lane_pose[6], lane_q[PKM_MAX_LIMBS];
        if (row == 0 || geometry_stride)
            prepare_limbs(machine, geometry + row * geometry_stride, geometry_stride, rows, limb);
        for (int k = 0; k < 6; k++) lane_pose[k] = gather(pose + 6 * row + k, 6, rows);
        inverse_block(machine, limb, lane_pose, lane_q);
        for (int a = 0; a < machine->actuators; a++)
            scatter(lane_q[a], q + row * machine->actuators + a, machine->actuators, rows);
    }
}

#endif
