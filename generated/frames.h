/* Generated from derive/frames.py by `python -m derive`; never edited by hand.
 * derivation d28ffed79d024c2d
 * `real` is a number or a lane of numbers, FN(name) the function for that type. */

#ifndef NARROW
/*
 * one pose after another
 *     T = A B: R = Ra Rb, p = pa + Ra pb
 * in  a[6]           first: x y z [mm], α β γ [rad]
 * in  b[6]           second: x y z [mm], α β γ [rad]
 * out pose[6]        x y z [mm], α β γ [rad]
 * operations: 34 +, 62 *, 0 /, 1 sqrt
 */
INLINE void FN(pose_compose)(const real a[6], const real b[6], real pose[6])
{
    real sa_a, ca_a;
    FN(sincos)(a[3], &sa_a, &ca_a);
    real sa_b, ca_b;
    FN(sincos)(a[4], &sa_b, &ca_b);
    real sa_g, ca_g;
    FN(sincos)(a[5], &sa_g, &ca_g);
    const real a_R0 = ca_b*ca_g;
    const real t0 = ca_a*sa_g;
    const real a_R1 = sa_a*sa_b*ca_g - t0;
    const real t1 = sa_a*sa_g;
    const real t2 = ca_a*ca_g;
    const real a_R2 = sa_b*t2 + t1;
    const real a_R3 = ca_b*sa_g;
    const real a_R4 = sa_b*t1 + t2;
    const real a_R5 = sa_b*t0 - sa_a*ca_g;
    const real a_R7 = sa_a*ca_b;
    const real a_R8 = ca_a*ca_b;
    real sb_a, cb_a;
    FN(sincos)(b[3], &sb_a, &cb_a);
    real sb_b, cb_b;
    FN(sincos)(b[4], &sb_b, &cb_b);
    real sb_g, cb_g;
    FN(sincos)(b[5], &sb_g, &cb_g);
    const real b_R0 = cb_b*cb_g;
    const real t3 = cb_a*sb_g;
    const real b_R1 = sb_a*sb_b*cb_g - t3;
    const real t4 = sb_a*sb_g;
    const real t5 = cb_a*cb_g;
    const real b_R2 = sb_b*t5 + t4;
    const real b_R3 = cb_b*sb_g;
    const real b_R4 = sb_b*t4 + t5;
    const real b_R5 = sb_b*t3 - sb_a*cb_g;
    const real b_R7 = sb_a*cb_b;
    const real b_R8 = cb_a*cb_b;
    const real R0 = a_R0*b_R0 + a_R1*b_R3 - a_R2*sb_b;
    const real R1 = a_R0*b_R1 + a_R1*b_R4 + a_R2*b_R7;
    const real R2 = a_R0*b_R2 + a_R1*b_R5 + a_R2*b_R8;
    const real R3 = a_R3*b_R0 + a_R4*b_R3 - a_R5*sb_b;
    const real R4 = a_R3*b_R1 + a_R4*b_R4 + a_R5*b_R7;
    const real R5 = a_R3*b_R2 + a_R4*b_R5 + a_R5*b_R8;
    const real R6 = a_R7*b_R3 - sa_b*b_R0 - a_R8*sb_b;
    const real gamma = arctangent2(R3, R0);
    /* α from Rz(γ)ᵀ R, which holds whatever γ is near β = ±90° */
    real sg, cg;
    FN(sincos)(gamma, &sg, &cg);
    const real alpha = arctangent2(R2*sg - R5*cg, R4*cg - R1*sg);
    const real beta = arctangent2(-R6, FN(root)(R0*R0 + R3*R3));
    pose[0] = a[0] + a_R0*b[0] + a_R1*b[1] + a_R2*b[2];
    pose[1] = a[1] + a_R3*b[0] + a_R4*b[1] + a_R5*b[2];
    pose[2] = a[2] + a_R7*b[1] + a_R8*b[2] - sa_b*b[0];
    pose[3] = alpha;
    pose[4] = beta;
    pose[5] = gamma;
}
#endif

#ifndef NARROW
/*
 * the inverse of a pose
 *     T⁻¹: Rᵀ, -Rᵀ p
 * in  a[6]           pose: x y z [mm], α β γ [rad]
 * out pose[6]        x y z [mm], α β γ [rad]
 * operations: 13 +, 28 *, 0 /, 1 sqrt
 */
INLINE void FN(pose_invert)(const real a[6], real pose[6])
{
    real sa_a, ca_a;
    FN(sincos)(a[3], &sa_a, &ca_a);
    real sa_b, ca_b;
    FN(sincos)(a[4], &sa_b, &ca_b);
    real sa_g, ca_g;
    FN(sincos)(a[5], &sa_g, &ca_g);
    const real a_R0 = ca_b*ca_g;
    const real t0 = ca_a*sa_g;
    const real a_R1 = sa_a*sa_b*ca_g - t0;
    const real t1 = sa_a*sa_g;
    const real t2 = ca_a*ca_g;
    const real a_R2 = sa_b*t2 + t1;
    const real a_R3 = ca_b*sa_g;
    const real a_R4 = sa_b*t1 + t2;
    const real a_R5 = sa_b*t0 - sa_a*ca_g;
    const real a_R7 = sa_a*ca_b;
    const real a_R8 = ca_a*ca_b;
    const real gamma = arctangent2(a_R1, a_R0);
    /* α from Rz(γ)ᵀ R, which holds whatever γ is near β = ±90° */
    real sg, cg;
    FN(sincos)(gamma, &sg, &cg);
    const real alpha = arctangent2(-sa_b*sg - a_R7*cg, a_R4*cg - a_R3*sg);
    const real beta = arctangent2(-a_R2, FN(root)(a_R0*a_R0 + a_R1*a_R1));
    pose[0] = a[2]*sa_b - a[0]*a_R0 - a[1]*a_R3;
    pose[1] = -a[0]*a_R1 - a[1]*a_R4 - a[2]*a_R7;
    pose[2] = -a[0]*a_R2 - a[1]*a_R5 - a[2]*a_R8;
    pose[3] = alpha;
    pose[4] = beta;
    pose[5] = gamma;
}
#endif

#ifndef NARROW
/*
 * rates of A T C by those of T, all as x y z α β γ
 *     ω' = A ω, v' = A (v + ω × R c);  ω = E (α̇, β̇, γ̇)
 * in  a[6]           A: x y z [mm], α β γ [rad]
 * in  b[6]           T: x y z [mm], α β γ [rad]
 * in  c[6]           C; only its origin matters
 * in  d[6]           A T C
 * out rates[36]      6 x 6, row by row
 * operations: 53 +, 107 *, 1 /, 0 sqrt
 */
INLINE void FN(pose_compose_rates)(const real a[6], const real b[6], const real c[6],
        const real d[6], real rates[36])
{
    real sa_a, ca_a;
    FN(sincos)(a[3], &sa_a, &ca_a);
    real sa_b, ca_b;
    FN(sincos)(a[4], &sa_b, &ca_b);
    real sa_g, ca_g;
    FN(sincos)(a[5], &sa_g, &ca_g);
    const real a_R0 = ca_b*ca_g;
    const real t0 = ca_a*sa_g;
    const real a_R1 = sa_a*sa_b*ca_g - t0;
    const real t1 = sa_a*sa_g;
    const real t2 = ca_a*ca_g;
    const real a_R2 = sa_b*t2 + t1;
    const real a_R3 = ca_b*sa_g;
    const real a_R4 = sa_b*t1 + t2;
    const real a_R5 = sa_b*t0 - sa_a*ca_g;
    const real a_R7 = sa_a*ca_b;
    const real a_R8 = ca_a*ca_b;
    real sb_a, cb_a;
    FN(sincos)(b[3], &sb_a, &cb_a);
    real sb_b, cb_b;
    FN(sincos)(b[4], &sb_b, &cb_b);
    real sb_g, cb_g;
    FN(sincos)(b[5], &sb_g, &cb_g);
    const real t3 = cb_b*cb_g;
    const real b_R0 = t3;
    const real t4 = cb_a*sb_g;
    const real b_R1 = sb_a*sb_b*cb_g - t4;
    const real t5 = sb_a*sb_g;
    const real t6 = cb_a*cb_g;
    const real b_R2 = sb_b*t6 + t5;
    const real t7 = cb_b*sb_g;
    const real b_R3 = t7;
    const real b_R4 = sb_b*t5 + t6;
    const real b_R5 = sb_b*t4 - sb_a*cb_g;
    const real b_R7 = sb_a*cb_b;
    const real b_R8 = cb_a*cb_b;
    /* R c */
    const real arm0 = b_R0*c[0] + b_R1*c[1] + b_R2*c[2];
    const real arm1 = b_R3*c[0] + b_R4*c[1] + b_R5*c[2];
    const real arm2 = b_R7*c[1] + b_R8*c[2] - sb_b*c[0];
    /* ω' by the angles of T */
    const real spin0 = a_R0*t3 + a_R1*t7 - a_R2*sb_b;
    const real spin1 = a_R1*cb_g - a_R0*sb_g;
    const real spin3 = a_R3*t3 + a_R4*t7 - a_R5*sb_b;
    const real spin4 = a_R4*cb_g - a_R3*sb_g;
    const real spin6 = a_R7*cb_b*sb_g - sa_b*t3 - a_R8*sb_b;
    const real spin7 = sa_b*sb_g + a_R7*cb_g;
    real sd_b, cd_b;
    FN(sincos)(d[4], &sd_b, &cd_b);
    real sd_g, cd_g;
    FN(sincos)(d[5], &sd_g, &cd_g);
    const real t8 = 1.0f/cd_b;
    const real tangent = sd_b*t8;
    const real secant = t8;
    rates[0] = a_R0;
    rates[1] = a_R1;
    rates[2] = a_R2;
    const real t9 = a_R0*arm1 - a_R1*arm0;
    const real t10 = a_R1*arm2 - a_R2*arm1;
    const real t11 = a_R2*arm0 - a_R0*arm2;
    rates[3] = sb_b*t9 - t3*t10 - t7*t11;
    rates[4] = sb_g*t10 - cb_g*t11;
    rates[5] = -t9;
    rates[6] = a_R3;
    rates[7] = a_R4;
    rates[8] = a_R5;
    const real t12 = a_R3*arm1 - a_R4*arm0;
    const real t13 = a_R4*arm2 - a_R5*arm1;
    const real t14 = a_R5*arm0 - a_R3*arm2;
    rates[9] = sb_b*t12 - t3*t13 - t7*t14;
    rates[10] = sb_g*t13 - cb_g*t14;
    rates[11] = -t12;
    rates[12] = -sa_b;
    rates[13] = a_R7;
    rates[14] = a_R8;
    const real t15 = sa_b*arm2 + a_R8*arm0;
    const real t16 = a_R7*arm2 - a_R8*arm1;
    const real t17 = sa_b*arm1 + a_R7*arm0;
    rates[15] = -sb_b*t17 - t3*t16 - t7*t15;
    rates[16] = sb_g*t16 - cb_g*t15;
    rates[17] = t17;
    rates[18] = FN(fill)(0.0f);
    rates[19] = FN(fill)(0.0f);
    rates[20] = FN(fill)(0.0f);
    const real t18 = cd_g*secant;
    const real t19 = sd_g*secant;
    rates[21] = spin0*t18 + spin3*t19;
    rates[22] = spin1*t18 + spin4*t19;
    rates[23] = a_R2*t18 + a_R5*t19;
    rates[24] = FN(fill)(0.0f);
    rates[25] = FN(fill)(0.0f);
    rates[26] = FN(fill)(0.0f);
    rates[27] = spin3*cd_g - spin0*sd_g;
    rates[28] = spin4*cd_g - spin1*sd_g;
    rates[29] = a_R5*cd_g - a_R2*sd_g;
    rates[30] = FN(fill)(0.0f);
    rates[31] = FN(fill)(0.0f);
    rates[32] = FN(fill)(0.0f);
    const real t20 = cd_g*tangent;
    const real t21 = sd_g*tangent;
    rates[33] = spin0*t20 + spin3*t21 + spin6;
    rates[34] = spin1*t20 + spin4*t21 + spin7;
    rates[35] = a_R2*t20 + a_R5*t21 + a_R8;
}
#endif

#ifndef NARROW
/*
 * the twist (ω, v) of A T C by that of T, each of its own origin and in its own base axes
 *     ω' = A ω, v' = A (v + ω × R c)
 * in  a[6]           A: x y z [mm], α β γ [rad]
 * in  b[6]           T: x y z [mm], α β γ [rad]
 * in  c[6]           C; only its origin matters
 * out twists[36]     6 x 6, row by row
 * operations: 23 +, 53 *, 0 /, 0 sqrt
 */
INLINE void FN(pose_compose_twists)(const real a[6], const real b[6], const real c[6],
        real twists[36])
{
    real sa_a, ca_a;
    FN(sincos)(a[3], &sa_a, &ca_a);
    real sa_b, ca_b;
    FN(sincos)(a[4], &sa_b, &ca_b);
    real sa_g, ca_g;
    FN(sincos)(a[5], &sa_g, &ca_g);
    const real a_R0 = ca_b*ca_g;
    const real t0 = ca_a*sa_g;
    const real a_R1 = sa_a*sa_b*ca_g - t0;
    const real t1 = sa_a*sa_g;
    const real t2 = ca_a*ca_g;
    const real a_R2 = sa_b*t2 + t1;
    const real a_R3 = ca_b*sa_g;
    const real a_R4 = sa_b*t1 + t2;
    const real a_R5 = sa_b*t0 - sa_a*ca_g;
    const real a_R7 = sa_a*ca_b;
    const real a_R8 = ca_a*ca_b;
    real sb_a, cb_a;
    FN(sincos)(b[3], &sb_a, &cb_a);
    real sb_b, cb_b;
    FN(sincos)(b[4], &sb_b, &cb_b);
    real sb_g, cb_g;
    FN(sincos)(b[5], &sb_g, &cb_g);
    const real b_R0 = cb_b*cb_g;
    const real t3 = cb_a*sb_g;
    const real b_R1 = sb_a*sb_b*cb_g - t3;
    const real t4 = sb_a*sb_g;
    const real t5 = cb_a*cb_g;
    const real b_R2 = sb_b*t5 + t4;
    const real b_R3 = cb_b*sb_g;
    const real b_R4 = sb_b*t4 + t5;
    const real b_R5 = sb_b*t3 - sb_a*cb_g;
    const real b_R7 = sb_a*cb_b;
    const real b_R8 = cb_a*cb_b;
    /* R c */
    const real arm0 = b_R0*c[0] + b_R1*c[1] + b_R2*c[2];
    const real arm1 = b_R3*c[0] + b_R4*c[1] + b_R5*c[2];
    const real arm2 = b_R7*c[1] + b_R8*c[2] - sb_b*c[0];
    twists[0] = a_R0;
    twists[1] = a_R1;
    twists[2] = a_R2;
    twists[3] = FN(fill)(0.0f);
    twists[4] = FN(fill)(0.0f);
    twists[5] = FN(fill)(0.0f);
    twists[6] = a_R3;
    twists[7] = a_R4;
    twists[8] = a_R5;
    twists[9] = FN(fill)(0.0f);
    twists[10] = FN(fill)(0.0f);
    twists[11] = FN(fill)(0.0f);
    const real t6 = -sa_b;
    twists[12] = t6;
    twists[13] = a_R7;
    twists[14] = a_R8;
    twists[15] = FN(fill)(0.0f);
    twists[16] = FN(fill)(0.0f);
    twists[17] = FN(fill)(0.0f);
    twists[18] = a_R2*arm1 - a_R1*arm2;
    twists[19] = a_R0*arm2 - a_R2*arm0;
    twists[20] = a_R1*arm0 - a_R0*arm1;
    twists[21] = a_R0;
    twists[22] = a_R1;
    twists[23] = a_R2;
    twists[24] = a_R5*arm1 - a_R4*arm2;
    twists[25] = a_R3*arm2 - a_R5*arm0;
    twists[26] = a_R4*arm0 - a_R3*arm1;
    twists[27] = a_R3;
    twists[28] = a_R4;
    twists[29] = a_R5;
    twists[30] = a_R8*arm1 - a_R7*arm2;
    twists[31] = -sa_b*arm2 - a_R8*arm0;
    twists[32] = sa_b*arm1 + a_R7*arm0;
    twists[33] = t6;
    twists[34] = a_R7;
    twists[35] = a_R8;
}
#endif
