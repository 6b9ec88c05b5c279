/* Generated from derive/limb_functions.py by `python -m derive`; never edited by hand.
 * derivation f423cc6f960bc3b5
 * `real` is a number or a lane of numbers, FN(name) the function for that type. */

/*
 * from the base point to the platform joint
 *     h = p + R b - base
 * in  R[9]           platform to base, row by row
 * in  p[3]           platform origin [mm]
 * in  b[3]           platform joint, platform frame [mm]
 * in  base[3]        base point [mm]
 * out h[3]           base frame [mm]
 * operations: 12 +, 9 *, 0 /, 0 sqrt
 */
INLINE void FN(limb_joint)(const real R[9], const real p[3], const real b[3], const real base[3],
        real h[3])
{
    /* R b */
    const real r0 = R[0]*b[0] + R[1]*b[1] + R[2]*b[2];
    const real r1 = R[3]*b[0] + R[4]*b[1] + R[5]*b[2];
    const real r2 = R[6]*b[0] + R[7]*b[1] + R[8]*b[2];
    h[0] = p[0] + r0 - base[0];
    h[1] = p[1] + r1 - base[1];
    h[2] = p[2] + r2 - base[2];
}

/*
 * an actuator's command as the limb sees it
 *     q̃ = gain q + offset
 * in  q              actuator coordinate [mm or rad]
 * in  g[16]          the limb's numbers
 * out qt             q̃ [mm or rad]
 * operations: 1 +, 1 *, 0 /, 0 sqrt
 */
INLINE void FN(limb_drive)(real q, const real g[16], real *qt)
{
    *qt = q*g[GAIN] + g[OFFSET];
}

/*
 * the command that gives q̃
 *     q = (q̃ - offset)/gain
 * in  qt             q̃ [mm or rad]
 * in  per_gain       1/gain, once per geometry: divisions are slow
 * in  g[16]          the limb's numbers
 * out q              actuator coordinate [mm or rad]
 * operations: 1 +, 1 *, 0 /, 0 sqrt
 */
INLINE void FN(limb_command)(real qt, real per_gain, const real g[16], real *q)
{
    *q = (qt - g[OFFSET])*per_gain;
}

/*
 * closure of one limb at a known anchor
 *     Φ = (d·d - ρ²)/2,  d = p + R b - c
 *     ∂Φ/∂v = d,  ∂Φ/∂ω = R b × d
 * in  R[9]           platform to base, row by row
 * in  p[3]           platform origin [mm]
 * in  b[3]           platform joint, platform frame [mm]
 * in  c[3]           anchor, base frame [mm]
 * in  rho2           ρ² [mm²]
 * out phi            Φ [mm²]
 * out omega[3]       ∂Φ/∂ω [mm²/rad]
 * out v[3]           ∂Φ/∂v [mm]
 * operations: 18 +, 19 *, 0 /, 0 sqrt
 */
INLINE void FN(sphere_row)(const real R[9], const real p[3], const real b[3], const real c[3],
        real rho2, real *phi, real omega[3], real v[3])
{
    /* R b */
    const real r0 = R[0]*b[0] + R[1]*b[1] + R[2]*b[2];
    const real r1 = R[3]*b[0] + R[4]*b[1] + R[5]*b[2];
    const real r2 = R[6]*b[0] + R[7]*b[1] + R[8]*b[2];
    /* from the anchor to the platform joint */
    const real d0 = p[0] + r0 - c[0];
    const real d1 = p[1] + r1 - c[1];
    const real d2 = p[2] + r2 - c[2];
    const real square = d0*d0 + d1*d1 + d2*d2 - rho2;
    *phi = 0.5f*square;
    omega[0] = r1*d2 - r2*d1;
    omega[1] = r2*d0 - r0*d2;
    omega[2] = r0*d1 - r1*d0;
    v[0] = d0;
    v[1] = d1;
    v[2] = d2;
}

#ifndef NARROW
/*
 * base axis of a limb
 *     frame Rx(tilt1) Ry(tilt2) ez
 * in  g[16]          the limb's numbers
 * in  F[9]           fixed frame of the axis, row by row
 * out axis[3]        as its frame
 * operations: 6 +, 12 *, 0 /, 0 sqrt
 */
INLINE void FN(base_axis)(const real g[16], const real F[9], real axis[3])
{
    real su1, cu1;
    FN(sincos)(g[TILT1], &su1, &cu1);
    real su2, cu2;
    FN(sincos)(g[TILT2], &su2, &cu2);
    axis[0] = F[0]*su2 + (F[2]*cu1 - F[1]*su1)*cu2;
    axis[1] = F[3]*su2 + (F[5]*cu1 - F[4]*su1)*cu2;
    axis[2] = F[6]*su2 + (F[8]*cu1 - F[7]*su1)*cu2;
}
#endif

#ifndef NARROW
/*
 * platform axis of a limb
 *     frame Rx(tilt1) Ry(tilt2) ez
 * in  g[16]          the limb's numbers
 * in  F[9]           fixed frame of the axis, row by row
 * out axis[3]        as its frame
 * operations: 6 +, 12 *, 0 /, 0 sqrt
 */
INLINE void FN(platform_axis)(const real g[16], const real F[9], real axis[3])
{
    real su1, cu1;
    FN(sincos)(g[PLATFORM_TILT1], &su1, &cu1);
    real su2, cu2;
    FN(sincos)(g[PLATFORM_TILT2], &su2, &cu2);
    axis[0] = F[0]*su2 + (F[2]*cu1 - F[1]*su1)*cu2;
    axis[1] = F[3]*su2 + (F[5]*cu1 - F[4]*su1)*cu2;
    axis[2] = F[6]*su2 + (F[8]*cu1 - F[7]*su1)*cu2;
}
#endif

#ifndef NARROW
/*
 * hinge axis of a limb
 *     frame Rx(tilt1) Ry(tilt2) ez
 * in  g[16]          the limb's numbers
 * in  F[9]           fixed frame of the axis, row by row
 * out axis[3]        as its frame
 * operations: 6 +, 12 *, 0 /, 0 sqrt
 */
INLINE void FN(hinge_axis)(const real g[16], const real F[9], real axis[3])
{
    real su1, cu1;
    FN(sincos)(g[HINGE_TILT1], &su1, &cu1);
    real su2, cu2;
    FN(sincos)(g[HINGE_TILT2], &su2, &cu2);
    axis[0] = F[0]*su2 + (F[2]*cu1 - F[1]*su1)*cu2;
    axis[1] = F[3]*su2 + (F[5]*cu1 - F[4]*su1)*cu2;
    axis[2] = F[6]*su2 + (F[8]*cu1 - F[7]*su1)*cu2;
}
#endif

#ifndef NARROW
/*
 * length: the directions the anchor moves in
 *     c = base, ρ = q̃
 * in  g[16]          the limb's numbers
 * in  F[9]           fixed frame of the axis, in the base, row by row
 * out first[3]       s, or crank e
 * out second[3]      0, or crank axis × e
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(length_directions)(const real g[16], const real F[9], real first[3], real second[3])
{
    first[0] = FN(fill)(0.0f);
    first[1] = FN(fill)(0.0f);
    first[2] = FN(fill)(0.0f);
    second[0] = FN(fill)(0.0f);
    second[1] = FN(fill)(0.0f);
    second[2] = FN(fill)(0.0f);
}
#endif

#ifndef NARROW
/*
 * slider: the directions the anchor moves in
 *     c = base + q̃ s, ρ = rod
 * in  g[16]          the limb's numbers
 * in  F[9]           fixed frame of the axis, in the base, row by row
 * out first[3]       s, or crank e
 * out second[3]      0, or crank axis × e
 * operations: 6 +, 12 *, 0 /, 0 sqrt
 */
INLINE void FN(slider_directions)(const real g[16], const real F[9], real first[3], real second[3])
{
    real su1, cu1;
    FN(sincos)(g[TILT1], &su1, &cu1);
    real su2, cu2;
    FN(sincos)(g[TILT2], &su2, &cu2);
    first[0] = F[0]*su2 + (F[2]*cu1 - F[1]*su1)*cu2;
    first[1] = F[3]*su2 + (F[5]*cu1 - F[4]*su1)*cu2;
    first[2] = F[6]*su2 + (F[8]*cu1 - F[7]*su1)*cu2;
    second[0] = FN(fill)(0.0f);
    second[1] = FN(fill)(0.0f);
    second[2] = FN(fill)(0.0f);
}
#endif

#ifndef NARROW
/*
 * crank: the directions the anchor moves in
 *     c = base + crank Rot(axis, q̃) e, ρ = rod
 * in  g[16]          the limb's numbers
 * in  F[9]           fixed frame of the axis, in the base, row by row
 * out first[3]       s, or crank e
 * out second[3]      0, or crank axis × e
 * operations: 9 +, 24 *, 0 /, 0 sqrt
 */
INLINE void FN(crank_directions)(const real g[16], const real F[9], real first[3], real second[3])
{
    real su1, cu1;
    FN(sincos)(g[TILT1], &su1, &cu1);
    real su2, cu2;
    FN(sincos)(g[TILT2], &su2, &cu2);
    first[0] = g[CRANK]*(F[0]*cu2 - (F[2]*cu1 - F[1]*su1)*su2);
    first[1] = g[CRANK]*(F[3]*cu2 - (F[5]*cu1 - F[4]*su1)*su2);
    first[2] = g[CRANK]*(F[6]*cu2 - (F[8]*cu1 - F[7]*su1)*su2);
    second[0] = g[CRANK]*(F[1]*cu1 + F[2]*su1);
    second[1] = g[CRANK]*(F[4]*cu1 + F[5]*su1);
    second[2] = g[CRANK]*(F[7]*cu1 + F[8]*su1);
}
#endif

/*
 * length: where the anchor stands
 *     c = base, ρ = q̃
 * in  qt             q̃ [mm or rad]
 * in  g[16]          the limb's numbers
 * in  first[3]       s, or crank e
 * in  second[3]      0, or crank axis × e
 * out c[3]           anchor [mm]
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(length_anchor)(real qt, const real g[16], const real first[3], const real second[3],
        real c[3])
{
    c[0] = g[BASE_X];
    c[1] = g[BASE_Y];
    c[2] = g[BASE_Z];
}

/*
 * slider: where the anchor stands
 *     c = base + q̃ s, ρ = rod
 * in  qt             q̃ [mm or rad]
 * in  g[16]          the limb's numbers
 * in  first[3]       s, or crank e
 * in  second[3]      0, or crank axis × e
 * out c[3]           anchor [mm]
 * operations: 3 +, 3 *, 0 /, 0 sqrt
 */
INLINE void FN(slider_anchor)(real qt, const real g[16], const real first[3], const real second[3],
        real c[3])
{
    c[0] = qt*first[0] + g[BASE_X];
    c[1] = qt*first[1] + g[BASE_Y];
    c[2] = qt*first[2] + g[BASE_Z];
}

#ifndef NARROW
/*
 * crank: where the anchor stands
 *     c = base + crank Rot(axis, q̃) e, ρ = rod
 * in  qt             q̃ [mm or rad]
 * in  g[16]          the limb's numbers
 * in  first[3]       s, or crank e
 * in  second[3]      0, or crank axis × e
 * out c[3]           anchor [mm]
 * operations: 6 +, 6 *, 0 /, 0 sqrt
 */
INLINE void FN(crank_anchor)(real qt, const real g[16], const real first[3], const real second[3],
        real c[3])
{
    real sq, cq;
    FN(sincos)(qt, &sq, &cq);
    c[0] = g[BASE_X] + first[0]*cq + second[0]*sq;
    c[1] = g[BASE_Y] + first[1]*cq + second[1]*sq;
    c[2] = g[BASE_Z] + first[2]*cq + second[2]*sq;
}
#endif

/*
 * length: the limb's length
 *     c = base, ρ = q̃
 * in  qt             q̃ [mm or rad]
 * in  g[16]          the limb's numbers
 * out rho            ρ [mm]
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(length_radius)(real qt, const real g[16], real *rho)
{
    *rho = qt;
}

/*
 * slider: the limb's length
 *     c = base + q̃ s, ρ = rod
 * in  qt             q̃ [mm or rad]
 * in  g[16]          the limb's numbers
 * out rho            ρ [mm]
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(slider_radius)(real qt, const real g[16], real *rho)
{
    *rho = g[ROD];
}

/*
 * crank: the limb's length
 *     c = base + crank Rot(axis, q̃) e, ρ = rod
 * in  qt             q̃ [mm or rad]
 * in  g[16]          the limb's numbers
 * out rho            ρ [mm]
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(crank_radius)(real qt, const real g[16], real *rho)
{
    *rho = g[ROD];
}

/*
 * length: actuator coordinate at a joint position
 *     q̃ = ‖h‖
 * in  g[16]          the limb's numbers
 * in  h[3]           p + R b - base [mm]
 * in  first[3]       s, or crank e
 * in  second[3]      0, or crank axis × e
 * in  branch         sign of d·∂c/∂q̃, where there are two
 * out qt             q̃ [mm]
 * operations: 2 +, 3 *, 0 /, 1 sqrt
 */
INLINE void FN(length_inverse)(const real g[16], const real h[3], const real first[3],
        const real second[3], real branch, real *qt)
{
    *qt = FN(root)(h[0]*h[0] + h[1]*h[1] + h[2]*h[2]);
}

/*
 * slider: actuator coordinate at a joint position
 *     q̃ = h·s - branch √(rod² - ‖h - (h·s) s‖²)
 * in  g[16]          the limb's numbers
 * in  h[3]           p + R b - base [mm]
 * in  first[3]       s, or crank e
 * in  second[3]      0, or crank axis × e
 * in  branch         sign of d·∂c/∂q̃, where there are two
 * out qt             q̃ [mm]
 * operations: 9 +, 11 *, 0 /, 1 sqrt
 */
INLINE void FN(slider_inverse)(const real g[16], const real h[3], const real first[3],
        const real second[3], real branch, real *qt)
{
    const real along = h[0]*first[0] + h[1]*first[1] + h[2]*first[2];
    const real across0 = h[0] - first[0]*along;
    const real across1 = h[1] - first[1]*along;
    const real across2 = h[2] - first[2]*along;
    const real root = FN(root)(g[ROD]*g[ROD] - across0*across0 - across1*across1 - across2*across2);
    *qt = along - branch*root;
}

#ifndef NARROW
/*
 * crank: actuator coordinate at a joint position
 *     h·(cos q̃ e + sin q̃ n) = κ = (h·h + crank² - rod²)/(2 crank)
 *     q̃ = atan2(h·n, h·e) - branch atan2(√((h·e)² + (h·n)² - κ²), κ)
 * in  g[16]          the limb's numbers
 * in  h[3]           p + R b - base [mm]
 * in  first[3]       s, or crank e
 * in  second[3]      0, or crank axis × e
 * in  branch         sign of d·∂c/∂q̃, where there are two
 * out qt             q̃ [rad]
 * operations: 12 +, 20 *, 0 /, 1 sqrt
 */
INLINE void FN(crank_inverse)(const real g[16], const real h[3], const real first[3],
        const real second[3], real branch, real *qt)
{
    const real x = h[0]*first[0] + h[1]*first[1] + h[2]*first[2];
    const real y = h[0]*second[0] + h[1]*second[1] + h[2]*second[2];
    const real twice = g[CRANK]*g[CRANK] + h[0]*h[0] + h[1]*h[1] + h[2]*h[2] - g[ROD]*g[ROD];
    const real kappa = 0.5f*twice;
    const real root = FN(root)(x*x + y*y - kappa*kappa);
    const real side = branch*root;
    /* of q̃, up to a positive factor */
    const real sine = y*kappa - x*side;
    const real cosine = x*kappa + y*side;
    const real turn = arctangent2(sine, cosine);
    *qt = turn;
}
#endif

/*
 * length: the sphere row by q and numbers
 *     Φ = (d·d - ρ²)/2,  d = p + R b - c,  c = base, ρ = q̃
 *     q̃ = gain q + offset
 * in  R[9]           platform to base, row by row
 * in  p[3]           platform origin [mm]
 * in  q              actuator coordinate [mm or rad]
 * in  g[16]          the limb's numbers
 * in  F[9]           fixed frame of the axis, in the base, row by row
 * out by_q           ∂Φ/∂q
 * out by_g[16]       ∂Φ/∂(the limb's numbers)
 * operations: 19 +, 21 *, 0 /, 0 sqrt
 */
INLINE void FN(length_derivatives)(const real R[9], const real p[3], real q, const real g[16],
        const real F[9], real *by_q, real by_g[16])
{
    /* q̃ */
    const real qt = q*g[GAIN] + g[OFFSET];
    /* R b */
    const real r0 = R[0]*g[PLATFORM_X] + R[1]*g[PLATFORM_Y] + R[2]*g[PLATFORM_Z];
    const real r1 = R[3]*g[PLATFORM_X] + R[4]*g[PLATFORM_Y] + R[5]*g[PLATFORM_Z];
    const real r2 = R[6]*g[PLATFORM_X] + R[7]*g[PLATFORM_Y] + R[8]*g[PLATFORM_Z];
    /* from the anchor to the platform joint */
    const real d0 = p[0] + r0 - g[BASE_X];
    const real d1 = p[1] + r1 - g[BASE_Y];
    const real d2 = p[2] + r2 - g[BASE_Z];
    *by_q = -g[GAIN]*qt;
    by_g[BASE_X] = -d0;
    by_g[BASE_Y] = -d1;
    by_g[BASE_Z] = -d2;
    by_g[PLATFORM_X] = R[0]*d0 + R[3]*d1 + R[6]*d2;
    by_g[PLATFORM_Y] = R[1]*d0 + R[4]*d1 + R[7]*d2;
    by_g[PLATFORM_Z] = R[2]*d0 + R[5]*d1 + R[8]*d2;
    by_g[OFFSET] = -qt;
    by_g[GAIN] = -q*qt;
    by_g[ROD] = FN(fill)(0.0f);
    by_g[CRANK] = FN(fill)(0.0f);
    by_g[TILT1] = FN(fill)(0.0f);
    by_g[TILT2] = FN(fill)(0.0f);
    by_g[PLATFORM_TILT1] = FN(fill)(0.0f);
    by_g[PLATFORM_TILT2] = FN(fill)(0.0f);
    by_g[HINGE_TILT1] = FN(fill)(0.0f);
    by_g[HINGE_TILT2] = FN(fill)(0.0f);
}

#ifndef NARROW
/*
 * slider: the sphere row by q and numbers
 *     Φ = (d·d - ρ²)/2,  d = p + R b - c,  c = base + q̃ s, ρ = rod
 *     q̃ = gain q + offset
 * in  R[9]           platform to base, row by row
 * in  p[3]           platform origin [mm]
 * in  q              actuator coordinate [mm or rad]
 * in  g[16]          the limb's numbers
 * in  F[9]           fixed frame of the axis, in the base, row by row
 * out by_q           ∂Φ/∂q
 * out by_g[16]       ∂Φ/∂(the limb's numbers)
 * operations: 44 +, 66 *, 0 /, 0 sqrt
 */
INLINE void FN(slider_derivatives)(const real R[9], const real p[3], real q, const real g[16],
        const real F[9], real *by_q, real by_g[16])
{
    /* q̃ */
    const real qt = q*g[GAIN] + g[OFFSET];
    real su1, cu1;
    FN(sincos)(g[TILT1], &su1, &cu1);
    real su2, cu2;
    FN(sincos)(g[TILT2], &su2, &cu2);
    /* slider direction */
    const real t0 = F[2]*cu1 - F[1]*su1;
    const real s0 = F[0]*su2 + cu2*t0;
    const real t1 = F[5]*cu1 - F[4]*su1;
    const real s1 = F[3]*su2 + cu2*t1;
    const real t2 = F[8]*cu1 - F[7]*su1;
    const real s2 = F[6]*su2 + cu2*t2;
    /* R b */
    const real r0 = R[0]*g[PLATFORM_X] + R[1]*g[PLATFORM_Y] + R[2]*g[PLATFORM_Z];
    const real r1 = R[3]*g[PLATFORM_X] + R[4]*g[PLATFORM_Y] + R[5]*g[PLATFORM_Z];
    const real r2 = R[6]*g[PLATFORM_X] + R[7]*g[PLATFORM_Y] + R[8]*g[PLATFORM_Z];
    /* from the anchor to the platform joint */
    const real d0 = p[0] + r0 - g[BASE_X] - qt*s0;
    const real d1 = p[1] + r1 - g[BASE_Y] - qt*s1;
    const real d2 = p[2] + r2 - g[BASE_Z] - qt*s2;
    const real t3 = s0*d0;
    const real t4 = s1*d1;
    const real t5 = s2*d2;
    *by_q = -g[GAIN]*t3 - g[GAIN]*t4 - g[GAIN]*t5;
    by_g[BASE_X] = -d0;
    by_g[BASE_Y] = -d1;
    by_g[BASE_Z] = -d2;
    by_g[PLATFORM_X] = R[0]*d0 + R[3]*d1 + R[6]*d2;
    by_g[PLATFORM_Y] = R[1]*d0 + R[4]*d1 + R[7]*d2;
    by_g[PLATFORM_Z] = R[2]*d0 + R[5]*d1 + R[8]*d2;
    by_g[OFFSET] = -t3 - t4 - t5;
    by_g[GAIN] = -q*t3 - q*t4 - q*t5;
    by_g[ROD] = -g[ROD];
    by_g[CRANK] = FN(fill)(0.0f);
    const real t6 = cu1*cu2;
    const real t7 = su1*cu2;
    const real t8 = qt*d0;
    const real t9 = qt*d1;
    const real t10 = qt*d2;
    by_g[TILT1] = -(-F[1]*t6 - F[2]*t7)*t8 - (-F[4]*t6 - F[5]*t7)*t9 - (-F[7]*t6 - F[8]*t7)*t10;
    by_g[TILT2] = -(F[0]*cu2 - su2*t0)*t8 - (F[3]*cu2 - su2*t1)*t9 - (F[6]*cu2 - su2*t2)*t10;
    by_g[PLATFORM_TILT1] = FN(fill)(0.0f);
    by_g[PLATFORM_TILT2] = FN(fill)(0.0f);
    by_g[HINGE_TILT1] = FN(fill)(0.0f);
    by_g[HINGE_TILT2] = FN(fill)(0.0f);
}
#endif

#ifndef NARROW
/*
 * crank: the sphere row by q and numbers
 *     Φ = (d·d - ρ²)/2,  d = p + R b - c,  c = base + crank Rot(axis, q̃) e, ρ = rod
 *     q̃ = gain q + offset
 * in  R[9]           platform to base, row by row
 * in  p[3]           platform origin [mm]
 * in  q              actuator coordinate [mm or rad]
 * in  g[16]          the limb's numbers
 * in  F[9]           fixed frame of the axis, in the base, row by row
 * out by_q           ∂Φ/∂q
 * out by_g[16]       ∂Φ/∂(the limb's numbers)
 * operations: 64 +, 120 *, 0 /, 0 sqrt
 */
INLINE void FN(crank_derivatives)(const real R[9], const real p[3], real q, const real g[16],
        const real F[9], real *by_q, real by_g[16])
{
    /* q̃ */
    const real qt = q*g[GAIN] + g[OFFSET];
    real su1, cu1;
    FN(sincos)(g[TILT1], &su1, &cu1);
    real su2, cu2;
    FN(sincos)(g[TILT2], &su2, &cu2);
    /* crank at q̃ = 0 */
    const real t0 = F[1]*su1 - F[2]*cu1;
    const real t1 = -t0;
    const real e0 = F[0]*cu2 - su2*t1;
    const real t2 = F[4]*su1 - F[5]*cu1;
    const real t3 = -t2;
    const real e1 = F[3]*cu2 - su2*t3;
    const real t4 = F[7]*su1 - F[8]*cu1;
    const real t5 = -t4;
    const real e2 = F[6]*cu2 - su2*t5;
    /* and at q̃ = 90° */
    const real t6 = F[1]*cu1;
    const real t7 = F[2]*su1;
    const real n0 = t6 + t7;
    const real t8 = F[4]*cu1;
    const real t9 = F[5]*su1;
    const real n1 = t8 + t9;
    const real t10 = F[7]*cu1;
    const real t11 = F[8]*su1;
    const real n2 = t10 + t11;
    real sq, cq;
    FN(sincos)(qt, &sq, &cq);
    /* R b */
    const real r0 = R[0]*g[PLATFORM_X] + R[1]*g[PLATFORM_Y] + R[2]*g[PLATFORM_Z];
    const real r1 = R[3]*g[PLATFORM_X] + R[4]*g[PLATFORM_Y] + R[5]*g[PLATFORM_Z];
    const real r2 = R[6]*g[PLATFORM_X] + R[7]*g[PLATFORM_Y] + R[8]*g[PLATFORM_Z];
    /* from the anchor to the platform joint */
    const real t12 = e0*cq + n0*sq;
    const real d0 = p[0] + r0 - g[BASE_X] - g[CRANK]*t12;
    const real t13 = e1*cq + n1*sq;
    const real d1 = p[1] + r1 - g[BASE_Y] - g[CRANK]*t13;
    const real t14 = e2*cq + n2*sq;
    const real d2 = p[2] + r2 - g[BASE_Z] - g[CRANK]*t14;
    const real t15 = g[CRANK]*cq;
    const real t16 = n0*t15;
    const real t17 = n1*t15;
    const real t18 = n2*t15;
    *by_q = (g[GAIN]*g[CRANK]*e0*sq - g[GAIN]*t16)*d0 + (g[GAIN]*g[CRANK]*e1*sq - g[GAIN]*t17)*d1 +
        (g[GAIN]*g[CRANK]*e2*sq - g[GAIN]*t18)*d2;
    by_g[BASE_X] = -d0;
    by_g[BASE_Y] = -d1;
    by_g[BASE_Z] = -d2;
    by_g[PLATFORM_X] = R[0]*d0 + R[3]*d1 + R[6]*d2;
    by_g[PLATFORM_Y] = R[1]*d0 + R[4]*d1 + R[7]*d2;
    by_g[PLATFORM_Z] = R[2]*d0 + R[5]*d1 + R[8]*d2;
    by_g[OFFSET] = (g[CRANK]*e0*sq - t16)*d0 + (g[CRANK]*e1*sq - t17)*d1 + (g[CRANK]*e2*sq -
        t18)*d2;
    by_g[GAIN] = (q*g[CRANK]*e0*sq - q*t16)*d0 + (q*g[CRANK]*e1*sq - q*t17)*d1 + (q*g[CRANK]*e2*sq
        - q*t18)*d2;
    by_g[ROD] = -g[ROD];
    by_g[CRANK] = -d0*t12 - d1*t13 - d2*t14;
    const real t19 = g[CRANK]*sq;
    by_g[TILT1] = (-(su2*t6 + su2*t7)*t15 - t1*t19)*d0 + (-(su2*t8 + su2*t9)*t15 - t3*t19)*d1 +
        (-(su2*t10 + su2*t11)*t15 - t5*t19)*d2;
    by_g[TILT2] = -(cu2*t0 - F[0]*su2)*d0*t15 - (cu2*t2 - F[3]*su2)*d1*t15 - (cu2*t4 -
        F[6]*su2)*d2*t15;
    by_g[PLATFORM_TILT1] = FN(fill)(0.0f);
    by_g[PLATFORM_TILT2] = FN(fill)(0.0f);
    by_g[HINGE_TILT1] = FN(fill)(0.0f);
    by_g[HINGE_TILT2] = FN(fill)(0.0f);
}
#endif

/*
 * length: covector of the anchor to covectors of q and the limb's numbers
 *     λ·∂c,  c = base, ρ = q̃
 *     q̃ = gain q + offset
 * in  q              actuator coordinate [mm or rad]
 * in  g[16]          the limb's numbers
 * in  pull[3]        λ, covector of the anchor
 * in  F[9]           fixed frame of the axis, in the base, row by row
 * out by_q           λ·∂c/∂q
 * out by_g[16]       λ·∂c/∂(the limb's numbers)
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(length_carry)(real q, const real g[16], const real pull[3], const real F[9],
        real *by_q, real by_g[16])
{
    *by_q = FN(fill)(0.0f);
    by_g[BASE_X] = pull[0];
    by_g[BASE_Y] = pull[1];
    by_g[BASE_Z] = pull[2];
    by_g[PLATFORM_X] = FN(fill)(0.0f);
    by_g[PLATFORM_Y] = FN(fill)(0.0f);
    by_g[PLATFORM_Z] = FN(fill)(0.0f);
    by_g[OFFSET] = FN(fill)(0.0f);
    by_g[GAIN] = FN(fill)(0.0f);
    by_g[ROD] = FN(fill)(0.0f);
    by_g[CRANK] = FN(fill)(0.0f);
    by_g[TILT1] = FN(fill)(0.0f);
    by_g[TILT2] = FN(fill)(0.0f);
    by_g[PLATFORM_TILT1] = FN(fill)(0.0f);
    by_g[PLATFORM_TILT2] = FN(fill)(0.0f);
    by_g[HINGE_TILT1] = FN(fill)(0.0f);
    by_g[HINGE_TILT2] = FN(fill)(0.0f);
}

#ifndef NARROW
/*
 * slider: covector of the anchor to covectors of q and the limb's numbers
 *     λ·∂c,  c = base + q̃ s, ρ = rod
 *     q̃ = gain q + offset
 * in  q              actuator coordinate [mm or rad]
 * in  g[16]          the limb's numbers
 * in  pull[3]        λ, covector of the anchor
 * in  F[9]           fixed frame of the axis, in the base, row by row
 * out by_q           λ·∂c/∂q
 * out by_g[16]       λ·∂c/∂(the limb's numbers)
 * operations: 19 +, 41 *, 0 /, 0 sqrt
 */
INLINE void FN(slider_carry)(real q, const real g[16], const real pull[3], const real F[9],
        real *by_q, real by_g[16])
{
    /* q̃ */
    const real qt = q*g[GAIN] + g[OFFSET];
    real su1, cu1;
    FN(sincos)(g[TILT1], &su1, &cu1);
    real su2, cu2;
    FN(sincos)(g[TILT2], &su2, &cu2);
    /* slider direction */
    const real t0 = F[2]*cu1 - F[1]*su1;
    const real s0 = F[0]*su2 + cu2*t0;
    const real t1 = F[5]*cu1 - F[4]*su1;
    const real s1 = F[3]*su2 + cu2*t1;
    const real t2 = F[8]*cu1 - F[7]*su1;
    const real s2 = F[6]*su2 + cu2*t2;
    const real t3 = pull[0]*s0 + pull[1]*s1 + pull[2]*s2;
    *by_q = g[GAIN]*t3;
    by_g[BASE_X] = pull[0];
    by_g[BASE_Y] = pull[1];
    by_g[BASE_Z] = pull[2];
    by_g[PLATFORM_X] = FN(fill)(0.0f);
    by_g[PLATFORM_Y] = FN(fill)(0.0f);
    by_g[PLATFORM_Z] = FN(fill)(0.0f);
    by_g[OFFSET] = t3;
    by_g[GAIN] = q*t3;
    by_g[ROD] = FN(fill)(0.0f);
    by_g[CRANK] = FN(fill)(0.0f);
    const real t4 = cu1*cu2;
    const real t5 = su1*cu2;
    const real t6 = pull[0]*qt;
    const real t7 = pull[1]*qt;
    const real t8 = pull[2]*qt;
    by_g[TILT1] = (-F[1]*t4 - F[2]*t5)*t6 + (-F[4]*t4 - F[5]*t5)*t7 + (-F[7]*t4 - F[8]*t5)*t8;
    by_g[TILT2] = (F[0]*cu2 - su2*t0)*t6 + (F[3]*cu2 - su2*t1)*t7 + (F[6]*cu2 - su2*t2)*t8;
    by_g[PLATFORM_TILT1] = FN(fill)(0.0f);
    by_g[PLATFORM_TILT2] = FN(fill)(0.0f);
    by_g[HINGE_TILT1] = FN(fill)(0.0f);
    by_g[HINGE_TILT2] = FN(fill)(0.0f);
}
#endif

#ifndef NARROW
/*
 * crank: covector of the anchor to covectors of q and the limb's numbers
 *     λ·∂c,  c = base + crank Rot(axis, q̃) e, ρ = rod
 *     q̃ = gain q + offset
 * in  q              actuator coordinate [mm or rad]
 * in  g[16]          the limb's numbers
 * in  pull[3]        λ, covector of the anchor
 * in  F[9]           fixed frame of the axis, in the base, row by row
 * out by_q           λ·∂c/∂q
 * out by_g[16]       λ·∂c/∂(the limb's numbers)
 * operations: 35 +, 70 *, 0 /, 0 sqrt
 */
INLINE void FN(crank_carry)(real q, const real g[16], const real pull[3], const real F[9],
        real *by_q, real by_g[16])
{
    /* q̃ */
    const real qt = q*g[GAIN] + g[OFFSET];
    real su1, cu1;
    FN(sincos)(g[TILT1], &su1, &cu1);
    real su2, cu2;
    FN(sincos)(g[TILT2], &su2, &cu2);
    /* crank at q̃ = 0 */
    const real t0 = F[1]*su1 - F[2]*cu1;
    const real t1 = -t0;
    const real e0 = F[0]*cu2 - su2*t1;
    const real t2 = F[4]*su1 - F[5]*cu1;
    const real t3 = -t2;
    const real e1 = F[3]*cu2 - su2*t3;
    const real t4 = F[7]*su1 - F[8]*cu1;
    const real t5 = -t4;
    const real e2 = F[6]*cu2 - su2*t5;
    /* and at q̃ = 90° */
    const real t6 = F[1]*cu1;
    const real t7 = F[2]*su1;
    const real n0 = t6 + t7;
    const real t8 = F[4]*cu1;
    const real t9 = F[5]*su1;
    const real n1 = t8 + t9;
    const real t10 = F[7]*cu1;
    const real t11 = F[8]*su1;
    const real n2 = t10 + t11;
    real sq, cq;
    FN(sincos)(qt, &sq, &cq);
    const real t12 = g[CRANK]*pull[0];
    const real t13 = g[CRANK]*pull[1];
    const real t14 = g[CRANK]*pull[2];
    const real t15 = (n0*t12 + n1*t13 + n2*t14)*cq;
    const real t16 = (e0*t12 + e1*t13 + e2*t14)*sq;
    *by_q = g[GAIN]*t15 - g[GAIN]*t16;
    by_g[BASE_X] = pull[0];
    by_g[BASE_Y] = pull[1];
    by_g[BASE_Z] = pull[2];
    by_g[PLATFORM_X] = FN(fill)(0.0f);
    by_g[PLATFORM_Y] = FN(fill)(0.0f);
    by_g[PLATFORM_Z] = FN(fill)(0.0f);
    by_g[OFFSET] = t15 - t16;
    by_g[GAIN] = q*t15 - q*t16;
    by_g[ROD] = FN(fill)(0.0f);
    by_g[CRANK] = pull[0]*(e0*cq + n0*sq) + pull[1]*(e1*cq + n1*sq) + pull[2]*(e2*cq + n2*sq);
    const real t17 = cq*t12;
    const real t18 = cq*t13;
    const real t19 = cq*t14;
    by_g[TILT1] = (su2*t6 + su2*t7)*t17 + (su2*t8 + su2*t9)*t18 + (su2*t10 + su2*t11)*t19 +
        sq*t1*t12 + sq*t3*t13 + sq*t5*t14;
    by_g[TILT2] = (cu2*t0 - F[0]*su2)*t17 + (cu2*t2 - F[3]*su2)*t18 + (cu2*t4 - F[6]*su2)*t19;
    by_g[PLATFORM_TILT1] = FN(fill)(0.0f);
    by_g[PLATFORM_TILT2] = FN(fill)(0.0f);
    by_g[HINGE_TILT1] = FN(fill)(0.0f);
    by_g[HINGE_TILT2] = FN(fill)(0.0f);
}
#endif

/*
 * base_plane: the platform joint stays in a plane of the base
 *     Φ = n·d,  d = p + R b - c
 * in  R[9]           platform to base, row by row
 * in  p[3]           platform origin [mm]
 * in  b[3]           platform joint, platform frame [mm]
 * in  c[3]           anchor [mm]
 * in  n[3]           base-side axis, base frame
 * in  a[3]           platform-side axis, platform frame
 * in  lever          λ [mm]
 * out phi            Φ [mm]
 * out omega[3]       ∂Φ/∂ω
 * out v[3]           ∂Φ/∂v
 * operations: 17 +, 18 *, 0 /, 0 sqrt
 */
INLINE void FN(base_plane_row)(const real R[9], const real p[3], const real b[3], const real c[3],
        const real n[3], const real a[3], real lever, real *phi, real omega[3], real v[3])
{
    /* R b */
    const real r0 = R[0]*b[0] + R[1]*b[1] + R[2]*b[2];
    const real r1 = R[3]*b[0] + R[4]*b[1] + R[5]*b[2];
    const real r2 = R[6]*b[0] + R[7]*b[1] + R[8]*b[2];
    /* from the anchor to the platform joint */
    const real d0 = p[0] + r0 - c[0];
    const real d1 = p[1] + r1 - c[1];
    const real d2 = p[2] + r2 - c[2];
    *phi = n[0]*d0 + n[1]*d1 + n[2]*d2;
    omega[0] = n[2]*r1 - n[1]*r2;
    omega[1] = n[0]*r2 - n[2]*r0;
    omega[2] = n[1]*r0 - n[0]*r1;
    v[0] = n[0];
    v[1] = n[1];
    v[2] = n[2];
}

#ifndef NARROW
/*
 * base_plane: the platform joint stays in a plane of the base
 *     Φ = n·d,  d = p + R b - c
 * in  R[9]           platform to base, row by row
 * in  p[3]           platform origin [mm]
 * in  c[3]           anchor [mm]
 * in  g[16]          the limb's numbers
 * in  F[9]           fixed frame of the base-side axis, in the base, row by row
 * in  P[9]           fixed frame of the platform-side axis, in the platform, row by row
 * in  lever          λ [mm]
 * out v[3]           ∂Φ/∂v = -∂Φ/∂c
 * out by_g[16]       ∂Φ/∂(the limb's numbers), c held
 * operations: 34 +, 50 *, 0 /, 0 sqrt
 */
INLINE void FN(base_plane_derivatives)(const real R[9], const real p[3], const real c[3],
        const real g[16], const real F[9], const real P[9], real lever, real v[3], real by_g[16])
{
    real su1, cu1;
    FN(sincos)(g[TILT1], &su1, &cu1);
    real su2, cu2;
    FN(sincos)(g[TILT2], &su2, &cu2);
    /* base-side axis */
    const real t0 = F[2]*cu1 - F[1]*su1;
    const real n0 = F[0]*su2 + cu2*t0;
    const real t1 = F[5]*cu1 - F[4]*su1;
    const real n1 = F[3]*su2 + cu2*t1;
    const real t2 = F[8]*cu1 - F[7]*su1;
    const real n2 = F[6]*su2 + cu2*t2;
    /* R b */
    const real r0 = R[0]*g[PLATFORM_X] + R[1]*g[PLATFORM_Y] + R[2]*g[PLATFORM_Z];
    const real r1 = R[3]*g[PLATFORM_X] + R[4]*g[PLATFORM_Y] + R[5]*g[PLATFORM_Z];
    const real r2 = R[6]*g[PLATFORM_X] + R[7]*g[PLATFORM_Y] + R[8]*g[PLATFORM_Z];
    /* from the anchor to the platform joint */
    const real d0 = p[0] + r0 - c[0];
    const real d1 = p[1] + r1 - c[1];
    const real d2 = p[2] + r2 - c[2];
    v[0] = n0;
    v[1] = n1;
    v[2] = n2;
    by_g[BASE_X] = FN(fill)(0.0f);
    by_g[BASE_Y] = FN(fill)(0.0f);
    by_g[BASE_Z] = FN(fill)(0.0f);
    by_g[PLATFORM_X] = R[0]*n0 + R[3]*n1 + R[6]*n2;
    by_g[PLATFORM_Y] = R[1]*n0 + R[4]*n1 + R[7]*n2;
    by_g[PLATFORM_Z] = R[2]*n0 + R[5]*n1 + R[8]*n2;
    by_g[OFFSET] = FN(fill)(0.0f);
    by_g[GAIN] = FN(fill)(0.0f);
    by_g[ROD] = FN(fill)(0.0f);
    by_g[CRANK] = FN(fill)(0.0f);
    const real t3 = cu1*cu2;
    const real t4 = su1*cu2;
    by_g[TILT1] = (-F[1]*t3 - F[2]*t4)*d0 + (-F[4]*t3 - F[5]*t4)*d1 + (-F[7]*t3 - F[8]*t4)*d2;
    by_g[TILT2] = (F[0]*cu2 - su2*t0)*d0 + (F[3]*cu2 - su2*t1)*d1 + (F[6]*cu2 - su2*t2)*d2;
    by_g[PLATFORM_TILT1] = FN(fill)(0.0f);
    by_g[PLATFORM_TILT2] = FN(fill)(0.0f);
    by_g[HINGE_TILT1] = FN(fill)(0.0f);
    by_g[HINGE_TILT2] = FN(fill)(0.0f);
}
#endif

/*
 * platform_plane: the leg stays square to the platform's revolute axis
 *     Φ = (R a)·d,  d = p + R b - c
 * in  R[9]           platform to base, row by row
 * in  p[3]           platform origin [mm]
 * in  b[3]           platform joint, platform frame [mm]
 * in  c[3]           anchor [mm]
 * in  n[3]           base-side axis, base frame
 * in  a[3]           platform-side axis, platform frame
 * in  lever          λ [mm]
 * out phi            Φ [mm]
 * out omega[3]       ∂Φ/∂ω
 * out v[3]           ∂Φ/∂v
 * operations: 29 +, 33 *, 0 /, 0 sqrt
 */
INLINE void FN(platform_plane_row)(const real R[9], const real p[3], const real b[3],
        const real c[3], const real n[3], const real a[3], real lever, real *phi, real omega[3],
        real v[3])
{
    /* R b */
    const real r0 = R[0]*b[0] + R[1]*b[1] + R[2]*b[2];
    const real r1 = R[3]*b[0] + R[4]*b[1] + R[5]*b[2];
    const real r2 = R[6]*b[0] + R[7]*b[1] + R[8]*b[2];
    /* from the anchor to the platform joint */
    const real d0 = p[0] + r0 - c[0];
    const real d1 = p[1] + r1 - c[1];
    const real d2 = p[2] + r2 - c[2];
    const real Ra0 = R[0]*a[0] + R[1]*a[1] + R[2]*a[2];
    const real Ra1 = R[3]*a[0] + R[4]*a[1] + R[5]*a[2];
    const real Ra2 = R[6]*a[0] + R[7]*a[1] + R[8]*a[2];
    *phi = d0*Ra0 + d1*Ra1 + d2*Ra2;
    omega[0] = r1*Ra2 + d2*Ra1 - r2*Ra1 - d1*Ra2;
    omega[1] = r2*Ra0 + d0*Ra2 - r0*Ra2 - d2*Ra0;
    omega[2] = r0*Ra1 + d1*Ra0 - r1*Ra0 - d0*Ra1;
    v[0] = Ra0;
    v[1] = Ra1;
    v[2] = Ra2;
}

#ifndef NARROW
/*
 * platform_plane: the leg stays square to the platform's revolute axis
 *     Φ = (R a)·d,  d = p + R b - c
 * in  R[9]           platform to base, row by row
 * in  p[3]           platform origin [mm]
 * in  c[3]           anchor [mm]
 * in  g[16]          the limb's numbers
 * in  F[9]           fixed frame of the base-side axis, in the base, row by row
 * in  P[9]           fixed frame of the platform-side axis, in the platform, row by row
 * in  lever          λ [mm]
 * out v[3]           ∂Φ/∂v = -∂Φ/∂c
 * out by_g[16]       ∂Φ/∂(the limb's numbers), c held
 * operations: 52 +, 77 *, 0 /, 0 sqrt
 */
INLINE void FN(platform_plane_derivatives)(const real R[9], const real p[3], const real c[3],
        const real g[16], const real F[9], const real P[9], real lever, real v[3], real by_g[16])
{
    real sw1, cw1;
    FN(sincos)(g[PLATFORM_TILT1], &sw1, &cw1);
    real sw2, cw2;
    FN(sincos)(g[PLATFORM_TILT2], &sw2, &cw2);
    /* platform-side axis */
    const real t0 = P[2]*cw1 - P[1]*sw1;
    const real a0 = P[0]*sw2 + cw2*t0;
    const real t1 = P[5]*cw1 - P[4]*sw1;
    const real a1 = P[3]*sw2 + cw2*t1;
    const real t2 = P[8]*cw1 - P[7]*sw1;
    const real a2 = P[6]*sw2 + cw2*t2;
    /* R b */
    const real r0 = R[0]*g[PLATFORM_X] + R[1]*g[PLATFORM_Y] + R[2]*g[PLATFORM_Z];
    const real r1 = R[3]*g[PLATFORM_X] + R[4]*g[PLATFORM_Y] + R[5]*g[PLATFORM_Z];
    const real r2 = R[6]*g[PLATFORM_X] + R[7]*g[PLATFORM_Y] + R[8]*g[PLATFORM_Z];
    /* from the anchor to the platform joint */
    const real d0 = p[0] + r0 - c[0];
    const real d1 = p[1] + r1 - c[1];
    const real d2 = p[2] + r2 - c[2];
    const real Ra0 = R[0]*a0 + R[1]*a1 + R[2]*a2;
    const real Ra1 = R[3]*a0 + R[4]*a1 + R[5]*a2;
    const real Ra2 = R[6]*a0 + R[7]*a1 + R[8]*a2;
    v[0] = Ra0;
    v[1] = Ra1;
    v[2] = Ra2;
    by_g[BASE_X] = FN(fill)(0.0f);
    by_g[BASE_Y] = FN(fill)(0.0f);
    by_g[BASE_Z] = FN(fill)(0.0f);
    by_g[PLATFORM_X] = R[0]*Ra0 + R[3]*Ra1 + R[6]*Ra2;
    by_g[PLATFORM_Y] = R[1]*Ra0 + R[4]*Ra1 + R[7]*Ra2;
    by_g[PLATFORM_Z] = R[2]*Ra0 + R[5]*Ra1 + R[8]*Ra2;
    by_g[OFFSET] = FN(fill)(0.0f);
    by_g[GAIN] = FN(fill)(0.0f);
    by_g[ROD] = FN(fill)(0.0f);
    by_g[CRANK] = FN(fill)(0.0f);
    by_g[TILT1] = FN(fill)(0.0f);
    by_g[TILT2] = FN(fill)(0.0f);
    const real t3 = cw1*cw2;
    const real t4 = sw1*cw2;
    const real t5 = -P[1]*t3 - P[2]*t4;
    const real t6 = -P[4]*t3 - P[5]*t4;
    const real t7 = -P[7]*t3 - P[8]*t4;
    by_g[PLATFORM_TILT1] = (R[0]*t5 + R[1]*t6 + R[2]*t7)*d0 + (R[3]*t5 + R[4]*t6 + R[5]*t7)*d1 +
        (R[6]*t5 + R[7]*t6 + R[8]*t7)*d2;
    const real t8 = P[0]*cw2 - sw2*t0;
    const real t9 = P[3]*cw2 - sw2*t1;
    const real t10 = P[6]*cw2 - sw2*t2;
    by_g[PLATFORM_TILT2] = (R[0]*t8 + R[1]*t9 + R[2]*t10)*d0 + (R[3]*t8 + R[4]*t9 + R[5]*t10)*d1 +
        (R[6]*t8 + R[7]*t9 + R[8]*t10)*d2;
    by_g[HINGE_TILT1] = FN(fill)(0.0f);
    by_g[HINGE_TILT2] = FN(fill)(0.0f);
}
#endif

/*
 * couple: revolute and universal axis stay square, at the lever λ
 *     Φ = λ (R a)·n,  d = p + R b - c
 * in  R[9]           platform to base, row by row
 * in  p[3]           platform origin [mm]
 * in  b[3]           platform joint, platform frame [mm]
 * in  c[3]           anchor [mm]
 * in  n[3]           base-side axis, base frame
 * in  a[3]           platform-side axis, platform frame
 * in  lever          λ [mm]
 * out phi            Φ [mm]
 * out omega[3]       ∂Φ/∂ω
 * out v[3]           ∂Φ/∂v
 * operations: 11 +, 24 *, 0 /, 0 sqrt
 */
INLINE void FN(couple_row)(const real R[9], const real p[3], const real b[3], const real c[3],
        const real n[3], const real a[3], real lever, real *phi, real omega[3], real v[3])
{
    const real Ra0 = R[0]*a[0] + R[1]*a[1] + R[2]*a[2];
    const real Ra1 = R[3]*a[0] + R[4]*a[1] + R[5]*a[2];
    const real Ra2 = R[6]*a[0] + R[7]*a[1] + R[8]*a[2];
    *phi = (n[0]*Ra0 + n[1]*Ra1 + n[2]*Ra2)*lever;
    const real t0 = n[2]*lever;
    omega[0] = Ra1*t0 - n[1]*lever*Ra2;
    omega[1] = n[0]*lever*Ra2 - Ra0*t0;
    omega[2] = n[1]*lever*Ra0 - n[0]*lever*Ra1;
    v[0] = FN(fill)(0.0f);
    v[1] = FN(fill)(0.0f);
    v[2] = FN(fill)(0.0f);
}

#ifndef NARROW
/*
 * couple: revolute and universal axis stay square, at the lever λ
 *     Φ = λ (R a)·n,  d = p + R b - c
 * in  R[9]           platform to base, row by row
 * in  p[3]           platform origin [mm]
 * in  c[3]           anchor [mm]
 * in  g[16]          the limb's numbers
 * in  F[9]           fixed frame of the base-side axis, in the base, row by row
 * in  P[9]           fixed frame of the platform-side axis, in the platform, row by row
 * in  lever          λ [mm]
 * out v[3]           ∂Φ/∂v = -∂Φ/∂c
 * out by_g[16]       ∂Φ/∂(the limb's numbers), c held
 * operations: 50 +, 97 *, 0 /, 0 sqrt
 */
INLINE void FN(couple_derivatives)(const real R[9], const real p[3], const real c[3],
        const real g[16], const real F[9], const real P[9], real lever, real v[3], real by_g[16])
{
    real su1, cu1;
    FN(sincos)(g[TILT1], &su1, &cu1);
    real su2, cu2;
    FN(sincos)(g[TILT2], &su2, &cu2);
    /* base-side axis */
    const real t0 = F[2]*cu1 - F[1]*su1;
    const real n0 = F[0]*su2 + cu2*t0;
    const real t1 = F[5]*cu1 - F[4]*su1;
    const real n1 = F[3]*su2 + cu2*t1;
    const real t2 = F[8]*cu1 - F[7]*su1;
    const real n2 = F[6]*su2 + cu2*t2;
    real sw1, cw1;
    FN(sincos)(g[PLATFORM_TILT1], &sw1, &cw1);
    real sw2, cw2;
    FN(sincos)(g[PLATFORM_TILT2], &sw2, &cw2);
    /* platform-side axis */
    const real t3 = P[2]*cw1 - P[1]*sw1;
    const real a0 = P[0]*sw2 + cw2*t3;
    const real t4 = P[5]*cw1 - P[4]*sw1;
    const real a1 = P[3]*sw2 + cw2*t4;
    const real t5 = P[8]*cw1 - P[7]*sw1;
    const real a2 = P[6]*sw2 + cw2*t5;
    const real Ra0 = R[0]*a0 + R[1]*a1 + R[2]*a2;
    const real Ra1 = R[3]*a0 + R[4]*a1 + R[5]*a2;
    const real Ra2 = R[6]*a0 + R[7]*a1 + R[8]*a2;
    v[0] = FN(fill)(0.0f);
    v[1] = FN(fill)(0.0f);
    v[2] = FN(fill)(0.0f);
    by_g[BASE_X] = FN(fill)(0.0f);
    by_g[BASE_Y] = FN(fill)(0.0f);
    by_g[BASE_Z] = FN(fill)(0.0f);
    by_g[PLATFORM_X] = FN(fill)(0.0f);
    by_g[PLATFORM_Y] = FN(fill)(0.0f);
    by_g[PLATFORM_Z] = FN(fill)(0.0f);
    by_g[OFFSET] = FN(fill)(0.0f);
    by_g[GAIN] = FN(fill)(0.0f);
    by_g[ROD] = FN(fill)(0.0f);
    by_g[CRANK] = FN(fill)(0.0f);
    const real t6 = cu1*cu2;
    const real t7 = su1*cu2;
    const real t8 = lever*Ra0;
    const real t9 = lever*Ra1;
    const real t10 = lever*Ra2;
    by_g[TILT1] = (-F[1]*t6 - F[2]*t7)*t8 + (-F[4]*t6 - F[5]*t7)*t9 + (-F[7]*t6 - F[8]*t7)*t10;
    by_g[TILT2] = (F[0]*cu2 - su2*t0)*t8 + (F[3]*cu2 - su2*t1)*t9 + (F[6]*cu2 - su2*t2)*t10;
    const real t11 = cw1*cw2;
    const real t12 = sw1*cw2;
    const real t13 = -P[1]*t11 - P[2]*t12;
    const real t14 = -P[4]*t11 - P[5]*t12;
    const real t15 = -P[7]*t11 - P[8]*t12;
    const real t16 = n0*lever;
    const real t17 = n1*lever;
    const real t18 = n2*lever;
    by_g[PLATFORM_TILT1] = (R[0]*t13 + R[1]*t14 + R[2]*t15)*t16 + (R[3]*t13 + R[4]*t14 +
        R[5]*t15)*t17 + (R[6]*t13 + R[7]*t14 + R[8]*t15)*t18;
    const real t19 = P[0]*cw2 - sw2*t3;
    const real t20 = P[3]*cw2 - sw2*t4;
    const real t21 = P[6]*cw2 - sw2*t5;
    by_g[PLATFORM_TILT2] = (R[0]*t19 + R[1]*t20 + R[2]*t21)*t16 + (R[3]*t19 + R[4]*t20 +
        R[5]*t21)*t17 + (R[6]*t19 + R[7]*t20 + R[8]*t21)*t18;
    by_g[HINGE_TILT1] = FN(fill)(0.0f);
    by_g[HINGE_TILT2] = FN(fill)(0.0f);
}
#endif

/*
 * hinge_plane: the rod stays square to the axis it swings about on the carriage
 *     Φ = n·d,  d = p + R b - c
 * in  R[9]           platform to base, row by row
 * in  p[3]           platform origin [mm]
 * in  b[3]           platform joint, platform frame [mm]
 * in  c[3]           anchor [mm]
 * in  n[3]           base-side axis, base frame
 * in  a[3]           platform-side axis, platform frame
 * in  lever          λ [mm]
 * out phi            Φ [mm]
 * out omega[3]       ∂Φ/∂ω
 * out v[3]           ∂Φ/∂v
 * operations: 17 +, 18 *, 0 /, 0 sqrt
 */
INLINE void FN(hinge_plane_row)(const real R[9], const real p[3], const real b[3], const real c[3],
        const real n[3], const real a[3], real lever, real *phi, real omega[3], real v[3])
{
    /* R b */
    const real r0 = R[0]*b[0] + R[1]*b[1] + R[2]*b[2];
    const real r1 = R[3]*b[0] + R[4]*b[1] + R[5]*b[2];
    const real r2 = R[6]*b[0] + R[7]*b[1] + R[8]*b[2];
    /* from the anchor to the platform joint */
    const real d0 = p[0] + r0 - c[0];
    const real d1 = p[1] + r1 - c[1];
    const real d2 = p[2] + r2 - c[2];
    *phi = n[0]*d0 + n[1]*d1 + n[2]*d2;
    omega[0] = n[2]*r1 - n[1]*r2;
    omega[1] = n[0]*r2 - n[2]*r0;
    omega[2] = n[1]*r0 - n[0]*r1;
    v[0] = n[0];
    v[1] = n[1];
    v[2] = n[2];
}

#ifndef NARROW
/*
 * hinge_plane: the rod stays square to the axis it swings about on the carriage
 *     Φ = n·d,  d = p + R b - c
 * in  R[9]           platform to base, row by row
 * in  p[3]           platform origin [mm]
 * in  c[3]           anchor [mm]
 * in  g[16]          the limb's numbers
 * in  F[9]           fixed frame of the base-side axis, in the base, row by row
 * in  P[9]           fixed frame of the platform-side axis, in the platform, row by row
 * in  lever          λ [mm]
 * out v[3]           ∂Φ/∂v = -∂Φ/∂c
 * out by_g[16]       ∂Φ/∂(the limb's numbers), c held
 * operations: 34 +, 50 *, 0 /, 0 sqrt
 */
INLINE void FN(hinge_plane_derivatives)(const real R[9], const real p[3], const real c[3],
        const real g[16], const real F[9], const real P[9], real lever, real v[3], real by_g[16])
{
    real su1, cu1;
    FN(sincos)(g[HINGE_TILT1], &su1, &cu1);
    real su2, cu2;
    FN(sincos)(g[HINGE_TILT2], &su2, &cu2);
    /* base-side axis */
    const real t0 = F[2]*cu1 - F[1]*su1;
    const real n0 = F[0]*su2 + cu2*t0;
    const real t1 = F[5]*cu1 - F[4]*su1;
    const real n1 = F[3]*su2 + cu2*t1;
    const real t2 = F[8]*cu1 - F[7]*su1;
    const real n2 = F[6]*su2 + cu2*t2;
    /* R b */
    const real r0 = R[0]*g[PLATFORM_X] + R[1]*g[PLATFORM_Y] + R[2]*g[PLATFORM_Z];
    const real r1 = R[3]*g[PLATFORM_X] + R[4]*g[PLATFORM_Y] + R[5]*g[PLATFORM_Z];
    const real r2 = R[6]*g[PLATFORM_X] + R[7]*g[PLATFORM_Y] + R[8]*g[PLATFORM_Z];
    /* from the anchor to the platform joint */
    const real d0 = p[0] + r0 - c[0];
    const real d1 = p[1] + r1 - c[1];
    const real d2 = p[2] + r2 - c[2];
    v[0] = n0;
    v[1] = n1;
    v[2] = n2;
    by_g[BASE_X] = FN(fill)(0.0f);
    by_g[BASE_Y] = FN(fill)(0.0f);
    by_g[BASE_Z] = FN(fill)(0.0f);
    by_g[PLATFORM_X] = R[0]*n0 + R[3]*n1 + R[6]*n2;
    by_g[PLATFORM_Y] = R[1]*n0 + R[4]*n1 + R[7]*n2;
    by_g[PLATFORM_Z] = R[2]*n0 + R[5]*n1 + R[8]*n2;
    by_g[OFFSET] = FN(fill)(0.0f);
    by_g[GAIN] = FN(fill)(0.0f);
    by_g[ROD] = FN(fill)(0.0f);
    by_g[CRANK] = FN(fill)(0.0f);
    by_g[TILT1] = FN(fill)(0.0f);
    by_g[TILT2] = FN(fill)(0.0f);
    by_g[PLATFORM_TILT1] = FN(fill)(0.0f);
    by_g[PLATFORM_TILT2] = FN(fill)(0.0f);
    const real t3 = cu1*cu2;
    const real t4 = su1*cu2;
    by_g[HINGE_TILT1] = (-F[1]*t3 - F[2]*t4)*d0 + (-F[4]*t3 - F[5]*t4)*d1 + (-F[7]*t3 - F[8]*t4)*d2;
    by_g[HINGE_TILT2] = (F[0]*cu2 - su2*t0)*d0 + (F[3]*cu2 - su2*t1)*d1 + (F[6]*cu2 - su2*t2)*d2;
}
#endif

/*
 * rate of the row as the limb changes
 *     Φ = (d·d - ρ²)/2,  d = p + R b - c
 * in  R[9]           platform to base, row by row
 * in  p[3]           platform origin [mm]
 * in  b[3]           platform joint
 * in  b_rate[3]      its rate
 * in  c[3]           anchor
 * in  c_rate[3]      its rate
 * in  rho2           ρ²
 * in  rho2_rate      its rate
 * out rate           Φ's rate
 * operations: 24 +, 22 *, 0 /, 0 sqrt
 */
INLINE void FN(sphere_rate)(const real R[9], const real p[3], const real b[3],
        const real b_rate[3], const real c[3], const real c_rate[3], real rho2, real rho2_rate,
        real *rate)
{
    const real d0 = R[0]*b[0] + R[1]*b[1] + R[2]*b[2] + p[0] - c[0];
    const real d1 = R[3]*b[0] + R[4]*b[1] + R[5]*b[2] + p[1] - c[1];
    const real d2 = R[6]*b[0] + R[7]*b[1] + R[8]*b[2] + p[2] - c[2];
    *rate = (R[0]*b_rate[0] + R[1]*b_rate[1] + R[2]*b_rate[2] - c_rate[0])*d0 + (R[3]*b_rate[0] +
        R[4]*b_rate[1] + R[5]*b_rate[2] - c_rate[1])*d1 + (R[6]*b_rate[0] + R[7]*b_rate[1] +
        R[8]*b_rate[2] - c_rate[2])*d2 - 0.5f*rho2_rate;
}

/*
 * rate of the row as the limb changes
 *     Φ = n·d,  d = p + R b - c
 * in  R[9]           platform to base, row by row
 * in  p[3]           platform origin [mm]
 * in  b[3]           platform joint
 * in  b_rate[3]      its rate
 * in  c[3]           anchor
 * in  c_rate[3]      its rate
 * in  n[3]           base-side axis
 * in  n_rate[3]      its rate
 * in  a[3]           platform-side axis
 * in  a_rate[3]      its rate
 * in  lever          λ
 * out rate           Φ's rate
 * operations: 26 +, 24 *, 0 /, 0 sqrt
 */
INLINE void FN(base_plane_rate)(const real R[9], const real p[3], const real b[3],
        const real b_rate[3], const real c[3], const real c_rate[3], const real n[3],
        const real n_rate[3], const real a[3], const real a_rate[3], real lever, real *rate)
{
    const real d0 = R[0]*b[0] + R[1]*b[1] + R[2]*b[2] + p[0] - c[0];
    const real d1 = R[3]*b[0] + R[4]*b[1] + R[5]*b[2] + p[1] - c[1];
    const real d2 = R[6]*b[0] + R[7]*b[1] + R[8]*b[2] + p[2] - c[2];
    *rate = (R[0]*b_rate[0] + R[1]*b_rate[1] + R[2]*b_rate[2] - c_rate[0])*n[0] + (R[3]*b_rate[0] +
        R[4]*b_rate[1] + R[5]*b_rate[2] - c_rate[1])*n[1] + (R[6]*b_rate[0] + R[7]*b_rate[1] +
        R[8]*b_rate[2] - c_rate[2])*n[2] + n_rate[0]*d0 + n_rate[1]*d1 + n_rate[2]*d2;
}

/*
 * rate of the row as the limb changes
 *     Φ = (R a)·d,  d = p + R b - c
 * in  R[9]           platform to base, row by row
 * in  p[3]           platform origin [mm]
 * in  b[3]           platform joint
 * in  b_rate[3]      its rate
 * in  c[3]           anchor
 * in  c_rate[3]      its rate
 * in  n[3]           base-side axis
 * in  n_rate[3]      its rate
 * in  a[3]           platform-side axis
 * in  a_rate[3]      its rate
 * in  lever          λ
 * out rate           Φ's rate
 * operations: 38 +, 42 *, 0 /, 0 sqrt
 */
INLINE void FN(platform_plane_rate)(const real R[9], const real p[3], const real b[3],
        const real b_rate[3], const real c[3], const real c_rate[3], const real n[3],
        const real n_rate[3], const real a[3], const real a_rate[3], real lever, real *rate)
{
    const real d0 = R[0]*b[0] + R[1]*b[1] + R[2]*b[2] + p[0] - c[0];
    const real d1 = R[3]*b[0] + R[4]*b[1] + R[5]*b[2] + p[1] - c[1];
    const real d2 = R[6]*b[0] + R[7]*b[1] + R[8]*b[2] + p[2] - c[2];
    *rate = (R[0]*b_rate[0] + R[1]*b_rate[1] + R[2]*b_rate[2] - c_rate[0])*(R[0]*a[0] + R[1]*a[1] +
        R[2]*a[2]) + (R[0]*a_rate[0] + R[1]*a_rate[1] + R[2]*a_rate[2])*d0 + (R[3]*b_rate[0] +
        R[4]*b_rate[1] + R[5]*b_rate[2] - c_rate[1])*(R[3]*a[0] + R[4]*a[1] + R[5]*a[2]) +
        (R[3]*a_rate[0] + R[4]*a_rate[1] + R[5]*a_rate[2])*d1 + (R[6]*b_rate[0] + R[7]*b_rate[1] +
        R[8]*b_rate[2] - c_rate[2])*(R[6]*a[0] + R[7]*a[1] + R[8]*a[2]) + (R[6]*a_rate[0] +
        R[7]*a_rate[1] + R[8]*a_rate[2])*d2;
}

/*
 * rate of the row as the limb changes
 *     Φ = λ (R a)·n,  d = p + R b - c
 * in  R[9]           platform to base, row by row
 * in  p[3]           platform origin [mm]
 * in  b[3]           platform joint
 * in  b_rate[3]      its rate
 * in  c[3]           anchor
 * in  c_rate[3]      its rate
 * in  n[3]           base-side axis
 * in  n_rate[3]      its rate
 * in  a[3]           platform-side axis
 * in  a_rate[3]      its rate
 * in  lever          λ
 * out rate           Φ's rate
 * operations: 17 +, 25 *, 0 /, 0 sqrt
 */
INLINE void FN(couple_rate)(const real R[9], const real p[3], const real b[3],
        const real b_rate[3], const real c[3], const real c_rate[3], const real n[3],
        const real n_rate[3], const real a[3], const real a_rate[3], real lever, real *rate)
{
    *rate = ((R[0]*a_rate[0] + R[1]*a_rate[1] + R[2]*a_rate[2])*n[0] + (R[0]*a[0] + R[1]*a[1] +
        R[2]*a[2])*n_rate[0] + (R[3]*a_rate[0] + R[4]*a_rate[1] + R[5]*a_rate[2])*n[1] + (R[3]*a[0]
        + R[4]*a[1] + R[5]*a[2])*n_rate[1] + (R[6]*a_rate[0] + R[7]*a_rate[1] +
        R[8]*a_rate[2])*n[2] + (R[6]*a[0] + R[7]*a[1] + R[8]*a[2])*n_rate[2])*lever;
}

/*
 * rate of the row as the limb changes
 *     Φ = n·d,  d = p + R b - c
 * in  R[9]           platform to base, row by row
 * in  p[3]           platform origin [mm]
 * in  b[3]           platform joint
 * in  b_rate[3]      its rate
 * in  c[3]           anchor
 * in  c_rate[3]      its rate
 * in  n[3]           base-side axis
 * in  n_rate[3]      its rate
 * in  a[3]           platform-side axis
 * in  a_rate[3]      its rate
 * in  lever          λ
 * out rate           Φ's rate
 * operations: 26 +, 24 *, 0 /, 0 sqrt
 */
INLINE void FN(hinge_plane_rate)(const real R[9], const real p[3], const real b[3],
        const real b_rate[3], const real c[3], const real c_rate[3], const real n[3],
        const real n_rate[3], const real a[3], const real a_rate[3], real lever, real *rate)
{
    const real d0 = R[0]*b[0] + R[1]*b[1] + R[2]*b[2] + p[0] - c[0];
    const real d1 = R[3]*b[0] + R[4]*b[1] + R[5]*b[2] + p[1] - c[1];
    const real d2 = R[6]*b[0] + R[7]*b[1] + R[8]*b[2] + p[2] - c[2];
    *rate = (R[0]*b_rate[0] + R[1]*b_rate[1] + R[2]*b_rate[2] - c_rate[0])*n[0] + (R[3]*b_rate[0] +
        R[4]*b_rate[1] + R[5]*b_rate[2] - c_rate[1])*n[1] + (R[6]*b_rate[0] + R[7]*b_rate[1] +
        R[8]*b_rate[2] - c_rate[2])*n[2] + n_rate[0]*d0 + n_rate[1]*d1 + n_rate[2]*d2;
}
