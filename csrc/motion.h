/* Along a path: velocity and acceleration of the actuators from those of the platform, limb by limb,
 * and of the platform from those of the actuators. */
#ifndef MOTION_H
#define MOTION_H

#include "jacobian.h"
#include "rates.h"

/* A point b of the platform, seen from `origin`, with its first and second derivative by time. T holds
 * the platform's homogeneous matrix, row by row, and its derivatives: the path is linear in each. */
INLINE void point_path(const real T[3][12], const real *b, const real *origin, real path[3][3])
{
    const real nowhere[3] = {fill(0.0), fill(0.0), fill(0.0)};
    for (int k = 0; k < 3; k++) {
        const real R[9] = {T[k][0], T[k][1], T[k][2], T[k][4], T[k][5], T[k][6],
                           T[k][8], T[k][9], T[k][10]};
        const real p[3] = {T[k][3], T[k][7], T[k][11]};
        FN(limb_joint)(R, p, b, k == 0 ? origin : nowhere, path[k]);
    }
}

/* A limb's dq/dt and d²q/dt². */
INLINE void limb_rates(const pkm_machine *machine, int i, const limb_numbers *limb,
                       const real T[3][12], real *rate, real *bend)
{
    real h[3][3], qt1 = fill(NAN), qt2 = qt1;
    point_path(T, limb->g + PLATFORM_X, limb->g + BASE_X, h);
    const real qt = limb_drive_at(machine, i, limb, h[0]);
    switch (machine->driver[i]) {
#define CASE(NAME, name, ...)                                                                     \
    case DRIVER_##NAME:                                                                           \
        FN(name##_rates)(qt, h[0], h[1], h[2], limb->first, limb->second, &qt1, &qt2);            \
        break;
        EACH_DRIVER(CASE)
        NO_OTHER_CASE;
#undef CASE
    }
    *rate = qt1 * limb->per_gain;
    *bend = qt2 * limb->per_gain;
}

/* Limbs that share an actuator are averaged, as by the inverse. */
int CALL(rates)(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                ptrdiff_t geometry_stride, const double *motion, double *q1, double *q2)
{
    if (!pkm_prepared(machine)) return PKM_BAD_MACHINE;
    const int actuators = machine->actuators;
    limb_numbers limb[PKM_MAX_LIMBS];
    EACH_BLOCK(first, n, row, count) {
        real T[3][12], rate[PKM_MAX_LIMBS], bend[PKM_MAX_LIMBS];
        prepare_block(machine, geometry, geometry_stride, first, row, limb);
        for (int k = 0; k < 3; k++) gather_row(motion + 16 * k, 48, 12, row, T[k]);
        for (int a = 0; a < actuators; a++) rate[a] = bend[a] = fill(0.0);
        for (int i = 0; i < machine->limbs; i++) {
            real of_rate, of_bend;
            limb_rates(machine, i, &limb[i], T, &of_rate, &of_bend);
            rate[machine->actuator[i]] += of_rate;
            bend[machine->actuator[i]] += of_bend;
        }
        for (int a = 0; a < actuators; a++) {
            rate[a] /= machine->sharing[a];
            bend[a] /= machine->sharing[a];
        }
        whole_or_nan(rate, actuators);
        whole_or_nan(bend, actuators);
        scatter_row(rate, actuators, q1, actuators, row, count);
        scatter_row(bend, actuators, q2, actuators, row, count);
    }
    return 0;
}

/* d²Φ/dt² of a limb's rows where the platform moves as T says and the actuator with q1 and q2; each in
 * the size of the scaled rows. Returns how many rows it has. */
SHARED int limb_bends(const pkm_machine *machine, int i, const limb_numbers *limb,
                      const FN(limb_sphere) *sphere, const double *weight, const real T[3][12],
                      real q, real q1, real q2, real *bend)
{
    real h[3][3], d[3][3], turning[3][12], qt;
    const real nowhere[3] = {fill(0.0), fill(0.0), fill(0.0)};
    int r = 0;
    point_path(T, limb->g + PLATFORM_X, limb->g + BASE_X, h);
    FN(limb_drive)(q, limb->g, &qt);
    const real qt1 = q1 * limb->g[GAIN], qt2 = q2 * limb->g[GAIN];
    switch (machine->driver[i]) {
#define CASE(NAME, name, MOVES, ...)                                                              \
    case DRIVER_##NAME:                                                                           \
        FN(name##_bend)(qt, qt1, qt2, h[0], h[1], h[2], limb->first, limb->second, &bend[r]);     \
        if (MOVES)                                                                                \
            FN(name##_path)(qt, qt1, qt2, h[0], h[1], h[2], limb->first, limb->second, d[0],      \
                            d[1], d[2]);                                                          \
        else                                                                                      \
            memcpy(d, h, sizeof d);                                                               \
        break;
        EACH_DRIVER(CASE)
        NO_OTHER_CASE;
#undef CASE
    }
    bend[r] *= weight[r] / sphere->rho;
    r++;
    memcpy(turning, T, sizeof turning);
    for (int k = 0; k < 3; k++) /* an axis has no place */
        turning[k][3] = turning[k][7] = turning[k][11] = fill(0.0);
    for (int kind = 1; kind <= ALL_ROWS; kind *= 2) {
        real axis[3][3];
        if (!(machine->rows[i] & kind)) continue;
        switch (kind) {
#define CASE(NAME, name, N, A)                                                                    \
        case ROW_##NAME:                                                                          \
            point_path(turning, limb->axis[A], nowhere, axis);                                    \
            FN(name##_bend)(d[0], d[1], d[2], limb->axis[N], axis[0], axis[1], axis[2],           \
                            fill(machine->lever[i]), &bend[r]);                                   \
            break;
            EACH_ROW(CASE)
            NO_OTHER_CASE;
#undef CASE
        }
        bend[r] *= weight[r];
        r++;
    }
    return r;
}

INLINE void map_bend(int map, const real *state, const real *delta, real *twist_rate)
{
    switch (map) {
#define CASE(NAME, name, ...) case MAP_##NAME: FN(map_##name##_bend)(state, delta, twist_rate); break;
    EACH_MAP(CASE)
#undef CASE
    }
}

/* The platform's motion T and the pose's two derivatives, from those of the actuators. The closures
 * hold along the path: Φ_u δ1 = -Φ_q q1 gives the step's speed; with it and no more, Φ bends by what
 * the second step makes up for. Exact where all closures hold. */
INLINE void motion_at(int map, const pkm_machine *machine, const limb_numbers *limb,
                      const real *pose, const real *q, const real *q1, const real *q2,
                      real T[3][12], real *pose_rates)
{
    const int m = map_m(map);
    FN(limb_sphere) sphere[PKM_MAX_LIMBS];
    real state[MAX_STATE], R[9], p[3], response[6 * PKM_MAX_ROWS], step[6], bend[PKM_MAX_ROWS];
    real twist[6], twist_rate[6], rest[6];
    map_from_pose(map, pose, state);
    FN(map_frame)(map, state, R, p);
    spheres_at(machine, limb, q, sphere);
    const int rows = step_response(map, machine, sphere, state, response);
    for (int j = 0; j < m; j++) step[j] = fill(0.0);
    for (int i = 0, r = 0; i < machine->limbs; i++) {
        real by_q, by_g[SLOTS];
        sphere_derivatives_called(machine, i, &limb[i], R, p, q[machine->actuator[i]], &by_q, by_g);
        real scale = machine->weight[r] / sphere[i].rho;
        for (int kind = 0; kind <= ALL_ROWS; kind = kind ? 2 * kind : 1) {
            if (kind && !(machine->rows[i] & kind)) continue;
            if (kind && driver_moves(machine->driver[i])) {
                constraint_derivatives(machine, i, kind, &limb[i], &sphere[i], R, p,
                                       q[machine->actuator[i]], &by_q, by_g);
                scale = fill(machine->weight[r]);
            }
            if (!kind || driver_moves(machine->driver[i]))
                for (int j = 0; j < m; j++)
                    step[j] += response[j * rows + machine->order[r]] * (by_q * scale)
                               * q1[machine->actuator[i]];
            r++;
        }
    }
    map_twist(map, state, step, twist);
    map_bend(map, state, step, twist_rate);
    FN(frame_motion)(R, p, twist, twist_rate, T[0], T[1], T[2]);
    for (int i = 0, r = 0; i < machine->limbs; i++) {
        const int a = machine->actuator[i];
        r += limb_bends(machine, i, &limb[i], &sphere[i], machine->weight + r, T, q[a], q1[a], q2[a],
                        bend + r);
    }
    for (int j = 0; j < m; j++) {
        step[j] = fill(0.0);
        for (int r = 0; r < rows; r++) step[j] += response[j * rows + machine->order[r]] * bend[r];
    }
    map_twist(map, state, step, rest);
    for (int k = 0; k < 6; k++) twist_rate[k] += rest[k];
    FN(frame_motion)(R, p, twist, twist_rate, T[0], T[1], T[2]);
    FN(pose_rates)(pose, twist, twist_rate, pose_rates, pose_rates + 6);
    whole_or_nan(T[0], 36);
    whole_or_nan(pose_rates, 12);
}

INLINE void motion_map(int map, const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                       ptrdiff_t geometry_stride, const double *pose, const double *q,
                       const double *q1, const double *q2, double *motion, double *pose_rates)
{
    const int actuators = machine->actuators;
    limb_numbers limb[PKM_MAX_LIMBS];
    EACH_BLOCK(first, n, row, count) {
        real lane_pose[6], lane_q[3][PKM_MAX_LIMBS], T[3][12], rates[12];
        prepare_block(machine, geometry, geometry_stride, first, row, limb);
        gather_row(pose, 6, 6, row, lane_pose);
        gather_row(q, actuators, actuators, row, lane_q[0]);
        gather_row(q1, actuators, actuators, row, lane_q[1]);
        gather_row(q2, actuators, actuators, row, lane_q[2]);
        motion_at(map, machine, limb, lane_pose, lane_q[0], lane_q[1], lane_q[2], T, rates);
        for (int k = 0; k < 3; k++) {
            scatter_row(T[k], 12, motion + 16 * k, 48, row, count);
            for (int j = 12; j < 16; j++)
                scatter(fill(k == 0 && j == 15 ? 1.0 : 0.0), motion + 16 * k + j, 48, row, count);
        }
        scatter_row(rates, 12, pose_rates, 12, row, count);
    }
}

int CALL(motion)(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                 ptrdiff_t geometry_stride, const double *pose, const double *q,
                 const double *q1, const double *q2, double *motion, double *pose_rates)
{
    if (!pkm_prepared(machine)) return PKM_BAD_MACHINE;
    switch (machine->map) {
#define CASE(NAME, name, ...)                                                                       \
    case MAP_##NAME:                                                                              \
        motion_map(MAP_##NAME, machine, n, geometry, geometry_stride, pose, q, q1, q2, motion,    \
                   pose_rates);                                                                   \
        break;
        EACH_MAP(CASE)
#undef CASE
    }
    return 0;
}

#endif
