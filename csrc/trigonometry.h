/* Sine, cosine and arctangent in lanes of doubles, from the generated polynomials. */
#ifndef TRIGONOMETRY_H
#define TRIGONOMETRY_H

#include "elementary.h"

#define MAX_ANGLE 1e5 /* beyond it the argument reduction would lose digits: NaN instead */

#define POLYNOMIAL_6(f, z)                                                                        \
    (f##_0 + z * (f##_1 + z * (f##_2 + z * (f##_3 + z * (f##_4 + z * f##_5)))))

INLINE void FN(sincos)(real x, real *sine, real *cosine)
{
    /* nearest multiple of π/2: adding 1.5 * 2^52 rounds to an integer and leaves it in the bits */
    const real shift = fill_wide(6755399441055744.0);
    const real k = x * TWO_OVER_PI + shift;
    const mask quadrant = (mask)k;
    const real n = k - shift;
    const real r = ((x - n * HALF_PI_PART0) - n * HALF_PI_PART1) - n * HALF_PI_PART2;
    const real z = r * r;
    const real s = r + r * z * POLYNOMIAL_6(SIN, z);
    const real c = 1.0 - (0.5 * z - z * z * POLYNOMIAL_6(COS, z));
    const mask odd = -(quadrant & 1);
    const mask sine_sign = (quadrant & 2) << 62, cosine_sign = ((quadrant + 1) & 2) << 62;
    const mask known = absolute_wide(x) <= fill_wide(MAX_ANGLE);
    const real unknown = fill_wide(NAN);
    *sine = select_wide(known, (real)((mask)select_wide(odd, c, s) ^ sine_sign), unknown);
    *cosine = select_wide(known, (real)((mask)select_wide(odd, s, c) ^ cosine_sign), unknown);
}

INLINE real arctangent2(real y, real x)
{
    const real ax = absolute_wide(x), ay = absolute_wide(y);
    const mask steep = ay > ax;
    const real small = select_wide(steep, ax, ay), large = select_wide(steep, ay, ax);
    const mask middle = small > TAN_PI_8 * large; /* then atan is π/4 + atan((s - l)/(s + l)) */
    const real above = select_wide(middle, small - large, small);
    const real below = select_wide(middle, small + large, large);
    const mask zero = below == fill_wide(0.0);
    const real t = above / select_wide(zero, fill_wide(1.0), below);
    const real z = t * t;
    const real high = ATAN_6 + z * (ATAN_7 + z * (ATAN_8 + z * (ATAN_9 + z * ATAN_10)));
    real angle = t + t * z * (POLYNOMIAL_6(ATAN, z) + z * z * z * (z * z * z) * high);
    angle = select_wide(middle, QUARTER_PI + angle, angle);
    angle = select_wide(steep, HALF_PI - angle, angle);
    angle = select_wide(x < fill_wide(0.0), PI - angle, angle);
    const real signed_angle = (real)((mask)angle | ((mask)y & (mask)(-fill_wide(0.0))));
    return select_wide((x == x) & (y == y), signed_angle, fill_wide(NAN));
}

#endif
