/* Generated from derive/laws.py by `python -m derive`; never edited by hand.
 * derivation eece0985f9587c01
 * `real` is a number or a lane of numbers, FN(name) the function for that type. */

/*
 * the way of a drive at its reading q, without corrections
 *     w = gain q + quadratic q²,  t = ((R + u)² - R²)/c = R w + c w²/4  with u = c w/2
 * in  x[5]           q, gain, quadratic, R, c
 * out way            t
 * out by_x[5]        ∂t by each of x
 * out bend           ∂²t/∂q²
 * operations: 5 +, 17 *, 0 /, 0 sqrt
 */
INLINE void FN(law_drive)(const real x[5], real *way, real by_x[5], real *bend)
{
    /* turn of the spool, or the way without one */
    const real t0 = x[0]*x[0];
    const real w = x[0]*x[1] + x[2]*t0;
    const real t1 = 0.25f*w*w;
    *way = x[3]*w + x[4]*t1;
    const real t2 = 0.5f*x[4];
    const real t3 = x[3] + w*t2;
    const real t4 = 2.0f*x[2];
    const real t5 = x[0]*t4 + x[1];
    by_x[0] = t3*t5;
    by_x[1] = x[0]*t3;
    by_x[2] = t0*t3;
    by_x[3] = w;
    by_x[4] = t1;
    *bend = t2*t5*t5 + t3*t4;
}

/*
 * the reading q of a drive at its way t, without corrections; NaN beyond its turning point
 *     w = 2 t/R / (1 + √(1 + c t/R²)),  q = 2 w/gain / (1 + √(1 + 4 quadratic w/gain²))
 * in  x[5]           t, gain, quadratic, R, c
 * out q              its reading
 * operations: 4 +, 9 *, 4 /, 2 sqrt
 */
INLINE void FN(law_drive_inverse)(const real x[5], real *q)
{
    /* turn of the spool */
    const real w = 2.0f*x[0]/((1.0f + FN(root)(1.0f + x[0]*x[4]/(x[3]*x[3])))*x[3]);
    *q = 2.0f*w/(x[1]*(1.0f + FN(root)(1.0f + 4.0f*x[2]*w/(x[1]*x[1]))));
}

#ifndef NARROW
/*
 * an error with a period
 *     a cos(k q) + b sin(k q)
 * in  x[4]           q, k, a, b
 * out error          as the way
 * out by_x[3]        by q, a and b
 * out bend           ∂²/∂q²
 * operations: 3 +, 10 *, 0 /, 0 sqrt
 */
INLINE void FN(law_harmonic)(const real x[4], real *error, real by_x[3], real *bend)
{
    real sk, ck;
    FN(sincos)(x[0]*x[1], &sk, &ck);
    const real t0 = x[2]*ck;
    const real t1 = x[3]*sk;
    *error = t0 + t1;
    by_x[0] = x[1]*x[3]*ck - x[1]*x[2]*sk;
    by_x[1] = ck;
    by_x[2] = sk;
    const real t2 = x[1]*x[1];
    *bend = -t0*t2 - t1*t2;
}
#endif

/*
 * the correction of a table between two places
 *     y0 + (q - q0)/(q1 - q0) (y1 - y0)
 * in  x[5]           q, q0, q1, y0, y1
 * out error          as the way
 * out by_x[3]        by q, y0 and y1
 * operations: 5 +, 3 *, 1 /, 0 sqrt
 */
INLINE void FN(law_segment)(const real x[5], real *error, real by_x[3])
{
    const real t0 = 1.0f/(x[2] - x[1]);
    const real part = (x[0] - x[1])*t0;
    const real t1 = x[4] - x[3];
    *error = x[3] + part*t1;
    by_x[0] = t0*t1;
    by_x[1] = 1.0f - part;
    by_x[2] = part;
}
