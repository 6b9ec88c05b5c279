/* Machines whose limbs are chains of joints, for a page: see view.h. */
#include "view.h"
#include "inspect.h"
#include "frames.h"
#include "chain_response.h"

#define machine ((const pkm_chains *)room)

/* pkm_chains with offsets from `room` in place of its pointers; the arrays, and its geometry. */
static const double *geometry;

enum { FRAMES = 12 * (PKM_MAX_LIMBS * (PKM_MAX_CHAIN + 1)) };
static double pose[6], q[PKM_MAX_LIMBS], found[6], residual[1];
static double passive[PKM_MAX_JOINTS], frames[FRAMES];
static double phi[PKM_MAX_CHAIN_ROWS], by_step[PKM_MAX_CHAIN_ROWS * MAX_CHAIN_UNKNOWNS];
static double by_free[6 * PKM_MAX_CHAIN_ROWS], by_q[PKM_MAX_CHAIN_ROWS * PKM_MAX_LIMBS];
static double on_map[6], pose_by_free[36];
static double a[6], b[6];
static int32_t status, iterations;

EXPORT double *at(int which)
{
    double *const arrays[] = {pose, q, found, residual, phi, by_step, by_free, by_q, on_map,
                              pose_by_free, a, b, passive, frames};
    return arrays[which];
}

/* `numbers` is where in `room` the geometry is. */
EXPORT int begin(int bytes, int numbers)
{
    pkm_chains *mine = (pkm_chains *)room;
    if (bytes < (int)sizeof *mine || bytes > ROOM) return 0;
#define PLACE(field) mine->field = (const void *)(room + (size_t)mine->field)
    PLACE(first), PLACE(member), PLACE(ball), PLACE(end_place), PLACE(ball_place), PLACE(end);
    PLACE(prismatic), PLACE(actuator), PLACE(coordinate), PLACE(place), PLACE(axes), PLACE(point);
    PLACE(soft), PLACE(drive_place), PLACE(zero);
#undef PLACE
    geometry = (const double *)(room + numbers);
    return pkm_chain_count(machine);
}

/* pose -> q, each angle at whatever turn it comes */
EXPORT int inverse(void) { return CALL(chain_inverse)(machine, 1, geometry, 0, pose, q); }

/* q, pose as the guess -> found, residual */
EXPORT int forward(void)
{
    CALL(chain_forward)(machine, 1, geometry, 0, q, pose, 0, found, &status, &iterations, residual);
    return status;
}

/* pose, q -> phi, by_step, by_free, by_q, on_map, pose_by_free */
EXPORT int closure(void)
{
    return CALL(chain_closure)(machine, 1, geometry, 0, pose, q, phi, by_step, by_free, by_q, on_map,
                               pose_by_free);
}

/* pose, q -> passive, frames */
EXPORT int places(void)
{
    return CALL(chain_frames)(machine, 1, geometry, 0, pose, q, passive, frames);
}

/* a, b -> found: A followed by B */
EXPORT int compose(void)
{
    real one[6], other[6], both[6];
    gather_row(a, 6, 6, first_row, one);
    gather_row(b, 6, 6, first_row, other);
    FN(pose_compose)(one, other, both);
    scatter_row(both, 6, found, 6, first_row, 1);
    return 0;
}
