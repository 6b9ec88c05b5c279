/* A machine looked at: its closure rows with all their derivatives, and its limbs, at given poses. */
#ifndef INSPECT_H
#define INSPECT_H

#include "jacobian.h"

typedef struct {
    double *residual;  /* (n, rows) [mm] */
    double *by_step;   /* (n, rows, m), angles as arcs at the characteristic length */
    double *by_free;   /* (n, rows, m), by the free coordinates as reported */
    double *by_q;      /* (n, rows, actuators) */
    double *pose;      /* (n, 6), as the map has it */
    double *pose_by_free; /* (n, 6, m) */
} closure_out;

/* How the reported pose follows the free coordinates: ∂step/∂free, then the rates of the pose. */
INLINE void pose_rates_by_free(int map, const real *state, real out[36])
{
    const int m = map_m(map);
    real step_by_free[36];
    for (int j = 0; j < m; j++) {
        real covector[6];
        for (int k = 0; k < m; k++) covector[k] = fill(j == k);
        map_free(map, state, covector, step_by_free + j * m);
    }
    for (int k = 0; k < m; k++) {
        real step[6], rates[6];
        for (int j = 0; j < m; j++) step[j] = step_by_free[j * m + k];
        map_rates(map, state, step, rates);
        for (int i = 0; i < 6; i++) out[i * m + k] = rates[i];
    }
}

/* The closure rows at poses and actuator coordinates, limb by limb. */
INLINE void closure_map(int map, const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                        ptrdiff_t geometry_stride, const double *pose, const double *q,
                        const closure_out *out)
{
    const int m = map_m(map), actuators = machine->actuators;
    limb_numbers limb[PKM_MAX_LIMBS];
    EACH_BLOCK(first, n, row, count) {
        real lane_pose[6], lane_q[PKM_MAX_LIMBS], state[MAX_STATE], R[9], p[3];
        real residual[PKM_MAX_ROWS], jacobian[PKM_MAX_ROWS * 6];
        real on_map[6], by_free_of_pose[36];
        FN(limb_sphere) sphere[PKM_MAX_LIMBS];
        prepare_block(machine, geometry, geometry_stride, first, row, limb);
        gather_row(pose, 6, 6, row, lane_pose);
        gather_row(q, actuators, actuators, row, lane_q);
        map_from_pose(map, lane_pose, state);
        map_to_pose(map, state, on_map);
        scatter_row(on_map, 6, out->pose, 6, row, count);
        pose_rates_by_free(map, state, by_free_of_pose);
        scatter_row(by_free_of_pose, 6 * m, out->pose_by_free, 6 * m, row, count);
        FN(map_frame)(map, state, R, p);
        spheres_at(machine, limb, lane_q, sphere);
        const int rows = scaled_rows(map, machine, sphere, state, residual, jacobian);
        for (int i = 0, r = 0; i < machine->limbs; i++) {
            const int limb_rows = 1 + __builtin_popcount((unsigned)machine->rows[i]);
            const real own_q = lane_q[machine->actuator[i]];
            const int moves = driver_moves(machine->driver[i]);
            int kinds = machine->rows[i]; /* those that are still to come */
            for (int k = 0; k < limb_rows; k++, r++) {
                const real *covector = &jacobian[machine->order[r] * m];
                real step[6], free[6], by_q = fill(0.0), by_g[SLOTS];
                double *by_step = out->by_step + r * m, *by_free = out->by_free + r * m;
                scatter(residual[machine->order[r]], out->residual + r, rows, row, count);
                scatter_row(covector, m, by_step, rows * m, row, count);
                for (int j = 0; j < m; j++)
                    step[j] = covector[j] * (map_is_angle(map, j) ? machine->length : 1.0);
                map_free(map, state, step, free);
                scatter_row(free, m, by_free, rows * m, row, count);
                if (k == 0) {
                    sphere_derivatives_called(machine, i, &limb[i], R, p, own_q, &by_q, by_g);
                } else {
                    if (moves)
                        constraint_derivatives(machine, i, kinds & -kinds, &limb[i], &sphere[i], R, p,
                                               own_q, &by_q, by_g);
                    kinds &= kinds - 1;
                }
                if (k && moves) by_q *= machine->weight[r];
                else by_q *= machine->weight[r] / sphere[i].rho;
                for (int a = 0; a < actuators; a++)
                    scatter(a == machine->actuator[i] ? by_q : fill(0.0),
                            out->by_q + r * actuators + a, rows * actuators, row, count);
            }
        }
    }
}

int CALL(closure)(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                  ptrdiff_t geometry_stride, const double *pose, const double *q, double *residual,
                  double *by_step, double *by_free, double *by_q, double *on_map,
                  double *pose_by_free)
{
    const closure_out out = {residual, by_step, by_free, by_q, on_map, pose_by_free};
    if (!pkm_prepared(machine)) return PKM_BAD_MACHINE;
    switch (machine->map) {
#define CASE(NAME, name, ...)                                                                       \
    case MAP_##NAME:                                                                              \
        closure_map(MAP_##NAME, machine, n, geometry, geometry_stride, pose, q, &out);            \
        break;
        EACH_MAP(CASE)
#undef CASE
    }
    return 0;
}

/* Of each limb at a pose as given: q̃ (NaN out of reach), and the unit vector from its anchor to the
 * platform joint in base and in platform axes. */
int CALL(limbs)(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                ptrdiff_t geometry_stride, const double *pose, double *drive, double *on_base,
                double *on_platform)
{
    if (!pkm_prepared(machine)) return PKM_BAD_MACHINE;
    const int limbs = machine->limbs;
    limb_numbers limb[PKM_MAX_LIMBS];
    EACH_BLOCK(first, n, row, count) {
        real lane_pose[6], R[9], p[3];
        prepare_block(machine, geometry, geometry_stride, first, row, limb);
        gather_row(pose, 6, 6, row, lane_pose);
        FN(pose_frame)(lane_pose, R, p);
        for (int i = 0; i < limbs; i++) {
            real qt, by_q, by_g[SLOTS], square = fill(0.0);
            const real q = limb_inverse(machine, i, &limb[i], R, p, fill(machine->near[i]));
            FN(limb_drive)(q, limb[i].g, &qt);
            sphere_derivatives_called(machine, i, &limb[i], R, p, q, &by_q, by_g);
            for (int k = 0; k < 3; k++) square += by_g[BASE_X + k] * by_g[BASE_X + k];
            const real scale = 1.0 / FN(root)(square); /* ∂Φ/∂base = -d, ∂Φ/∂platform = Rᵀ d */
            scatter(qt, drive + i, limbs, row, count);
            for (int k = 0; k < 3; k++) {
                scatter(-by_g[BASE_X + k] * scale, on_base + 3 * i + k, 3 * limbs, row, count);
                scatter(by_g[PLATFORM_X + k] * scale, on_platform + 3 * i + k, 3 * limbs, row, count);
            }
        }
    }
    return 0;
}

/* The limbs (n, limbs, PKM_SPHERE) at actuator coordinates. */
int CALL(spheres)(const pkm_machine *machine, ptrdiff_t n, const double *geometry, const double *q,
                  double *out)
{
    if (!pkm_prepared(machine)) return PKM_BAD_MACHINE;
    limb_numbers limb[PKM_MAX_LIMBS];
    FN(limb_sphere) sphere[PKM_MAX_LIMBS];
    const int width = machine->limbs * PKM_SPHERE;
    memset(limb, 0, sizeof limb);
    EACH_BLOCK(first, n, row, count) {
        real lane_q[PKM_MAX_LIMBS];
        prepare_block(machine, geometry, 0, first, row, limb);
        gather_row(q, machine->actuators, machine->actuators, row, lane_q);
        const mask reachable = spheres_at(machine, limb, lane_q, sphere);
        for (int i = 0; i < machine->limbs; i++) {
            const FN(limb_sphere) *one = &sphere[i];
            real numbers[PKM_SPHERE];
            memcpy(numbers, one->b, sizeof one->b);
            memcpy(numbers + 3, one->c, sizeof one->c);
            memcpy(numbers + 7, one->axis, sizeof one->axis);
            numbers[6] = select(reachable, one->rho, fill(NAN));
            scatter_row(numbers, PKM_SPHERE, out + i * PKM_SPHERE, width, row, count);
        }
    }
    return 0;
}

#endif
