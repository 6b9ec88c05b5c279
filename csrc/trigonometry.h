/* Sine, cosine and arctangent in lanes, from the generated polynomials. */
#ifndef TRIGONOMETRY_H
#define TRIGONOMETRY_H

#include "elementary.h"
#include "lanes.h"

#define MAX_ANGLE 1e5 /* beyond it the argument reduction would lose digits: NaN instead */

INLINE void FN(sincos)(real x, real *sine, real *cosine)
{
    /* nearest multiple of π/2: adding 1.5 * 2^52 rounds to an integer and leaves it in the bits */
    const real shift = FN(fill)(6755399441055744.0);
    const real k = x * TWO_OVER_PI + shift;
    const mask quadrant = (mask)k;
    const real n = k - shift;
    const real r = ((x - n * HALF_PI_PART0) - n * HALF_PI_PART1) - n * HALF_PI_PART2;
    const real z = r * r;
    const real s = r + r * z * (SIN_0 + z * (SIN_1 + z * (SIN_2 + z * (SIN_3 + z * (SIN_4 + z * SIN_5)))));
    const real c = 1.0 - (0.5 * z - z * z * (COS_0 + z * (COS_1 + z * (COS_2 + z * (COS_3
                 + z * (COS_4 + z * COS_5))))));
    const mask odd = -(quadrant & 1);
    const mask sine_sign = (quadrant & 2) << 62, cosine_sign = ((quadrant + 1) & 2) << 62;
    const mask known = absolute(x) <= FN(fill)(MAX_ANGLE);
    const real unknown = FN(fill)(NAN);
    *sine = select(known, (real)((mask)select(odd, c, s) ^ sine_sign), unknown);
    *cosine = select(known, (real)((mask)select(odd, s, c) ^ cosine_sign), unknown);
}

INLINE real arctangent2(real y, real x)
{
    const real ax = absolute(x), ay = absolute(y);
    const mask steep = ay > ax;
    const real small = select(steep, ax, ay), large = select(steep, ay, ax);
    const mask wide = small > TAN_PI_8 * large; /* then atan = π/4 + atan((s - l)/(s + l)) */
    const real above = select(wide, small - large, small);
    const real below = select(wide, small + large, large);
    const mask zero = below == FN(fill)(0.0);
    const real t = above / select(zero, FN(fill)(1.0), below);
    const real z = t * t;
    real angle = t + t * z * (ATAN_0 + z * (ATAN_1 + z * (ATAN_2 + z * (ATAN_3 + z * (ATAN_4 + z * (ATAN_5
               + z * (ATAN_6 + z * (ATAN_7 + z * (ATAN_8 + z * (ATAN_9 + z * ATAN_10))))))))));
    angle = select(wide, QUARTER_PI + angle, angle);
    angle = select(steep, HALF_PI - angle, angle);
    angle = select(x < FN(fill)(0.0), PI - angle, angle);
    const real signed_angle = (real)((mask)angle | ((mask)y & fill_mask(INT64_MIN)));
    return select((x == x) & (y == y), signed_angle, FN(fill)(NAN));
}

#endif
