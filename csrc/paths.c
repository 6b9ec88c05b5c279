/* Paths of complex solutions: the closures of a machine while its limbs change in a straight line
 * from limbs whose solutions are all known to those of interest.
 *
 * A path is predicted by the cubic through its last two points and their velocities, and corrected by
 * Newton's method, which has to settle at once: a correction that is not small, or does not shrink
 * fast, means that the step was too long. The formulas are those of the core, in complex numbers.
 */
#include <complex.h>
#include <math.h>
#include <string.h>

#include "pkmcal.h"

#define INLINE static inline __attribute__((always_inline, unused))

enum { PLAIN, SCALED };

INLINE double complex root_complex(double complex x) { return csqrt(x); }

#define COMPLEX
#define NARROW /* without the formulas that need sines */
#define real double complex
#define NUMBER double
#define FN(name) name##_complex
#include "kernel.h"

enum { MAX_STEPS = 2000, CORRECTIONS = 4, POLISHING = 8 };
#define FIRST_STEP 0.02
#define LEAST_STEP 1e-13
#define CORRECTED 1e-5 /* relative correction after which a point is on its path, to about its square */
#define POLISHED 1e-15
#define NOISE 1e-10     /* what rounding leaves of a correction, beside R */
#define CONTRACTION 0.1 /* how much smaller each correction must be than the one before */
#define FARTHEST 1e5    /* R or p this large this near to the target goes to infinity */
#define NEARLY 0.1

typedef struct {
    const pkm_machine *machine;
    const real *start, *target; /* limbs x PKM_SPHERE */
} homotopy;

INLINE double size(real x) { return fmax(fabs(creal(x)), fabs(cimag(x))); }

/* The largest entry of R and p, at least 1. */
INLINE double reach(int map, const real *state)
{
    real frame[12];
    double largest = 1.0;
    FN(map_frame)(map, state, frame, frame + 9);
    for (int k = 0; k < 12; k++) largest = fmax(largest, size(frame[k]));
    return largest;
}

/* The limbs at t, 0 at the start and 1 at the target; the rates are target - start. */
static void limbs_at(const homotopy *path, double t, FN(limb_sphere) *limb)
{
    for (int i = 0; i < path->machine->limbs; i++) {
        real at[PKM_SPHERE];
        for (int k = 0; k < PKM_SPHERE; k++) {
            const real a = path->start[i * PKM_SPHERE + k], b = path->target[i * PKM_SPHERE + k];
            at[k] = (1.0 - t) * a + t * b;
        }
        memcpy(limb[i].b, at, sizeof limb[i].b);
        memcpy(limb[i].c, at + 3, sizeof limb[i].c);
        limb[i].rho = at[6];
        memcpy(limb[i].axis, at + 7, sizeof limb[i].axis);
    }
}

/* Rates of the rows at a held state, in the order of elimination. */
INLINE void row_rates(int map, const homotopy *path, const FN(limb_sphere) *limb, const real *state,
                      real *rate)
{
    const pkm_machine *machine = path->machine;
    real R[9], p[3], by[PKM_SPHERE];
    int r = 0;
    FN(map_frame)(map, state, R, p);
    for (int i = 0; i < machine->limbs; i++) {
        const FN(limb_sphere) *one = &limb[i];
        for (int k = 0; k < PKM_SPHERE; k++)
            by[k] = path->target[i * PKM_SPHERE + k] - path->start[i * PKM_SPHERE + k];
        FN(sphere_rate)(R, p, one->b, by, one->c, by + 3, one->rho * one->rho,
                        2.0 * one->rho * by[6], &rate[machine->order[r++]]);
#define CASE(NAME, name, N, A)                                                                    \
        if (machine->rows[i] & ROW_##NAME)                                                        \
            FN(name##_rate)(R, p, one->b, by, one->c, by + 3, one->axis[N], by + 7 + 3 * N,       \
                            one->axis[A], by + 7 + 3 * A, machine->lever[i],                      \
                            &rate[machine->order[r++]]);
        EACH_ROW(CASE)
#undef CASE
    }
}

/* LU of A (m x m) with exchanges; the diagonal holds reciprocals. */
INLINE void exchange_factor(int m, real *A, int *row)
{
    for (int c = 0; c < m; c++) {
        int best = c;
        for (int i = c + 1; i < m; i++)
            if (size(A[i * m + c]) > size(A[best * m + c])) best = i;
        row[c] = best;
        for (int j = c; j < m && best != c; j++) { /* the factors stay where they are */
            const real swapped = A[c * m + j];
            A[c * m + j] = A[best * m + j];
            A[best * m + j] = swapped;
        }
        A[c * m + c] = 1.0 / A[c * m + c];
        for (int i = c + 1; i < m; i++) {
            A[i * m + c] *= A[c * m + c];
            for (int j = c + 1; j < m; j++) A[i * m + j] -= A[i * m + c] * A[c * m + j];
        }
    }
}

INLINE void exchange_substitute(int m, const real *A, const int *row, real *b)
{
    for (int c = 0; c < m; c++) {
        const real swapped = b[c];
        b[c] = b[row[c]];
        b[row[c]] = swapped;
        for (int i = c + 1; i < m; i++) b[i] -= A[i * m + c] * b[c];
    }
    for (int c = m - 1; c >= 0; c--) {
        for (int j = c + 1; j < m; j++) b[c] -= A[c * m + j] * b[j];
        b[c] *= A[c * m + c];
    }
}

/* How large a step is beside its state; infinite where it is no number, which fmax would drop. */
INLINE double relative(int map, const real *state, const real *step)
{
    double moved = 0.0, largest = 1.0;
    real rate[MAX_STATE] = {0};
    FN(map_velocity)(map, state, step, rate);
    for (int s = 0; s < MAX_STATE; s++) {
        if (!isfinite(creal(rate[s])) || !isfinite(cimag(rate[s]))) return INFINITY;
        moved = fmax(moved, size(rate[s]));
        largest = fmax(largest, size(state[s]));
    }
    return moved / largest;
}

/* Newton's method from a predicted state; the factors of its last matrix stay. Returns the first
 * correction, or infinity where it did not settle. */
static double correct(int map, const homotopy *path, const FN(limb_sphere) *limb, int iterations,
                      double settled, real *state, real *A, int *row)
{
    const int m = map_m(map);
    real phi[PKM_MAX_ROWS], moved[MAX_STATE] = {0};
    double first = INFINITY, last = INFINITY;
    FN(map_tidy)(map, state, moved); /* a prediction leaves the unit quaternions */
    memcpy(state, moved, sizeof moved);
    const double known = fmax(settled, NOISE * reach(map, state));
    for (int k = 0; k < iterations; k++) {
        FN(closure_rows)(map, PLAIN, path->machine, limb, state, phi, A);
        exchange_factor(m, A, row);
        exchange_substitute(m, A, row, phi);
        for (int j = 0; j < m; j++) phi[j] = -phi[j];
        const double now = relative(map, state, phi);
        if (!(now <= 0.5) || (k && !(now <= CONTRACTION * last || now <= known))) return INFINITY;
        FN(map_retract)(map, state, phi, moved);
        memcpy(state, moved, sizeof moved);
        if (!k) first = now;
        last = now;
        if (now <= known) return first;
    }
    return INFINITY;
}

static void velocity_at(int map, const homotopy *path, const FN(limb_sphere) *limb, const real *state,
                        const real *A, const int *row, real *velocity)
{
    real rate[PKM_MAX_ROWS];
    row_rates(map, path, limb, state, rate);
    exchange_substitute(map_m(map), A, row, rate);
    for (int j = 0; j < map_m(map); j++) rate[j] = -rate[j];
    FN(map_velocity)(map, state, rate, velocity);
}

/* The cubic that has these values and slopes at -before and at 0, at h. */
INLINE void extrapolate(const real *x0, const real *v0, const real *x1, const real *v1, double before,
                        double h, real *x)
{
    for (int s = 0; s < MAX_STATE; s++) {
        const real chord = (x1[s] - x0[s]) / before;
        const real second = (v1[s] - chord) / before;
        const real third = (v1[s] - 2.0 * chord + v0[s]) / (before * before);
        x[s] = x1[s] + h * (v1[s] + h * (second + (h + before) * third));
    }
}

/* One path from its state at the start. Returns how it ended. */
INLINE int follow(int map, const homotopy *path, double accuracy, real *x, int32_t *steps,
                  double *reached)
{
    FN(limb_sphere) limb[PKM_MAX_LIMBS];
    real A[PKM_MAX_ROWS * 6], v[MAX_STATE] = {0}, x0[MAX_STATE] = {0}, v0[MAX_STATE] = {0};
    int row[6];
    double t = 0.0, h = FIRST_STEP, before = 0.0;
    *steps = 0;
    *reached = 0.0;
    limbs_at(path, t, limb);
    if (correct(map, path, limb, CORRECTIONS, CORRECTED, x, A, row) > accuracy) return PKM_LOST;
    velocity_at(map, path, limb, x, A, row, v);
    while (t < 1.0) {
        real trial[MAX_STATE] = {0};
        *reached = t;
        if (reach(map, x) > FARTHEST) return 1.0 - t < NEARLY ? PKM_FAR : PKM_LOST;
        if (*steps == MAX_STEPS || h < LEAST_STEP) return PKM_LOST;
        ++*steps;
        const double next = t + h < 1.0 ? t + h : 1.0, step = next - t;
        if (before > 0.0) extrapolate(x0, v0, x, v, before, step, trial);
        else
            for (int s = 0; s < MAX_STATE; s++) trial[s] = x[s] + step * v[s];
        limbs_at(path, next, limb);
        const double noise = 10.0 * NOISE * reach(map, x); /* no shorter step lowers it */
        const double off = correct(map, path, limb, CORRECTIONS, CORRECTED, trial, A, row) - noise;
        if (!(off <= 2.0 * accuracy)) {
            h = 0.5 * step;
            continue;
        }
        memcpy(x0, x, sizeof x0);
        memcpy(v0, v, sizeof v0);
        memcpy(x, trial, sizeof trial);
        velocity_at(map, path, limb, x, A, row, v);
        before = step;
        t = next;
        h = step * fmin(2.0, fmax(0.5, 0.9 * sqrt(sqrt(accuracy / fmax(off, 1e-30)))));
    }
    *reached = 1.0;
    for (int k = 0; k < POLISHING; k++)
        if (correct(map, path, limb, 1, POLISHED, x, A, row) <= POLISHED) break;
    return PKM_ARRIVED;
}

int pkm_paths(const pkm_machine *machine, ptrdiff_t n, const double *start, const double *target,
              double *state, double accuracy, double *frame, int32_t *status, int32_t *steps,
              double *reached)
{
    if (pkm_prepared(machine) != map_m(machine->map)) return PKM_BAD_MACHINE;
    pkm_machine unit = *machine;
    homotopy path = {&unit, (const real *)start, (const real *)target};
    unit.length = unit.size = 1.0;
    for (ptrdiff_t k = 0; k < n; k++) {
        real *x = (real *)state + MAX_STATE * k, *out = (real *)frame + 12 * k;
        switch (machine->map) {
#define CASE(NAME, name, ...)                                                                       \
    case MAP_##NAME:                                                                              \
        status[k] = follow(MAP_##NAME, &path, accuracy, x, &steps[k], &reached[k]);               \
        FN(map_frame)(MAP_##NAME, x, out, out + 9);                                               \
        break;
            EACH_MAP(CASE)
#undef CASE
        }
    }
    return 0;
}
