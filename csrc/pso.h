/* A particle swarm (eq. 19 of the 2TPR&2TPS paper) with a particle in each lane, and what it
 * minimises: eq. 18, and the limb residual of measured poses.
 *
 * Every particle draws from a generator of its own, and the best of the swarm is the lowest value,
 * of equals the first particle: results do not depend on the width of the lanes.
 */
#ifndef PSO_H
#define PSO_H

#include "closure.h"
#include "random.h"

/* splitmix64: seeds for the generators. */
INLINE uint64_t split(uint64_t *counter)
{
    uint64_t z = *counter += UINT64_C(0x9e3779b97f4a7c15);
    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    return z ^ (z >> 31);
}

/* Where the parts of a swarm's state are: see pkm_swarm. */
typedef struct {
    ptrdiff_t width; /* particles, rounded up to whole lanes of any ISA */
    double *x, *v, *best, *best_value, *random, *values, *global_best, *global_value;
} swarm_parts;

INLINE swarm_parts parts_of(const pkm_swarm *swarm, double *state)
{
    swarm_parts part;
    const ptrdiff_t width = (swarm->particles + 7) / 8 * 8, block = swarm->dims * width;
    part.width = width;
    part.x = state;
    part.v = part.x + block;
    part.best = part.v + block;
    part.best_value = part.best + block;
    part.random = part.best_value + width;
    part.values = part.random + 4 * width;
    part.global_best = part.values + width;
    part.global_value = part.global_best + swarm->dims;
    return part;
}

INLINE generator load_rng(const double *random, ptrdiff_t width)
{
    generator g;
    for (int k = 0; k < 4; k++) memcpy(&g.s[k], random + k * width, sizeof g.s[k]);
    return g;
}

INLINE void store_rng(const generator *g, double *random, ptrdiff_t width)
{
    for (int k = 0; k < 4; k++) memcpy(random + k * width, &g->s[k], sizeof g->s[k]);
}

/* Particles anywhere within the bounds, at rest. `stream` distinguishes swarms of one seed. */
SHARED void start_swarm(const pkm_swarm *swarm, uint64_t seed, uint64_t stream,
                        const double *lower, const double *upper, double *state)
{
    const swarm_parts part = parts_of(swarm, state);
    uint64_t counter = split(&seed) ^ stream;
    counter = split(&counter);
    for (ptrdiff_t i = 0; i < part.width; i++)
        for (int k = 0; k < 4; k++) {
            const uint64_t word = split(&counter);
            memcpy(part.random + k * part.width + i, &word, sizeof word);
        }
    for (ptrdiff_t i = 0; i < part.width; i += LANES) {
        generator g = load_rng(part.random + i, part.width);
        for (int d = 0; d < swarm->dims; d++) {
            const ptrdiff_t at = d * part.width + i;
            const real x = lower[d] + (upper[d] - lower[d]) * draw(&g);
            store(x, part.x + at);
            store(x, part.best + at);
            store(fill(0.0), part.v + at);
        }
        store(fill(INFINITY), part.best_value + i);
        store(fill(INFINITY), part.values + i);
        store_rng(&g, part.random + i, part.width);
    }
    for (int d = 0; d < swarm->dims; d++) part.global_best[d] = part.x[d * part.width];
    *part.global_value = INFINITY;
}

/* pBest and gBest after the particles' `values` are known; NaN is never the best. */
SHARED void update_best(const pkm_swarm *swarm, double *state)
{
    const swarm_parts part = parts_of(swarm, state);
    mask found = fill_mask(0);
    for (ptrdiff_t i = 0; i < part.width; i += LANES) {
        const real value = load(part.values + i), best = load(part.best_value + i);
        const mask better = value < best;
        found |= value < fill(*part.global_value);
        store(select(better, value, best), part.best_value + i);
        for (int d = 0; d < swarm->dims; d++) {
            double *kept = part.best + d * part.width + i;
            store(select(better, load(part.x + d * part.width + i), load(kept)), kept);
        }
    }
    if (!any(found)) return;
    for (int i = 0; i < swarm->particles; i++)
        if (part.values[i] < *part.global_value) {
            *part.global_value = part.values[i];
            for (int d = 0; d < swarm->dims; d++) part.global_best[d] = part.x[d * part.width + i];
        }
}

/* Eq. 19. A particle that would leave stops at the bound: it loses that component of its velocity. */
SHARED void move_swarm(const pkm_swarm *swarm, const double *lower, const double *upper,
                       double *state)
{
    const swarm_parts part = parts_of(swarm, state);
    for (ptrdiff_t i = 0; i < part.width; i += LANES) {
        generator g = load_rng(part.random + i, part.width);
        for (int d = 0; d < swarm->dims; d++) {
            const ptrdiff_t at = d * part.width + i;
            const real x = load(part.x + at), rand1 = draw(&g), rand2 = draw(&g);
            const real v = swarm->inertia * load(part.v + at)
                           + swarm->cognitive * rand1 * (load(part.best + at) - x)
                           + swarm->social * rand2 * (part.global_best[d] - x);
            const real moved = x + v;
            const mask below = moved < fill(lower[d]), above = moved > fill(upper[d]);
            store(select(below, fill(lower[d]), select(above, fill(upper[d]), moved)), part.x + at);
            store(select(below | above, fill(0.0), v), part.v + at);
        }
        store_rng(&g, part.random + i, part.width);
    }
}

/* Eq. 18 for n sets of `rows` poses with one correction each, by a swarm each. `off` holds L* - L;
 * E is the root mean square over the poses of ‖L* - L - ΔL‖. */
int CALL(swarm_eq18)(const pkm_swarm *swarm, int iterations, uint64_t seed, ptrdiff_t start,
                     ptrdiff_t n, ptrdiff_t rows, const double *off, const double *lower,
                     const double *upper, double *state, double *correction, double *history)
{
    if (!pkm_swarm_size(swarm) || iterations < 0 || rows < 1) return PKM_BAD_SWARM;
    const int dims = swarm->dims;
    const swarm_parts part = parts_of(swarm, state);
    for (ptrdiff_t s = 0; s < n; s++) {
        const double *aim = off + s * rows * dims;
        start_swarm(swarm, seed, (uint64_t)(start + s), lower, upper, state);
        for (int k = 0; k <= iterations; k++) {
            if (k) move_swarm(swarm, lower, upper, state);
            for (ptrdiff_t i = 0; i < part.width; i += LANES) {
                real sum = fill(0.0);
                for (ptrdiff_t r = 0; r < rows; r++)
                    for (int d = 0; d < dims; d++) {
                        const real left = aim[r * dims + d] - load(part.x + d * part.width + i);
                        sum += left * left;
                    }
                store(FN(root)(sum / (double)rows), part.values + i);
            }
            update_best(swarm, state);
            history[s * (iterations + 1) + k] = *part.global_value;
        }
        memcpy(correction + s * dims, part.global_best, sizeof(double) * dims);
    }
    return 0;
}

int CALL(swarm_start)(const pkm_swarm *swarm, uint64_t seed, const double *lower,
                      const double *upper, double *state)
{
    if (!pkm_swarm_size(swarm)) return PKM_BAD_SWARM;
    start_swarm(swarm, seed, 0, lower, upper, state);
    return 0;
}

int CALL(swarm_update_best)(const pkm_swarm *swarm, double *state)
{
    if (!pkm_swarm_size(swarm)) return PKM_BAD_SWARM;
    update_best(swarm, state);
    return 0;
}

int CALL(swarm_move)(const pkm_swarm *swarm, const double *lower, const double *upper,
                     double *state)
{
    if (!pkm_swarm_size(swarm)) return PKM_BAD_SWARM;
    move_swarm(swarm, lower, upper, state);
    return 0;
}

/* A machine at one pose and its actuator coordinates: the same for every particle. */
typedef struct { double R[9], p[3], q[PKM_MAX_LIMBS]; } posture;

enum { POSTURES = 64 }; /* at a time */

INLINE void postures_at(ptrdiff_t n, int actuators, const double *pose, const double *q,
                        posture *out)
{
    EACH_BLOCK(first, n, row, count) {
        real lane_pose[6], R[9], p[3];
        gather_row(pose, 6, 6, row, lane_pose);
        FN(pose_frame)(lane_pose, R, p);
        for (int l = 0; l < count; l++) {
            posture *one = &out[first + l];
            for (int k = 0; k < 9; k++) one->R[k] = R[k][l];
            for (int k = 0; k < 3; k++) one->p[k] = p[k][l];
            memcpy(one->q, q + actuators * (first + l), sizeof(double) * actuators);
        }
    }
}

INLINE void fill_posture(const posture *at, real R[9], real p[3])
{
    for (int k = 0; k < 9; k++) R[k] = spread(at->R[k]);
    for (int k = 0; k < 3; k++) p[k] = spread(at->p[k]);
}

/* The anchor of a limb whose `driver` is a constant, and its length. */
INLINE void anchor_at(int driver, const limb_numbers *one, double q, real c[3], real *rho)
{
    real qt;
    FN(limb_drive)(spread(q), one->g, &qt);
    switch (driver) {
#define CASE(NAME, name, ...)                                                                     \
    case DRIVER_##NAME:                                                                           \
        FN(name##_anchor)(qt, one->g, one->first, one->second, c);                                \
        FN(name##_radius)(qt, one->g, rho);                                                       \
        break;
        EACH_DRIVER(CASE)
        NO_OTHER_CASE;
#undef CASE
    }
}

/* Squares of a limb's sphere closures over the poses, summed [mm²]. */
INLINE real squared_spheres(int driver, const limb_numbers *limb, int actuator, double weight,
                            ptrdiff_t n, const posture *at)
{
    const limb_numbers one = *limb;
    real sum = fill(0.0);
    for (ptrdiff_t k = 0; k < n; k++) {
        real R[9], p[3], c[3], h[3], rho;
        fill_posture(&at[k], R, p);
        anchor_at(driver, &one, at[k].q[actuator], c, &rho);
        FN(limb_joint)(R, p, one.g + PLATFORM_X, c, h);
        const real off = weight * (FN(root)(h[0] * h[0] + h[1] * h[1] + h[2] * h[2]) - rho);
        sum += off * off;
    }
    return sum;
}

/* The same of one of its constraints. */
INLINE real squared_constraint(int driver, int kind, const limb_numbers *one, int actuator,
                               double lever, double weight, ptrdiff_t n, const posture *at)
{
    real sum = fill(0.0);
    for (ptrdiff_t k = 0; k < n; k++) {
        real R[9], p[3], c[3], rho, phi, omega[3], v[3];
        fill_posture(&at[k], R, p);
        anchor_at(driver, one, at[k].q[actuator], c, &rho);
        FN(constraint_row)(kind, R, p, one->g + PLATFORM_X, c, one->axis, lever, &phi, omega, v);
        phi *= weight;
        sum += phi * phi;
    }
    return sum;
}

#define SQUARED(NAME, name, ...)                                                                  \
    SHARED real add_squared_##name(const pkm_machine *machine, int i, int r,                      \
                                   const limb_numbers *limb, ptrdiff_t n, const posture *at,      \
                                   real sum)                                                      \
    {                                                                                             \
        const int a = machine->actuator[i];                                                       \
        sum += squared_spheres(DRIVER_##NAME, limb, a, machine->weight[r++], n, at);              \
        for (int kind = 1; kind <= ALL_ROWS; kind *= 2)                                           \
            if (machine->rows[i] & kind)                                                          \
                sum += squared_constraint(DRIVER_##NAME, kind, limb, a, machine->lever[i],        \
                                          machine->weight[r++], n, at);                           \
        return sum;                                                                               \
    }
EACH_DRIVER(SQUARED)
#undef SQUARED

INLINE real squared_closures(const pkm_machine *machine, const limb_numbers *limb, ptrdiff_t n,
                             const posture *at)
{
    real sum = fill(0.0);
    for (int i = 0, r = 0; i < machine->limbs; i++) {
        switch (machine->driver[i]) {
#define CASE(NAME, name, ...)                                                                     \
        case DRIVER_##NAME: sum = add_squared_##name(machine, i, r, &limb[i], n, at, sum); break;
            EACH_DRIVER(CASE)
            NO_OTHER_CASE;
#undef CASE
        }
        r += 1 + __builtin_popcount((unsigned)machine->rows[i]);
    }
    return sum;
}

/* Of each geometry (a particle) the sum over poses of the squared closures [mm²]. What depends on
 * the pose alone is computed once for all particles, what depends on the particle once for a batch
 * of poses. */
int CALL(closure_cost)(const pkm_machine *machine, ptrdiff_t particles, const double *geometry,
                       ptrdiff_t n, const double *pose, const double *q, double *cost)
{
    if (!pkm_prepared(machine)) return PKM_BAD_MACHINE;
    posture at[POSTURES];
    limb_numbers limb[PKM_MAX_LIMBS];
    for (ptrdiff_t i = 0; i < particles; i++) cost[i] = 0.0;
    for (ptrdiff_t first = 0; first < n; first += POSTURES) {
        const ptrdiff_t batch = n - first < POSTURES ? n - first : POSTURES;
        postures_at(batch, machine->actuators, pose + 6 * first, q + machine->actuators * first, at);
        EACH_BLOCK(i, particles, row, count) {
            real sum = gather(cost, 1, row);
            prepare_limbs(machine, geometry, SLOTS * machine->limbs, row, limb);
            sum += squared_closures(machine, limb, batch, at);
            scatter(sum, cost, 1, row, count);
        }
    }
    return 0;
}

#endif
