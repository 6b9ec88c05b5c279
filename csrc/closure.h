/* A machine in lanes: its pose map, its limbs' anchors, and the closure rows at a state. */
#ifndef CLOSURE_H
#define CLOSURE_H

#include "lanes.h"
#include "names.h"
#include "pkmcal.h"
#include "trigonometry.h"
#include "limbs.h"
#include "posemaps.h"

/* What of a limb depends on its numbers alone: prepared once where rows share the geometry. */
typedef struct {
    real g[SLOTS];
    real first[3], second[3]; /* directions a slider or crank moves the anchor in */
    real base_axis[3], platform_axis[3];
    real frame[9], platform_frame[9];
} limb_numbers;

/* A limb at a known actuator coordinate: a sphere around its anchor. */
typedef struct {
    real c[3], rho2, inverse_rho;
} limb_anchor;

/* pose maps by number; `map` is a constant wherever these are inlined -------------------------- */

INLINE int map_m(int map)
{
    switch (map) {
#define CASE(NAME, name, M) case MAP_##NAME: return M;
    EACH_MAP(CASE)
#undef CASE
    }
    return 0;
}

#define DEFINE_MAP_FUNCTION(name, parameters)                                                     \
    INLINE void map_##name parameters                                                             \
    {                                                                                             \
        switch (map) {                                                                            \
            EACH_MAP(MAP_CASE_##name)                                                             \
        }                                                                                         \
    }
#define MAP_CASE_from_pose(N, n, M) case MAP_##N: FN(map_##n##_from_pose)(pose, state); break;
#define MAP_CASE_frame(N, n, M) case MAP_##N: FN(map_##n##_frame)(state, R, p); break;
#define MAP_CASE_retract(N, n, M) case MAP_##N: FN(map_##n##_retract)(state, delta, moved); break;
#define MAP_CASE_angles(N, n, M) case MAP_##N: FN(map_##n##_angles)(state, sine, cosine); break;
#define MAP_CASE_pull(N, n, M) case MAP_##N: FN(map_##n##_pull)(state, omega, v, row); break;
#define MAP_CASE_rates(N, n, M) case MAP_##N: FN(map_##n##_rates)(state, delta, pose); break;
#define MAP_CASE_free(N, n, M) case MAP_##N: FN(map_##n##_free)(state, row, out); break;
DEFINE_MAP_FUNCTION(from_pose, (int map, const real *pose, real *state))
DEFINE_MAP_FUNCTION(frame, (int map, const real *state, real *R, real *p))
DEFINE_MAP_FUNCTION(retract, (int map, const real *state, const real *delta, real *moved))
DEFINE_MAP_FUNCTION(angles, (int map, const real *state, real *sine, real *cosine))
DEFINE_MAP_FUNCTION(pull, (int map, const real *state, const real *omega, const real *v, real *row))
DEFINE_MAP_FUNCTION(rates, (int map, const real *state, const real *delta, real *pose))
DEFINE_MAP_FUNCTION(free, (int map, const real *state, const real *row, real *out))

/* Is free coordinate i an angle? Its unit is then 1 rad = `length` mm in scaled systems. */
INLINE int map_is_angle(int map, int i)
{
    return i >= (map == MAP_2TPR2TPS || map == MAP_PLANAR ? 2 : 3);
}

INLINE void map_to_pose(int map, const real *state, real pose[6])
{
    real R[9], sine[3], cosine[3];
    map_frame(map, state, R, pose);
    map_angles(map, state, sine, cosine);
    for (int i = 0; i < 3; i++) pose[3 + i] = arctangent2(sine[i], cosine[i]);
}

/* limbs --------------------------------------------------------------------------------------- */

INLINE void prepare_limbs(const pkm_machine *machine, const double *geometry, ptrdiff_t stride,
                          ptrdiff_t rows, limb_numbers *limb)
{
    for (int i = 0; i < machine->limbs; i++) {
        limb_numbers *one = &limb[i];
        for (int s = 0; s < SLOTS; s++) one->g[s] = gather(geometry + i * SLOTS + s, stride, rows);
        for (int k = 0; k < 9; k++) {
            one->frame[k] = FN(fill)(machine->frame[9 * i + k]);
            one->platform_frame[k] = FN(fill)(machine->platform_frame[9 * i + k]);
        }
        if (machine->driver[i] == DRIVER_SLIDER)
            FN(slider_directions)(one->g, one->frame, one->first, one->second);
        if (machine->driver[i] == DRIVER_CRANK)
            FN(crank_directions)(one->g, one->frame, one->first, one->second);
        if (machine->rows[i] & (ROW_BASE_PLANE | ROW_COUPLE))
            FN(base_axis)(one->g, one->frame, one->base_axis);
        if (machine->rows[i] & (ROW_PLATFORM_PLANE | ROW_COUPLE))
            FN(platform_axis)(one->g, one->platform_frame, one->platform_axis);
    }
}

/* The limb's sphere at actuator coordinate q; `reachable` falls where its length is not positive. */
INLINE void anchor_limb(int driver, const limb_numbers *limb, real q, limb_anchor *anchor,
                        mask *reachable)
{
    real qt, rho = limb->g[ROD];
    FN(limb_drive)(q, limb->g, &qt);
    if (driver == DRIVER_LENGTH) {
        rho = qt;
        memcpy(anchor->c, limb->g + BASE_X, sizeof anchor->c);
    } else if (driver == DRIVER_SLIDER) {
        FN(slider_anchor)(qt, limb->g + BASE_X, limb->first, anchor->c);
    } else {
        FN(crank_anchor)(qt, limb->g + BASE_X, limb->first, limb->second, anchor->c);
    }
    *reachable &= rho > FN(fill)(0.0);
    anchor->rho2 = rho * rho;
    anchor->inverse_rho = 1.0 / rho;
}

/* One row of the system: Φ times `scale` in mm, and its derivatives by the map's scaled step. */
INLINE void store_row(int map, double length, const real *state, real phi, const real *omega,
                      const real *v, real scale, real *residual, real *row)
{
    real covector[6];
    const real angular = scale * (1.0 / length);
    map_pull(map, state, omega, v, covector);
    *residual = phi * scale;
    for (int j = 0; j < map_m(map); j++) row[j] = covector[j] * (map_is_angle(map, j) ? angular : scale);
}

/* All rows at a state, weighted: the residual [mm], and its derivatives by the map's step, in
 * which an angle counts as its arc at the machine's characteristic length. */
INLINE int closure_rows(int map, const pkm_machine *machine, const limb_numbers *limb,
                        const limb_anchor *anchor, const real *state, real *residual, real *jacobian)
{
    const int m = map_m(map);
    real R[9], p[3], phi, omega[3], v[3];
    int r = 0;
    map_frame(map, state, R, p);
    for (int i = 0; i < machine->limbs; i++) {
        const real *b = limb[i].g + PLATFORM_X, *c = anchor[i].c;
        FN(sphere_row)(R, p, b, c, anchor[i].rho2, &phi, omega, v);
        store_row(map, machine->length, state, phi, omega, v,
                  anchor[i].inverse_rho * machine->weight[r], &residual[r], &jacobian[r * m]);
        r++;
        for (int kind = ROW_BASE_PLANE; kind <= ROW_COUPLE; kind *= 2) {
            if (!(machine->rows[i] & kind)) continue;
            if (kind == ROW_BASE_PLANE)
                FN(base_plane_row)(R, p, b, c, limb[i].base_axis, &phi, omega, v);
            else if (kind == ROW_PLATFORM_PLANE)
                FN(platform_plane_row)(R, p, b, c, limb[i].platform_axis, &phi, omega, v);
            else
                FN(couple_row)(R, p, b, c, limb[i].base_axis, limb[i].platform_axis,
                               FN(fill)(machine->lever[i]), &phi, omega, v);
            store_row(map, machine->length, state, phi, omega, v, FN(fill)(machine->weight[r]),
                      &residual[r], &jacobian[r * m]);
            r++;
        }
    }
    return r;
}

/* Square systems as they are; more rows than m become the normal equations of least squares.
 * B (m x k) holds the right-hand sides on return: k = 1 with the residual, else k = rows with the
 * identity, so that X is the (pseudo-)inverse. */
INLINE void normal_system(int m, int rows, int k, const real *jacobian, const real *residual, real *A,
                          real *B)
{
    if (rows == m) {
        memcpy(A, jacobian, sizeof(real) * m * m);
        if (k == 1) memcpy(B, residual, sizeof(real) * m);
        else
            for (int i = 0; i < m * m; i++) B[i] = FN(fill)(i % (m + 1) ? 0.0 : 1.0);
        return;
    }
    for (int i = 0; i < m; i++) {
        for (int j = 0; j < m; j++) {
            real sum = FN(fill)(0.0);
            for (int r = 0; r < rows; r++) sum += jacobian[r * m + i] * jacobian[r * m + j];
            A[i * m + j] = sum;
        }
        if (k == 1) {
            B[i] = FN(fill)(0.0);
            for (int r = 0; r < rows; r++) B[i] += jacobian[r * m + i] * residual[r];
        } else {
            for (int r = 0; r < rows; r++) B[i * k + r] = jacobian[r * m + i];
        }
    }
}

#endif
