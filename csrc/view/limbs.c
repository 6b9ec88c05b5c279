/* Machines of limbs in closed form, for a page: see view.h. */
#include "view.h"
#include "forward.h"
#include "inspect.h"
#include "frames.h"

#define machine ((const pkm_machine *)room)

/* pkm_machine, then its geometry (limbs, SLOTS). */
static const double *geometry = (const double *)(room + sizeof(pkm_machine));
_Static_assert(sizeof(pkm_machine) + PKM_MAX_LIMBS * SLOTS * sizeof(double) <= ROOM, "room");

static double pose[6], q[PKM_MAX_LIMBS], found[6], residual[1];
static double drive[PKM_MAX_LIMBS], on_base[3 * PKM_MAX_LIMBS], on_platform[3 * PKM_MAX_LIMBS];
static double sphere[PKM_MAX_LIMBS * PKM_SPHERE];
static double phi[PKM_MAX_ROWS], by_step[6 * PKM_MAX_ROWS], by_free[6 * PKM_MAX_ROWS];
static double by_q[PKM_MAX_ROWS * PKM_MAX_LIMBS], on_map[6], pose_by_free[36];
static double a[6], b[6];
static int32_t status, iterations;

EXPORT double *at(int which)
{
    double *const arrays[] = {pose, q, found, residual, phi, by_step, by_free, by_q, on_map,
                              pose_by_free, a, b, drive, on_base, on_platform, sphere};
    return arrays[which];
}

EXPORT int begin(int bytes)
{
    if (bytes != (int)(sizeof(pkm_machine) + sizeof(double) * SLOTS * (size_t)machine->limbs)) return 0;
    return pkm_prepared(machine);
}

/* pose -> q */
EXPORT int inverse(void) { return CALL(inverse)(machine, 1, geometry, 0, pose, NULL, 0, q); }

/* q, pose as the guess -> found, residual; by safeguarded Newton alone, which is the smaller code */
EXPORT int forward(void)
{
    const forward_call call = {machine, 1, geometry, 0, q, 0, pose, 0, found, &status, &iterations, residual};
    limb_numbers limb[PKM_MAX_LIMBS];
    prepare_limbs(machine, geometry, 0, first_row, limb);
    newton_rows(machine->map, &call, limb, first_row, 1);
    return status;
}

/* pose, q -> phi, by_step, by_free, by_q, on_map, pose_by_free */
EXPORT int closure(void)
{
    const closure_out out = {phi, by_step, by_free, by_q, on_map, pose_by_free};
    closure_map(machine->map, machine, 1, geometry, 0, pose, q, &out);
    return 0;
}

/* pose, q -> drive, on_base, on_platform, sphere */
EXPORT int places(void)
{
    CALL(spheres)(machine, 1, geometry, q, sphere);
    return CALL(limbs)(machine, 1, geometry, 0, pose, drive, on_base, on_platform);
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
