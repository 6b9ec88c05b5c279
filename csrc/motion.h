/* Actuators along a path: velocity and acceleration from those of the platform, limb by limb. */
#ifndef MOTION_H
#define MOTION_H

#include "inverse.h"

/* A limb's dq/dt and d²q/dt². T holds the platform's homogeneous matrix, row by row, and its first and
 * second derivative by time: the joint's path is linear in each of them. */
INLINE void limb_rates(const pkm_machine *machine, int i, const limb_numbers *limb,
                       const real T[3][12], real *rate, real *bend)
{
    const real nowhere[3] = {fill(0.0), fill(0.0), fill(0.0)};
    real h[3][3], qt1, qt2;
    for (int k = 0; k < 3; k++) {
        const real R[9] = {T[k][0], T[k][1], T[k][2], T[k][4], T[k][5], T[k][6],
                           T[k][8], T[k][9], T[k][10]};
        const real p[3] = {T[k][3], T[k][7], T[k][11]};
        FN(limb_joint)(R, p, limb->g + PLATFORM_X, k == 0 ? limb->g + BASE_X : nowhere, h[k]);
    }
    const real qt = limb_drive_at(machine, i, limb, h[0]);
    if (machine->driver[i] == DRIVER_LENGTH)
        FN(length_rates)(qt, h[0], h[1], h[2], &qt1, &qt2);
    else if (machine->driver[i] == DRIVER_SLIDER)
        FN(slider_rates)(qt, h[0], h[1], h[2], limb->first, &qt1, &qt2);
    else
        FN(crank_rates)(qt, h[0], h[1], h[2], limb->first, limb->second, &qt1, &qt2);
    *rate = qt1 * limb->per_gain;
    *bend = qt2 * limb->per_gain;
}

/* Limbs that share an actuator are averaged, as by the inverse. */
INLINE void rates_rows(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                       const double *motion, double *q1, double *q2)
{
    const int actuators = machine->actuators;
    double sharing[PKM_MAX_LIMBS] = {0};
    limb_numbers limb[PKM_MAX_LIMBS];
    for (int i = 0; i < machine->limbs; i++) sharing[machine->actuator[i]] += 1.0;
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real T[3][12], rate[PKM_MAX_LIMBS], bend[PKM_MAX_LIMBS];
        const int count = block_rows(first, n, row);
        if (first == 0) prepare_limbs(machine, geometry, 0, row, limb);
        for (int k = 0; k < 3; k++)
            for (int j = 0; j < 12; j++) T[k][j] = gather(motion + 16 * k + j, 48, row);
        for (int a = 0; a < actuators; a++) rate[a] = bend[a] = fill(0.0);
        for (int i = 0; i < machine->limbs; i++) {
            real of_rate, of_bend;
            limb_rates(machine, i, &limb[i], T, &of_rate, &of_bend);
            rate[machine->actuator[i]] += of_rate;
            bend[machine->actuator[i]] += of_bend;
        }
        for (int a = 0; a < actuators; a++) {
            rate[a] /= sharing[a];
            bend[a] /= sharing[a];
        }
        whole_or_nan(rate, actuators);
        whole_or_nan(bend, actuators);
        for (int a = 0; a < actuators; a++) {
            scatter(rate[a], q1 + a, actuators, row, count);
            scatter(bend[a], q2 + a, actuators, row, count);
        }
    }
}

#endif
