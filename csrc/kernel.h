/* What runs in either precision: lane arithmetic, the generated formulas, the closure rows of a
 * machine, and elimination in a fixed order. Included by lanes.h for `narrow` and for `wide`, and by
 * paths.c for complex numbers. */

#ifndef UNROLL
#define UNROLL _Pragma("GCC unroll 6") /* the loops of elimination: registers hold its rows then */
#endif
/* Ends a switch over the drivers or rows of a machine: `pkm_closure_count` refuses others, so what
 * every case sets is set. */
#define NO_OTHER_CASE default: __builtin_unreachable()

INLINE real FN(fill)(NUMBER x) { return (real){0} + x; }

#ifndef COMPLEX
INLINE real FN(absolute)(real x)
{
    const mask sign = (mask)(-FN(fill)(0));
    return (real)((mask)x & ~sign);
}
#endif

#ifndef NARROW
#include "trigonometry.h"
#endif
#include "limbs.h"
#include "posemaps.h"

/* A limb at a known actuator coordinate: a sphere around its anchor, and the axes of its
 * constraint rows. */
typedef struct {
    real b[3], c[3], rho;
    real axis[AXES][3];
} FN(limb_sphere);

#ifdef NARROW
INLINE int map_m(int map)
{
    switch (map) {
#define CASE(NAME, name, M, ...) case MAP_##NAME: return M;
    EACH_MAP(CASE)
#undef CASE
    }
    return 0;
}

/* Is free coordinate i an angle? Its unit is then 1 rad = `length` mm in scaled systems. */
INLINE int map_is_angle(int map, int i)
{
    switch (map) {
#define CASE(NAME, name, M, LENGTHS) case MAP_##NAME: return i >= LENGTHS;
    EACH_MAP(CASE)
#undef CASE
    }
    return 0;
}
#endif

/* Pose maps by number; `map` is a constant wherever these are inlined. */
INLINE void FN(map_frame)(int map, const real *state, real *R, real *p)
{
    switch (map) {
#define CASE(NAME, name, ...) case MAP_##NAME: FN(map_##name##_frame)(state, R, p); break;
    EACH_MAP(CASE)
#undef CASE
    }
}

INLINE void FN(map_retract)(int map, const real *state, const real *delta, real *moved)
{
    switch (map) {
#define CASE(NAME, name, ...) case MAP_##NAME: FN(map_##name##_retract)(state, delta, moved); break;
    EACH_MAP(CASE)
#undef CASE
    }
}

/* The state a state stands for that rounding moved off its manifold. */
INLINE void FN(map_tidy)(int map, const real *state, real *tidy)
{
    switch (map) {
#define CASE(NAME, name, ...) case MAP_##NAME: FN(map_##name##_tidy)(state, tidy); break;
    EACH_MAP(CASE)
#undef CASE
    }
}

INLINE void FN(map_velocity)(int map, const real *state, const real *delta, real *rate)
{
    switch (map) {
#define CASE(NAME, name, ...) case MAP_##NAME: FN(map_##name##_velocity)(state, delta, rate); break;
    EACH_MAP(CASE)
#undef CASE
    }
}

INLINE void FN(map_pull)(int map, const real *state, const real *omega, const real *v, real *row)
{
    switch (map) {
#define CASE(NAME, name, ...) case MAP_##NAME: FN(map_##name##_pull)(state, omega, v, row); break;
    EACH_MAP(CASE)
#undef CASE
    }
}

/* One row of the system: Φ and its derivatives by the map's step, lengths times `scale` and angles
 * times `angular`; as they are where `scaled` is 0. */
INLINE void FN(store_row)(int map, int scaled, const real *state, real phi, const real *omega,
                          const real *v, real scale, real angular, real *residual, real *row)
{
    real covector[6];
    *residual = scaled ? phi * scale : phi;
    if (!row) return;
    FN(map_pull)(map, state, omega, v, covector);
    for (int j = 0; j < map_m(map); j++)
        row[j] = scaled ? covector[j] * (map_is_angle(map, j) ? angular : scale) : covector[j];
}

/* A row beside the sphere, with its axes on base and platform. */
INLINE void FN(constraint_row)(int kind, const real *R, const real *p, const real *b, const real *c,
                               const real (*axis)[3], NUMBER lever, real *phi, real *omega, real *v)
{
    switch (kind) {
#define CASE(NAME, name, N, A)                                                                    \
    case ROW_##NAME:                                                                              \
        FN(name##_row)(R, p, b, c, axis[N], axis[A], FN(fill)(lever), phi, omega, v);             \
        break;
    EACH_ROW(CASE)
    NO_OTHER_CASE;
#undef CASE
    }
}

/* All rows at a state in the machine's order of elimination. In a SCALED system Φ is in mm, weighted,
 * and an angle counts as its arc at the characteristic length. In a PLAIN one the sphere row stays
 * as derived, in mm², which saves the multiplications, and a constraint is brought to that size.
 * Without the derivatives where `jacobian` is NULL. Returns how many rows there are. */
INLINE int FN(closure_rows)(int map, int scaling, const pkm_machine *machine,
                            const FN(limb_sphere) *limb, const real *state, real *residual,
                            real *jacobian)
{
    const int m = map_m(map);
    const NUMBER inverse_length = (NUMBER)(scaling == SCALED ? 1.0 / machine->length : 1.0);
    real R[9], p[3], phi, omega[3], v[3];
    int r = 0;
    FN(map_frame)(map, state, R, p);
    for (int i = 0; i < machine->limbs; i++) {
        const FN(limb_sphere) *one = &limb[i];
        FN(sphere_row)(R, p, one->b, one->c, one->rho * one->rho, &phi, omega, v);
        /* Φ is mm² */
        const real scale = (NUMBER)machine->weight[r] / one->rho;
        FN(store_row)(map, scaling == SCALED, state, phi, omega, v, scale, scale * inverse_length,
                      &residual[machine->order[r]],
                      jacobian ? &jacobian[machine->order[r] * m] : NULL);
        r++;
        if (!machine->rows[i]) continue;
        for (int kind = 1; kind <= ALL_ROWS; kind *= 2) {
            if (!(machine->rows[i] & kind)) continue;
            FN(constraint_row)(kind, R, p, one->b, one->c, one->axis, (NUMBER)machine->lever[i],
                               &phi, omega, v);
            const real factor =
                FN(fill)((NUMBER)(scaling == SCALED ? machine->weight[r] : machine->size));
            FN(store_row)(map, 1, state, phi, omega, v, factor, factor * inverse_length,
                          &residual[machine->order[r]],
                          jacobian ? &jacobian[machine->order[r] * m] : NULL);
            r++;
        }
    }
    return r;
}

/* LU of `count` matrices A (m x m, row by row) in place and in the order given; the diagonals hold
 * reciprocals. Row by row, which stay in registers; side by side, for the steps of one matrix
 * depend on each other and those of two do not. */
INLINE void FN(factor)(int m, int count, real (*A)[36])
{
    UNROLL for (int i = 0; i < m; i++)
        UNROLL for (int t = 0; t < count; t++) {
            real row[6];
            UNROLL for (int j = 0; j < m; j++) row[j] = A[t][i * m + j];
            UNROLL for (int k = 0; k < i; k++) {
                row[k] *= A[t][k * m + k];
                UNROLL for (int j = k + 1; j < m; j++) row[j] -= row[k] * A[t][k * m + j];
            }
            row[i] = 1.0f / row[i];
            UNROLL for (int j = 0; j < m; j++) A[t][i * m + j] = row[j];
        }
}

/* Solve with those factors, in place. */
INLINE void FN(substitute)(int m, int count, real (*A)[36], real (*b)[PKM_MAX_ROWS])
{
    for (int t = 0; t < count; t++) {
        real x[6];
        UNROLL for (int i = 0; i < m; i++) {
            x[i] = b[t][i];
            UNROLL for (int j = 0; j < i; j++) x[i] -= A[t][i * m + j] * x[j];
        }
        UNROLL for (int i = m - 1; i >= 0; i--) {
            UNROLL for (int j = i + 1; j < m; j++) x[i] -= A[t][i * m + j] * x[j];
            x[i] *= A[t][i * m + i];
        }
        UNROLL for (int i = 0; i < m; i++) b[t][i] = x[i];
    }
}
