/* Actuators as instruments of the pose: what each limb would read at a pose, less what was read, with
 * the derivatives by the map's step and by the limb's numbers; and poses moved by such steps. */
#ifndef READINGS_H
#define READINGS_H

#include "jacobian.h"

typedef struct {
    double *residual;  /* (n, rows): sphere rows in units of the actuator, the others in mm */
    double *by_step;   /* (n, rows, m) */
    double *by_number; /* (n, rows, columns), NULL where nobody asks */
} readings_out;

/* The sphere row of limb i, solved for the actuator coordinate: zero where the pose needs `read`. Where
 * the limb does not reach, the closure at `read` over its slope by the actuator. `by_g` is that of the
 * closure, whose slope by the actuator is `by_q`. */
INLINE real actuator_row(int map, const pkm_machine *machine, int i, const limb_numbers *limb,
                         const real *state, const real *R, const real *p, real read, real *by_step,
                         real *by_q, real *by_g)
{
    FN(limb_sphere) sphere;
    real phi, omega[3], v[3], about;
    mask reachable = fill_mask(-1);
    FN(limb_drive)(read, limb->g, &about);
    const real own = limb_inverse(machine, i, limb, R, p, about);
    const mask reaches = is_finite(own);
    const real at = select(reaches, own, read);
    sphere_of_numbers(machine->driver[i], limb, &sphere);
    sphere_at(machine->driver[i], limb, at, &sphere, &reachable);
    FN(sphere_row)(R, p, limb->g + PLATFORM_X, sphere.c, sphere.rho * sphere.rho, &phi, omega, v);
    FN(map_pull)(map, state, omega, v, by_step);
    sphere_derivatives_called(machine, i, limb, R, p, at, by_q, by_g);
    for (int j = 0; j < map_m(map); j++) by_step[j] /= -*by_q;
    return select(reaches, own - read, -phi / *by_q);
}

INLINE void readings_map(int map, const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                         ptrdiff_t geometry_stride, const double *pose, const double *q,
                         const int32_t *column, int columns, const readings_out *out)
{
    const int m = map_m(map), actuators = machine->actuators, rows = pkm_closure_count(machine);
    limb_numbers limb[PKM_MAX_LIMBS];
    EACH_BLOCK(first, n, row, count) {
        real lane_pose[6], lane_q[PKM_MAX_LIMBS], state[MAX_STATE], R[9], p[3];
        FN(limb_sphere) sphere[PKM_MAX_LIMBS];
        prepare_block(machine, geometry, geometry_stride, first, row, limb);
        gather_row(pose, 6, 6, row, lane_pose);
        gather_row(q, actuators, actuators, row, lane_q);
        map_from_pose(map, lane_pose, state);
        FN(map_frame)(map, state, R, p);
        spheres_at(machine, limb, lane_q, sphere);
        for (int i = 0, r = 0, c = 0; i < machine->limbs; i++) {
            const real own_q = lane_q[machine->actuator[i]];
            int end = c;
            while (end < columns && column[end] / SLOTS == i) end++;
            for (int kind = 0; kind <= ALL_ROWS; kind = kind ? 2 * kind : 1) {
                real residual, by_step[6], by_q, by_g[SLOTS];
                if (kind && !(machine->rows[i] & kind)) continue;
                if (!kind) {
                    residual = actuator_row(map, machine, i, &limb[i], state, R, p, own_q, by_step,
                                            &by_q, by_g);
                    for (int k = c; k < end; k++) by_g[column[k] % SLOTS] /= -by_q;
                } else {
                    real omega[3], v[3];
                    const double weight = machine->weight[r];
                    FN(constraint_row)(kind, R, p, sphere[i].b, sphere[i].c, sphere[i].axis,
                                       machine->lever[i], &residual, omega, v);
                    FN(map_pull)(map, state, omega, v, by_step);
                    constraint_derivatives(machine, i, kind, &limb[i], &sphere[i], R, p, own_q, &by_q,
                                           by_g);
                    residual *= weight;
                    for (int j = 0; j < m; j++) by_step[j] *= weight;
                    for (int s = 0; s < SLOTS; s++) by_g[s] *= weight;
                }
                scatter(residual, out->residual + r, rows, row, count);
                scatter_row(by_step, m, out->by_step + r * m, rows * m, row, count);
                if (out->by_number) {
                    double *by_number = out->by_number + (ptrdiff_t)r * columns;
                    for (int k = 0; k < columns; k++)
                        scatter(k >= c && k < end ? by_g[column[k] % SLOTS] : fill(0.0),
                                by_number + k, (ptrdiff_t)rows * columns, row, count);
                }
                r++;
            }
            c = end;
        }
    }
}

int CALL(readings)(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                   ptrdiff_t geometry_stride, const double *pose, const double *q,
                   const int32_t *column, int columns, double *residual, double *by_step,
                   double *by_number)
{
    const readings_out out = {residual, by_step, by_number};
    if (!pkm_closure_count(machine)) return PKM_BAD_MACHINE;
    for (int c = 0; c < columns; c++)
        if (column[c] < 0 || column[c] >= SLOTS * machine->limbs || (c && column[c] <= column[c - 1]))
            return PKM_BAD_COLUMN;
    switch (machine->map) {
#define CASE(NAME, name, ...)                                                                       \
    case MAP_##NAME:                                                                              \
        readings_map(MAP_##NAME, machine, n, geometry, geometry_stride, pose, q, column, columns, \
                     &out);                                                                       \
        break;
        EACH_MAP(CASE)
#undef CASE
    }
    return 0;
}

INLINE void moved_map(int map, ptrdiff_t n, const double *pose, const double *step, double *moved,
                      double *twist)
{
    const int m = map_m(map);
    EACH_BLOCK(first, n, row, count) {
        real lane_pose[6], delta[6], state[MAX_STATE], after[MAX_STATE], found[6], columns[36];
        gather_row(pose, 6, 6, row, lane_pose);
        gather_row(step, m, m, row, delta);
        map_from_pose(map, lane_pose, state);
        FN(map_retract)(map, state, delta, after);
        FN(map_tidy)(map, after, state); /* long steps leave the manifold by more than rounding */
        map_to_pose(map, state, found);
        scatter_row(found, 6, moved, 6, row, count);
        if (!twist) continue;
        map_from_pose(map, lane_pose, state);
        for (int j = 0; j < m; j++) {
            real unit[6], of_unit[6];
            for (int k = 0; k < m; k++) unit[k] = fill(k == j ? 1.0 : 0.0);
            map_twist(map, state, unit, of_unit);
            for (int k = 0; k < 6; k++) columns[k * m + j] = of_unit[k];
        }
        scatter_row(columns, 6 * m, twist, 6 * m, row, count);
    }
}

int CALL(moved)(int map, ptrdiff_t n, const double *pose, const double *step, double *moved,
                double *twist)
{
    switch (map) {
#define CASE(NAME, name, ...)                                                                       \
    case MAP_##NAME: moved_map(MAP_##NAME, n, pose, step, moved, twist); return 0;
        EACH_MAP(CASE)
#undef CASE
    }
    return PKM_BAD_MACHINE;
}

#endif
