/* Random numbers in lanes: uniform and normal, the same bits at every width. */
#ifndef RANDOM_H
#define RANDOM_H

#include "rows.h"

typedef uint64_t bits __attribute__((vector_size(8 * LANES)));

/* xoshiro256+ of Blackman and Vigna, a state for each lane. */
typedef struct { bits s[4]; } generator;

/* `fill` for numbers from memory: x - 0 is x for every x, which the compiler leaves out. */
INLINE real spread(double x) { return x - (real){0}; }

/* The next number of each lane, uniform in [0, 1): 52 bits as the fraction of a double in [1, 2). */
INLINE real draw(generator *g)
{
    const bits sum = g->s[0] + g->s[3], shifted = g->s[1] << 17;
    g->s[2] ^= g->s[0];
    g->s[3] ^= g->s[1];
    g->s[1] ^= g->s[2];
    g->s[0] ^= g->s[3];
    g->s[2] ^= shifted;
    g->s[3] = (g->s[3] << 45) | (g->s[3] >> 19);
    return (real)((sum >> 12) | UINT64_C(0x3ff0000000000000)) - 1.0;
}

/* Natural logarithm of normal numbers above 0: ln(2^e m) = e ln 2 + 2 artanh((m - 1)/(m + 1)), with
 * m from √½ to √2. */
INLINE real logarithm(real x)
{
    const mask low = (mask)fill(SQRT_HALF), e = ((mask)x - low) >> 52;
    const real m = (real)((mask)x - (e << 52)), shift = fill(6755399441055744.0);
    const real exponent = (real)((mask)shift + e) - shift; /* 1.5 * 2^52 holds integers in its bits */
    const real s = (m - 1.0) / (m + 1.0), z = s * s;
    const real fit = POLYNOMIAL_6(ATANH, z) + z * z * z * (z * z * z) * ATANH_6;
    return exponent * LN_2 + 2.0 * (s + s * z * fit);
}

enum { GENERATORS = 8, PAIRS = 2 * GENERATORS };

/* Two normal numbers of each lane (Box and Muller 1958), within ±8.5. */
INLINE void draw_normals(generator *g, real *first, real *second)
{
    const real radius = FN(root)(-2.0 * logarithm(1.0 - draw(g)));
    real sine, cosine;
    FN(sincos)(TWO_PI * draw(g), &sine, &cosine);
    *first = radius * cosine;
    *second = radius * sine;
}

/* n normal numbers of as many generators whatever the lanes: each adds two to every sixteen. */
int CALL(normals)(ptrdiff_t n, uint64_t *state, double *out)
{
    for (int k = 0; k < GENERATORS; k += LANES) {
        generator g;
        for (int i = 0; i < 4; i++) memcpy(&g.s[i], state + i * GENERATORS + k, sizeof g.s[i]);
        for (ptrdiff_t at = 0; at < n; at += PAIRS) {
            real first, second;
            draw_normals(&g, &first, &second);
            if (n - at >= PAIRS) {
                store(first, out + at + k);
                store(second, out + at + GENERATORS + k);
            } else {
                for (int l = 0; l < LANES; l++) {
                    const ptrdiff_t one = at + k + l, other = one + GENERATORS;
                    if (one < n) out[one] = first[l];
                    if (other < n) out[other] = second[l];
                }
            }
        }
        for (int i = 0; i < 4; i++) memcpy(state + i * GENERATORS + k, &g.s[i], sizeof g.s[i]);
    }
    return 0;
}

#endif
