/* A machine's limbs in lanes: from their numbers and actuator coordinates to spheres. */
#ifndef CLOSURE_H
#define CLOSURE_H

#include "rows.h"

/* The part of a limb that depends on the geometry only: prepared once where rows share it. */
typedef struct {
    real g[SLOTS];
    real first[3], second[3]; /* directions the driver moves the anchor in */
    real axis[AXES][3];
    real per_gain;
} limb_numbers;

/* The rest of the pose maps, which only doubles need. */
INLINE void map_from_pose(int map, const real *pose, real *state)
{
    switch (map) {
#define CASE(NAME, name, ...) case MAP_##NAME: FN(map_##name##_from_pose)(pose, state); break;
    EACH_MAP(CASE)
#undef CASE
    }
}

INLINE void map_to_pose(int map, const real *state, real pose[6])
{
    real R[9];
    FN(map_frame)(map, state, R, pose);
    switch (map) {
#define CASE(NAME, name, ...) case MAP_##NAME: FN(map_##name##_angles)(state, pose + 3); break;
    EACH_MAP(CASE)
#undef CASE
    }
}

INLINE void map_rates(int map, const real *state, const real *delta, real *pose)
{
    switch (map) {
#define CASE(NAME, name, ...) case MAP_##NAME: FN(map_##name##_rates)(state, delta, pose); break;
    EACH_MAP(CASE)
#undef CASE
    }
}

INLINE void map_twist(int map, const real *state, const real *delta, real *twist)
{
    switch (map) {
#define CASE(NAME, name, ...) case MAP_##NAME: FN(map_##name##_twist)(state, delta, twist); break;
    EACH_MAP(CASE)
#undef CASE
    }
}

INLINE void map_free(int map, const real *state, const real *row, real *out)
{
    switch (map) {
#define CASE(NAME, name, ...) case MAP_##NAME: FN(map_##name##_free)(state, row, out); break;
    EACH_MAP(CASE)
#undef CASE
    }
}

INLINE void fill_frame(const double *frame, real F[9])
{
    for (int k = 0; k < 9; k++) F[k] = fill(frame[k]);
}

/* The fixed frame of an axis of limb i. */
INLINE const double *frame_of_axis(const pkm_machine *machine, int i, int axis)
{
    return machine->frame + 9 * (AXES * i + axis);
}

/* What of limb i follows from its numbers alone. */
INLINE void prepare_limb(const pkm_machine *machine, int i, limb_numbers *one)
{
    real F[9];
    one->per_gain = 1.0 / one->g[GAIN];
    switch (machine->driver[i]) {
#define CASE(NAME, name, MOVES, STRETCHES)                                                        \
    case DRIVER_##NAME:                                                                           \
        if (!MOVES) break;                                                                        \
        fill_frame(frame_of_axis(machine, i, 0), F);                                              \
        FN(name##_directions)(one->g, F, one->first, one->second);                                \
        break;
        EACH_DRIVER(CASE)
        NO_OTHER_CASE;
#undef CASE
    }
#define PREPARE(name, K, ROWS)                                                                    \
    if (machine->rows[i] & (ROWS)) {                                                              \
        fill_frame(frame_of_axis(machine, i, K), F);                                              \
        FN(name##_axis)(one->g, F, one->axis[K]);                                                 \
    }
    EACH_AXIS(PREPARE)
#undef PREPARE
}

SHARED void prepare_limbs(const pkm_machine *machine, const double *geometry, ptrdiff_t stride,
                          const ptrdiff_t *row, limb_numbers *limb)
{
    for (int i = 0; i < machine->limbs; i++) {
        limb_numbers *one = &limb[i];
        if (stride)
            gather_row(geometry + i * SLOTS, stride, SLOTS, row, one->g);
        else
            for (int s = 0; s < SLOTS; s++) one->g[s] = fill(geometry[i * SLOTS + s]);
        prepare_limb(machine, i, one);
    }
}

/* The numbers of limbs for the block of rows from `first` on: once where all rows share them. */
INLINE void prepare_block(const pkm_machine *machine, const double *geometry, ptrdiff_t stride,
                          ptrdiff_t first, const ptrdiff_t *row, limb_numbers *limb)
{
    if (first == 0 || stride) prepare_limbs(machine, geometry, stride, row, limb);
}

/* The part of a limb's sphere that depends on the geometry only. */
INLINE void sphere_of_numbers(int driver, const limb_numbers *limb, FN(limb_sphere) *sphere)
{
    const real still = fill(0.0);
    memcpy(sphere->b, limb->g + PLATFORM_X, sizeof sphere->b);
    memcpy(sphere->axis, limb->axis, sizeof sphere->axis);
    switch (driver) {
#define CASE(NAME, name, MOVES, STRETCHES)                                                        \
    case DRIVER_##NAME:                                                                           \
        if (!MOVES) FN(name##_anchor)(still, limb->g, limb->first, limb->second, sphere->c);      \
        if (!STRETCHES) FN(name##_radius)(still, limb->g, &sphere->rho);                          \
        break;
        EACH_DRIVER(CASE)
        NO_OTHER_CASE;
#undef CASE
    }
}

/* The rest of the sphere, at actuator coordinate q. `reachable` falls where a length is not
 * positive, or so large or small that its square or its reciprocal leaves the floats, and where an angle
 * is so large that its sine has lost digits. */
INLINE void sphere_at(int driver, const limb_numbers *limb, real q, FN(limb_sphere) *sphere,
                      mask *reachable)
{
    real qt;
    FN(limb_drive)(q, limb->g, &qt);
    switch (driver) {
#define CASE(NAME, name, MOVES, STRETCHES)                                                        \
    case DRIVER_##NAME:                                                                           \
        if (MOVES) FN(name##_anchor)(qt, limb->g, limb->first, limb->second, sphere->c);          \
        if (STRETCHES) FN(name##_radius)(qt, limb->g, &sphere->rho);                              \
        break;
        EACH_DRIVER(CASE)
        NO_OTHER_CASE;
#undef CASE
    }
    const double most = driver == DRIVER_CRANK ? MAX_ANGLE : 1e30;
    *reachable &= (sphere->rho > fill(1e-30)) & (sphere->rho < fill(1e30)) & (absolute(qt) <= fill(most));
}

/* Does q̃ move the anchor? Does it change the length? */
INLINE int driver_moves(int driver)
{
    switch (driver) {
#define CASE(NAME, name, MOVES, STRETCHES) case DRIVER_##NAME: return MOVES;
        EACH_DRIVER(CASE)
        NO_OTHER_CASE;
#undef CASE
    }
    return 0;
}

INLINE int driver_stretches(int driver)
{
    switch (driver) {
#define CASE(NAME, name, MOVES, STRETCHES) case DRIVER_##NAME: return STRETCHES;
        EACH_DRIVER(CASE)
        NO_OTHER_CASE;
#undef CASE
    }
    return 0;
}

/* Both, for every limb. */
INLINE mask spheres_at(const pkm_machine *machine, const limb_numbers *limb, const real *q,
                       FN(limb_sphere) *sphere)
{
    mask reachable = fill_mask(-1);
    for (int i = 0; i < machine->limbs; i++) {
        sphere_of_numbers(machine->driver[i], &limb[i], &sphere[i]);
        sphere_at(machine->driver[i], &limb[i], q[machine->actuator[i]], &sphere[i], &reachable);
    }
    return reachable;
}

/* The scaled system of any map. */
#define SCALED_ROWS(NAME, name, ...)                                                                \
    SHARED int scaled_##name(const pkm_machine *machine, const FN(limb_sphere) *limb,             \
                             const real *state, real *residual, real *jacobian)                   \
    {                                                                                             \
        return FN(closure_rows)(MAP_##NAME, SCALED, machine, limb, state, residual, jacobian);    \
    }
EACH_MAP(SCALED_ROWS)
#undef SCALED_ROWS

INLINE int scaled_rows(int map, const pkm_machine *machine, const FN(limb_sphere) *limb,
                       const real *state, real *residual, real *jacobian)
{
    switch (map) {
#define CASE(NAME, name, ...)                                                                       \
    case MAP_##NAME: return scaled_##name(machine, limb, state, residual, jacobian);
    EACH_MAP(CASE)
#undef CASE
    }
    return 0;
}

/* Square systems as they are; more rows than m become the normal equations of least squares. */
INLINE void normal_matrix(int m, int rows, const real *jacobian, real *A)
{
    if (rows == m) {
        memcpy(A, jacobian, sizeof(real) * m * m);
        return;
    }
    for (int i = 0; i < m; i++)
        for (int j = 0; j < m; j++) {
            real sum = fill(0.0);
            for (int r = 0; r < rows; r++) sum += jacobian[r * m + i] * jacobian[r * m + j];
            A[i * m + j] = sum;
        }
}

/* Their right-hand side b (m) for a residual. */
INLINE void normal_side(int m, int rows, const real *jacobian, const real *residual, real *b)
{
    if (rows == m) {
        memcpy(b, residual, sizeof(real) * m);
        return;
    }
    for (int i = 0; i < m; i++) {
        b[i] = fill(0.0);
        for (int r = 0; r < rows; r++) b[i] += jacobian[r * m + i] * residual[r];
    }
}

/* Their right-hand sides B (m x rows) for each row's own, so that X is the (pseudo-)inverse. */
INLINE void normal_sides(int m, int rows, const real *jacobian, real *B)
{
    for (int i = 0; i < m; i++)
        for (int r = 0; r < rows; r++)
            B[i * rows + r] = rows == m ? fill(i == r ? 1.0 : 0.0) : jacobian[r * m + i];
}

#endif
