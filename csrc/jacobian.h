/* Derivatives at a pose: of the actuators by the free coordinates, of the pose by the actuators,
 * and of the pose by every number of every limb. */
#ifndef JACOBIAN_H
#define JACOBIAN_H

#include "inverse.h"
#include "solve.h"

/* The sphere row's derivatives by the actuator and by the limb's numbers. */
INLINE void sphere_derivatives(const pkm_machine *machine, int i, const limb_numbers *limb,
                               const real *R, const real *p, real q, real *by_q, real *by_g)
{
    real F[9];
    fill_frame(frame_of_axis(machine, i, 0), F);
    switch (machine->driver[i]) {
#define CASE(NAME, name, ...)                                                                     \
    case DRIVER_##NAME: FN(name##_derivatives)(R, p, q, limb->g, F, by_q, by_g); break;
        EACH_DRIVER(CASE)
        NO_OTHER_CASE;
#undef CASE
    }
}

/* The same out of line, where it is not the innermost loop. */
SHARED void sphere_derivatives_called(const pkm_machine *machine, int i, const limb_numbers *limb,
                                      const real *R, const real *p, real q, real *by_q, real *by_g)
{
    sphere_derivatives(machine, i, limb, R, p, q, by_q, by_g);
}

/* The same of a row beside the sphere: with the anchor held, and by what moves the anchor. */
SHARED void constraint_derivatives(const pkm_machine *machine, int i, int kind,
                                   const limb_numbers *limb, const FN(limb_sphere) *sphere,
                                   const real *R, const real *p, real q, real *by_q, real *by_g)
{
    real F[9], P[9], v[3], pull[3], of_anchor[SLOTS];
    switch (kind) {
#define CASE(NAME, name, N, A)                                                                    \
    case ROW_##NAME:                                                                              \
        fill_frame(frame_of_axis(machine, i, N), F);                                              \
        fill_frame(frame_of_axis(machine, i, A), P);                                              \
        FN(name##_derivatives)(R, p, sphere->c, limb->g, F, P, fill(machine->lever[i]), v, by_g); \
        break;
        EACH_ROW(CASE)
        NO_OTHER_CASE;
#undef CASE
    }
    for (int k = 0; k < 3; k++) pull[k] = -v[k]; /* Φ depends on d = p + R b - c */
    fill_frame(frame_of_axis(machine, i, 0), F);
    switch (machine->driver[i]) {
#define CASE(NAME, name, ...)                                                                     \
    case DRIVER_##NAME: FN(name##_carry)(q, limb->g, pull, F, by_q, of_anchor); break;
        EACH_DRIVER(CASE)
        NO_OTHER_CASE;
#undef CASE
    }
    for (int s = 0; s < SLOTS; s++) by_g[s] += of_anchor[s];
}

/* ∂q/∂free of every actuator, -Φ_free / Φ_q limb by limb, averaged where limbs share one. NaN where
 * a limb does not reach, or is at right angles to its slider or in line with its crank. */
INLINE void jacobian_block(int map, const pkm_machine *machine, const limb_numbers *limb,
                           const real *pose, real *out)
{
    const int m = map_m(map);
    real state[MAX_STATE], R[9], p[3];
    map_from_pose(map, pose, state);
    FN(map_frame)(map, state, R, p);
    for (int k = 0; k < machine->actuators * m; k++) out[k] = fill(0.0);
    for (int i = 0; i < machine->limbs; i++) {
        real phi, omega[3], v[3], row[6], by_free[6], by_q, by_g[SLOTS];
        FN(limb_sphere) sphere;
        mask reachable = fill_mask(-1);
        const int a = machine->actuator[i];
        real own = limb_inverse(machine, i, &limb[i], R, p, fill(machine->near[i]));
        own = select(is_finite(own), own, fill(NAN));
        sphere_of_numbers(machine->driver[i], &limb[i], &sphere);
        sphere_at(machine->driver[i], &limb[i], own, &sphere, &reachable);
        FN(sphere_row)(R, p, limb[i].g + PLATFORM_X, sphere.c, sphere.rho * sphere.rho, &phi, omega, v);
        FN(map_pull)(map, state, omega, v, row);
        map_free(map, state, row, by_free);
        sphere_derivatives(machine, i, &limb[i], R, p, own, &by_q, by_g);
        for (int j = 0; j < m; j++) out[a * m + j] -= by_free[j] / (by_q * machine->sharing[a]);
    }
    whole_or_nan(out, machine->actuators * m);
}

/* How the map's step answers a residual in each row, -Φ⁻¹ (m x rows), per unit of the scaled rows;
 * NaN where they are singular. */
INLINE int response_rows(int map, const pkm_machine *machine, const FN(limb_sphere) *sphere,
                         const real *state, real *response)
{
    const int m = map_m(map);
    real residual[PKM_MAX_ROWS], jacobian[PKM_MAX_ROWS * 6], A[36], pivot;
    const int rows = scaled_rows(map, machine, sphere, state, residual, jacobian);
    normal_matrix(m, rows, jacobian, A);
    normal_sides(m, rows, jacobian, response);
    solve(m, rows, A, response, &pivot);
    const mask known = pivot > fill(1e-14);
    for (int j = 0; j < m; j++) {
        const double scale = map_is_angle(map, j) ? -1.0 / machine->length : -1.0;
        for (int r = 0; r < rows; r++)
            response[j * rows + r] = select(known, response[j * rows + r] * scale, fill(NAN));
    }
    return rows;
}

#define STEP_RESPONSE(NAME, name, ...)                                                            \
    SHARED int response_##name(const pkm_machine *machine, const FN(limb_sphere) *sphere,         \
                               const real *state, real *response)                                 \
    {                                                                                             \
        return response_rows(MAP_##NAME, machine, sphere, state, response);                       \
    }
EACH_MAP(STEP_RESPONSE)
#undef STEP_RESPONSE

INLINE int step_response(int map, const pkm_machine *machine, const FN(limb_sphere) *sphere,
                         const real *state, real *response)
{
    switch (map) {
#define CASE(NAME, name, ...)                                                                     \
    case MAP_##NAME: return response_##name(machine, sphere, state, response);
    EACH_MAP(CASE)
#undef CASE
    }
    return 0;
}

/* The same of the pose, or where `twists` of the platform: -M Φ⁻¹ (6 x rows). */
INLINE int pose_response(int map, const pkm_machine *machine, const FN(limb_sphere) *sphere,
                         const real *state, int twists, real *response)
{
    const int m = map_m(map);
    real X[6 * PKM_MAX_ROWS];
    const int rows = step_response(map, machine, sphere, state, X);
    const mask known = is_finite(X[0]);
    for (int r = 0; r < rows; r++) {
        real step[6], rates[6];
        for (int j = 0; j < m; j++) step[j] = X[j * rows + r];
        if (twists) map_twist(map, state, step, rates);
        else map_rates(map, state, step, rates);
        for (int k = 0; k < 6; k++)
            response[k * rows + r] = select(known, rates[k], fill(NAN));
    }
    return rows;
}

/* ∂pose/∂q (6 x actuators) where `column` is NULL, else ∂pose/∂numbers (6 x columns); of the twist
 * (ω, v) where `twists`. */
INLINE void response_block(int map, const pkm_machine *machine, const limb_numbers *limb,
                           const real *pose, const real *q, const int32_t *column, int columns,
                           int twists, real *out)
{
    FN(limb_sphere) sphere[PKM_MAX_LIMBS];
    real state[MAX_STATE], R[9], p[3], response[6 * PKM_MAX_ROWS];
    int r = 0, c = 0;
    map_from_pose(map, pose, state);
    FN(map_frame)(map, state, R, p);
    spheres_at(machine, limb, q, sphere);
    const int rows = pose_response(map, machine, sphere, state, twists, response);
    for (int k = 0; k < 6 * columns; k++) out[k] = fill(0.0);
    for (int i = 0; i < machine->limbs; i++) {
        real by_q, by_g[SLOTS], scale = machine->weight[r] / sphere[i].rho;
        sphere_derivatives(machine, i, &limb[i], R, p, q[machine->actuator[i]], &by_q, by_g);
        const int a = machine->actuator[i];
        int end = c;
        if (column)
            while (end < columns && column[end] / SLOTS == i) end++;
        for (int kind = 0; kind <= ALL_ROWS; kind = kind ? 2 * kind : 1) {
            if (kind && !(machine->rows[i] & kind)) continue;
            if (kind) {
                constraint_derivatives(machine, i, kind, &limb[i], &sphere[i], R, p, q[a], &by_q, by_g);
                scale = fill(machine->weight[r]);
            }
            const real *answer = response + machine->order[r];
            if (!column && (!kind || driver_moves(machine->driver[i])))
                for (int k = 0; k < 6; k++) out[k * columns + a] += answer[k * rows] * scale * by_q;
            for (int j = c; j < end; j++)
                for (int k = 0; k < 6; k++)
                    out[k * columns + j] += answer[k * rows] * (scale * by_g[column[j] % SLOTS]);
            r++;
        }
        c = end;
    }
}

INLINE void jacobian_map(int map, const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                         ptrdiff_t geometry_stride, const double *pose, double *jacobian)
{
    limb_numbers limb[PKM_MAX_LIMBS];
    const int width = machine->actuators * map_m(map);
    EACH_BLOCK(first, n, row, count) {
        real lane_pose[6], out[PKM_MAX_LIMBS * 6];
        prepare_block(machine, geometry, geometry_stride, first, row, limb);
        gather_row(pose, 6, 6, row, lane_pose);
        jacobian_block(map, machine, limb, lane_pose, out);
        scatter_row(out, width, jacobian, width, row, count);
    }
}

INLINE void response_map(int map, const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                         ptrdiff_t geometry_stride, const double *pose, const double *q,
                         const int32_t *column, int columns, int twists, double *jacobian)
{
    limb_numbers limb[PKM_MAX_LIMBS];
    const int actuators = machine->actuators, width = 6 * columns;
    EACH_BLOCK(first, n, row, count) {
        real lane_pose[6], lane_q[PKM_MAX_LIMBS], out[6 * PKM_MAX_LIMBS * SLOTS];
        prepare_block(machine, geometry, geometry_stride, first, row, limb);
        gather_row(pose, 6, 6, row, lane_pose);
        gather_row(q, actuators, actuators, row, lane_q);
        response_block(map, machine, limb, lane_pose, lane_q, column, columns, twists, out);
        scatter_row(out, width, jacobian, width, row, count);
    }
}

int CALL(jacobian)(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                   ptrdiff_t geometry_stride, const double *pose, double *jacobian)
{
    if (!pkm_prepared(machine)) return PKM_BAD_MACHINE;
    switch (machine->map) {
#define CASE(NAME, name, ...)                                                                       \
    case MAP_##NAME:                                                                              \
        jacobian_map(MAP_##NAME, machine, n, geometry, geometry_stride, pose, jacobian);          \
        break;
        EACH_MAP(CASE)
#undef CASE
    }
    return 0;
}

SHARED void responses(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                      ptrdiff_t geometry_stride, const double *pose, const double *q,
                      const int32_t *column, int columns, int twists, double *jacobian)
{
    switch (machine->map) {
#define CASE(NAME, name, ...)                                                                       \
    case MAP_##NAME:                                                                              \
        response_map(MAP_##NAME, machine, n, geometry, geometry_stride, pose, q, column, columns, \
                     twists, jacobian);                                                           \
        break;
        EACH_MAP(CASE)
#undef CASE
    }
}

int CALL(forward_jacobian)(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                           ptrdiff_t geometry_stride, const double *pose, const double *q,
                           int twists, double *jacobian)
{
    if (!pkm_prepared(machine)) return PKM_BAD_MACHINE;
    responses(machine, n, geometry, geometry_stride, pose, q, NULL, machine->actuators, twists,
              jacobian);
    return 0;
}

int CALL(error_jacobian)(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                         ptrdiff_t geometry_stride, const double *pose, const double *q,
                         const int32_t *column, int columns, int twists, double *jacobian)
{
    if (!pkm_prepared(machine)) return PKM_BAD_MACHINE;
    for (int c = 0; c < columns; c++)
        if (column[c] < 0 || column[c] >= SLOTS * machine->limbs || (c && column[c] <= column[c - 1]))
            return PKM_BAD_COLUMN;
    responses(machine, n, geometry, geometry_stride, pose, q, column, columns, twists, jacobian);
    return 0;
}

#endif
