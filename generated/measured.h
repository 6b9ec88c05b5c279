/* Generated from derive/measured.py by `python -m derive`; never edited by hand.
 * derivation be738ed92296f396
 * `real` is a number or a lane of numbers, FN(name) the function for that type. */

#ifndef NARROW
/*
 * a point that the platform carries
 *     p + R t
 * in  pose[6]        of the platform: x y z [mm], α β γ [rad]
 * in  target[3]      t, in platform axes [mm]
 * out point[3]       in base axes [mm]
 * out by_twist[18]   v + ω × R t by (ω, v), 3 x 6 row by row
 * out by_target[9]   ∂point/∂t, 3 x 3 row by row
 * operations: 13 +, 22 *, 0 /, 0 sqrt
 */
INLINE void FN(measured_point)(const real pose[6], const real target[3], real point[3],
        real by_twist[18], real by_target[9])
{
    real spose_a, cpose_a;
    FN(sincos)(pose[3], &spose_a, &cpose_a);
    real spose_b, cpose_b;
    FN(sincos)(pose[4], &spose_b, &cpose_b);
    real spose_g, cpose_g;
    FN(sincos)(pose[5], &spose_g, &cpose_g);
    const real pose_R0 = cpose_b*cpose_g;
    const real t0 = cpose_a*spose_g;
    const real pose_R1 = spose_a*spose_b*cpose_g - t0;
    const real t1 = spose_a*spose_g;
    const real t2 = cpose_a*cpose_g;
    const real pose_R2 = spose_b*t2 + t1;
    const real pose_R3 = cpose_b*spose_g;
    const real pose_R4 = spose_b*t1 + t2;
    const real pose_R5 = spose_b*t0 - spose_a*cpose_g;
    const real pose_R7 = spose_a*cpose_b;
    const real pose_R8 = cpose_a*cpose_b;
    /* R t */
    const real lever0 = pose_R0*target[0] + pose_R1*target[1] + pose_R2*target[2];
    const real lever1 = pose_R3*target[0] + pose_R4*target[1] + pose_R5*target[2];
    const real lever2 = pose_R7*target[1] + pose_R8*target[2] - spose_b*target[0];
    point[0] = pose[0] + lever0;
    point[1] = pose[1] + lever1;
    point[2] = pose[2] + lever2;
    by_twist[0] = FN(fill)(0.0f);
    by_twist[1] = lever2;
    by_twist[2] = -lever1;
    by_twist[3] = FN(fill)(1.0f);
    by_twist[4] = FN(fill)(0.0f);
    by_twist[5] = FN(fill)(0.0f);
    by_twist[6] = -lever2;
    by_twist[7] = FN(fill)(0.0f);
    by_twist[8] = lever0;
    by_twist[9] = FN(fill)(0.0f);
    by_twist[10] = FN(fill)(1.0f);
    by_twist[11] = FN(fill)(0.0f);
    by_twist[12] = lever1;
    by_twist[13] = -lever0;
    by_twist[14] = FN(fill)(0.0f);
    by_twist[15] = FN(fill)(0.0f);
    by_twist[16] = FN(fill)(0.0f);
    by_twist[17] = FN(fill)(1.0f);
    by_target[0] = pose_R0;
    by_target[1] = pose_R1;
    by_target[2] = pose_R2;
    by_target[3] = pose_R3;
    by_target[4] = pose_R4;
    by_target[5] = pose_R5;
    by_target[6] = -spose_b;
    by_target[7] = pose_R7;
    by_target[8] = pose_R8;
}
#endif

#ifndef NARROW
/*
 * a point of the base in the frame of an instrument
 *     pf + Rf x
 * in  frame[6]       of the base, as the instrument has it: x y z [mm], α β γ [rad]
 * in  x[3]           in base axes [mm]
 * out seen[3]        in the instrument's axes [mm]
 * out by_frame[18]   ∂seen/∂frame, 3 x 6 row by row
 * out by_point[9]    ∂seen/∂x, 3 x 3 row by row
 * operations: 26 +, 47 *, 0 /, 0 sqrt
 */
INLINE void FN(seen_point)(const real frame[6], const real x[3], real seen[3], real by_frame[18],
        real by_point[9])
{
    real sframe_a, cframe_a;
    FN(sincos)(frame[3], &sframe_a, &cframe_a);
    real sframe_b, cframe_b;
    FN(sincos)(frame[4], &sframe_b, &cframe_b);
    real sframe_g, cframe_g;
    FN(sincos)(frame[5], &sframe_g, &cframe_g);
    const real t0 = cframe_b*cframe_g;
    const real frame_R0 = t0;
    const real t1 = cframe_a*sframe_g;
    const real t2 = t1 - sframe_a*sframe_b*cframe_g;
    const real t3 = -t2;
    const real frame_R1 = t3;
    const real t4 = sframe_a*sframe_g;
    const real t5 = cframe_a*cframe_g;
    const real t6 = sframe_b*t5 + t4;
    const real frame_R2 = t6;
    const real t7 = cframe_b*sframe_g;
    const real frame_R3 = t7;
    const real t8 = sframe_b*t4 + t5;
    const real frame_R4 = t8;
    const real t9 = sframe_b*t1 - sframe_a*cframe_g;
    const real frame_R5 = t9;
    const real t10 = sframe_a*cframe_b;
    const real frame_R7 = t10;
    const real t11 = cframe_a*cframe_b;
    const real frame_R8 = t11;
    seen[0] = frame[0] + frame_R0*x[0] + frame_R1*x[1] + frame_R2*x[2];
    seen[1] = frame[1] + frame_R3*x[0] + frame_R4*x[1] + frame_R5*x[2];
    const real t12 = sframe_b*x[0];
    seen[2] = frame[2] + frame_R7*x[1] + frame_R8*x[2] - t12;
    by_frame[0] = FN(fill)(1.0f);
    by_frame[1] = FN(fill)(0.0f);
    by_frame[2] = FN(fill)(0.0f);
    by_frame[3] = x[1]*t6 + x[2]*t2;
    const real t13 = cframe_a*x[2];
    const real t14 = sframe_a*x[1];
    by_frame[4] = t0*t13 + t0*t14 - cframe_g*t12;
    const real t15 = -t8;
    by_frame[5] = x[1]*t15 - x[0]*t7 - x[2]*t9;
    by_frame[6] = FN(fill)(0.0f);
    by_frame[7] = FN(fill)(1.0f);
    by_frame[8] = FN(fill)(0.0f);
    by_frame[9] = x[1]*t9 + x[2]*t15;
    by_frame[10] = cframe_b*x[1]*t4 + cframe_b*x[2]*t1 - sframe_g*t12;
    by_frame[11] = x[0]*t0 + x[1]*t3 + x[2]*t6;
    by_frame[12] = FN(fill)(0.0f);
    by_frame[13] = FN(fill)(0.0f);
    by_frame[14] = FN(fill)(1.0f);
    by_frame[15] = x[1]*t11 - x[2]*t10;
    by_frame[16] = -sframe_b*t13 - sframe_b*t14 - cframe_b*x[0];
    by_frame[17] = FN(fill)(0.0f);
    by_point[0] = frame_R0;
    by_point[1] = frame_R1;
    by_point[2] = frame_R2;
    by_point[3] = frame_R3;
    by_point[4] = frame_R4;
    by_point[5] = frame_R5;
    by_point[6] = -sframe_b;
    by_point[7] = frame_R7;
    by_point[8] = frame_R8;
}
#endif

#ifndef NARROW
/*
 * from a point of the base to one of the platform, less a constant
 *     ‖p + R t - a‖ - z
 * in  pose[6]        of the platform: x y z [mm], α β γ [rad]
 * in  target[3]      t, in platform axes [mm]
 * in  anchor[3]      a, in base axes [mm]
 * in  zero[1]        z, the zero of a relative reading or the radius of a sphere [mm]
 * out distance       ρ - z [mm]
 * out by_twist[6]    u · (v + ω × R t) by (ω, v)
 * out by_target[3]   ∂ρ/∂t
 * out by_anchor[3]   ∂ρ/∂a
 * operations: 28 +, 43 *, 1 /, 1 sqrt
 */
INLINE void FN(measured_distance)(const real pose[6], const real target[3], const real anchor[3],
        const real zero[1], real *distance, real by_twist[6], real by_target[3], real by_anchor[3])
{
    real spose_a, cpose_a;
    FN(sincos)(pose[3], &spose_a, &cpose_a);
    real spose_b, cpose_b;
    FN(sincos)(pose[4], &spose_b, &cpose_b);
    real spose_g, cpose_g;
    FN(sincos)(pose[5], &spose_g, &cpose_g);
    const real pose_R0 = cpose_b*cpose_g;
    const real t0 = cpose_a*spose_g;
    const real pose_R1 = spose_a*spose_b*cpose_g - t0;
    const real t1 = spose_a*spose_g;
    const real t2 = cpose_a*cpose_g;
    const real pose_R2 = spose_b*t2 + t1;
    const real pose_R3 = cpose_b*spose_g;
    const real pose_R4 = spose_b*t1 + t2;
    const real pose_R5 = spose_b*t0 - spose_a*cpose_g;
    const real pose_R7 = spose_a*cpose_b;
    const real pose_R8 = cpose_a*cpose_b;
    /* R t */
    const real lever0 = pose_R0*target[0] + pose_R1*target[1] + pose_R2*target[2];
    const real lever1 = pose_R3*target[0] + pose_R4*target[1] + pose_R5*target[2];
    const real lever2 = pose_R7*target[1] + pose_R8*target[2] - spose_b*target[0];
    /* d = p + R t - a */
    const real d0 = pose[0] + lever0 - anchor[0];
    const real d1 = pose[1] + lever1 - anchor[1];
    const real d2 = pose[2] + lever2 - anchor[2];
    /* ρ = ‖d‖ */
    const real rho = FN(root)(d0*d0 + d1*d1 + d2*d2);
    /* u = ∂ρ/∂d */
    const real t3 = 1.0f/rho;
    const real u0 = d0*t3;
    const real u1 = d1*t3;
    const real u2 = d2*t3;
    *distance = rho - zero[0];
    by_twist[0] = lever1*u2 - lever2*u1;
    by_twist[1] = lever2*u0 - lever0*u2;
    by_twist[2] = lever0*u1 - lever1*u0;
    by_twist[3] = u0;
    by_twist[4] = u1;
    by_twist[5] = u2;
    by_target[0] = pose_R0*u0 + pose_R3*u1 - spose_b*u2;
    by_target[1] = pose_R1*u0 + pose_R4*u1 + pose_R7*u2;
    by_target[2] = pose_R2*u0 + pose_R5*u1 + pose_R8*u2;
    by_anchor[0] = -u0;
    by_anchor[1] = -u1;
    by_anchor[2] = -u2;
}
#endif

#ifndef NARROW
/*
 * between two places of one point of the platform
 *     ‖p₂ + R₂ t - p₁ - R₁ t‖
 * in  pose[6]        of the platform, first: x y z [mm], α β γ [rad]
 * in  other[6]       of the platform, then: x y z [mm], α β γ [rad]
 * in  target[3]      t, in platform axes [mm]
 * out distance       ρ [mm]
 * out by_twist[6]    -u · (v + ω × R₁ t) by (ω, v), first
 * out by_other[6]    u · (v + ω × R₂ t) by (ω, v), then
 * out by_target[3]   ∂ρ/∂t
 * operations: 52 +, 71 *, 1 /, 1 sqrt
 */
INLINE void FN(measured_between)(const real pose[6], const real other[6], const real target[3],
        real *distance, real by_twist[6], real by_other[6], real by_target[3])
{
    real spose_a, cpose_a;
    FN(sincos)(pose[3], &spose_a, &cpose_a);
    real spose_b, cpose_b;
    FN(sincos)(pose[4], &spose_b, &cpose_b);
    real spose_g, cpose_g;
    FN(sincos)(pose[5], &spose_g, &cpose_g);
    const real pose_R0 = cpose_b*cpose_g;
    const real t0 = cpose_a*spose_g;
    const real pose_R1 = spose_a*spose_b*cpose_g - t0;
    const real t1 = spose_a*spose_g;
    const real t2 = cpose_a*cpose_g;
    const real pose_R2 = spose_b*t2 + t1;
    const real pose_R3 = cpose_b*spose_g;
    const real pose_R4 = spose_b*t1 + t2;
    const real pose_R5 = spose_b*t0 - spose_a*cpose_g;
    const real pose_R7 = spose_a*cpose_b;
    const real pose_R8 = cpose_a*cpose_b;
    real sother_a, cother_a;
    FN(sincos)(other[3], &sother_a, &cother_a);
    real sother_b, cother_b;
    FN(sincos)(other[4], &sother_b, &cother_b);
    real sother_g, cother_g;
    FN(sincos)(other[5], &sother_g, &cother_g);
    const real other_R0 = cother_b*cother_g;
    const real t3 = cother_a*sother_g;
    const real other_R1 = sother_a*sother_b*cother_g - t3;
    const real t4 = sother_a*sother_g;
    const real t5 = cother_a*cother_g;
    const real other_R2 = sother_b*t5 + t4;
    const real other_R3 = cother_b*sother_g;
    const real other_R4 = sother_b*t4 + t5;
    const real other_R5 = sother_b*t3 - sother_a*cother_g;
    const real other_R7 = sother_a*cother_b;
    const real other_R8 = cother_a*cother_b;
    /* R₁ t */
    const real lever0 = pose_R0*target[0] + pose_R1*target[1] + pose_R2*target[2];
    const real lever1 = pose_R3*target[0] + pose_R4*target[1] + pose_R5*target[2];
    const real lever2 = pose_R7*target[1] + pose_R8*target[2] - spose_b*target[0];
    /* R₂ t */
    const real reach0 = other_R0*target[0] + other_R1*target[1] + other_R2*target[2];
    const real reach1 = other_R3*target[0] + other_R4*target[1] + other_R5*target[2];
    const real reach2 = other_R7*target[1] + other_R8*target[2] - sother_b*target[0];
    /* d = p₂ + R₂ t - p₁ - R₁ t */
    const real d0 = other[0] + reach0 - pose[0] - lever0;
    const real d1 = other[1] + reach1 - pose[1] - lever1;
    const real d2 = other[2] + reach2 - pose[2] - lever2;
    /* ρ = ‖d‖ */
    const real rho = FN(root)(d0*d0 + d1*d1 + d2*d2);
    /* u = ∂ρ/∂d */
    const real t6 = 1.0f/rho;
    const real u0 = d0*t6;
    const real u1 = d1*t6;
    const real u2 = d2*t6;
    *distance = rho;
    by_twist[0] = lever2*u1 - lever1*u2;
    by_twist[1] = lever0*u2 - lever2*u0;
    by_twist[2] = lever1*u0 - lever0*u1;
    by_twist[3] = -u0;
    by_twist[4] = -u1;
    by_twist[5] = -u2;
    by_other[0] = reach1*u2 - reach2*u1;
    by_other[1] = reach2*u0 - reach0*u2;
    by_other[2] = reach0*u1 - reach1*u0;
    by_other[3] = u0;
    by_other[4] = u1;
    by_other[5] = u2;
    by_target[0] = (spose_b - sother_b)*u2 + (other_R0 - pose_R0)*u0 + (other_R3 - pose_R3)*u1;
    by_target[1] = (other_R1 - pose_R1)*u0 + (other_R4 - pose_R4)*u1 + (other_R7 - pose_R7)*u2;
    by_target[2] = (other_R2 - pose_R2)*u0 + (other_R5 - pose_R5)*u1 + (other_R8 - pose_R8)*u2;
}
#endif

#ifndef NARROW
/*
 * a point of the base in the axes of an artefact
 *     Raᵀ (x - pa)
 * in  artefact[6]    of the artefact, in the base: x y z [mm], α β γ [rad]
 * in  x[3]           in base axes [mm]
 * out inside[3]      in the artefact's axes [mm]
 * out by_artefact[18] ∂inside/∂artefact, 3 x 6 row by row
 * out by_point[9]    ∂inside/∂x, 3 x 3 row by row
 * operations: 26 +, 47 *, 0 /, 0 sqrt
 */
INLINE void FN(touched_point)(const real artefact[6], const real x[3], real inside[3],
        real by_artefact[18], real by_point[9])
{
    real sartefact_a, cartefact_a;
    FN(sincos)(artefact[3], &sartefact_a, &cartefact_a);
    real sartefact_b, cartefact_b;
    FN(sincos)(artefact[4], &sartefact_b, &cartefact_b);
    real sartefact_g, cartefact_g;
    FN(sincos)(artefact[5], &sartefact_g, &cartefact_g);
    const real t0 = cartefact_b*cartefact_g;
    const real artefact_R0 = t0;
    const real t1 = cartefact_a*sartefact_g;
    const real t2 = t1 - sartefact_a*sartefact_b*cartefact_g;
    const real t3 = -t2;
    const real artefact_R1 = t3;
    const real t4 = sartefact_a*sartefact_g;
    const real t5 = cartefact_a*cartefact_g;
    const real t6 = sartefact_b*t5 + t4;
    const real artefact_R2 = t6;
    const real t7 = cartefact_b*sartefact_g;
    const real artefact_R3 = t7;
    const real t8 = sartefact_b*t4 + t5;
    const real artefact_R4 = t8;
    const real t9 = sartefact_b*t1 - sartefact_a*cartefact_g;
    const real artefact_R5 = t9;
    const real t10 = sartefact_a*cartefact_b;
    const real artefact_R7 = t10;
    const real t11 = cartefact_a*cartefact_b;
    const real artefact_R8 = t11;
    const real t12 = x[0] - artefact[0];
    const real t13 = x[1] - artefact[1];
    const real t14 = x[2] - artefact[2];
    const real t15 = sartefact_b*t14;
    inside[0] = artefact_R0*t12 + artefact_R3*t13 - t15;
    inside[1] = artefact_R1*t12 + artefact_R4*t13 + artefact_R7*t14;
    inside[2] = artefact_R2*t12 + artefact_R5*t13 + artefact_R8*t14;
    by_artefact[0] = -artefact_R0;
    by_artefact[1] = -artefact_R3;
    by_artefact[2] = sartefact_b;
    by_artefact[3] = FN(fill)(0.0f);
    by_artefact[4] = -sartefact_b*sartefact_g*t13 - sartefact_b*cartefact_g*t12 - cartefact_b*t14;
    by_artefact[5] = t0*t13 - t7*t12;
    by_artefact[6] = -artefact_R1;
    by_artefact[7] = -artefact_R4;
    by_artefact[8] = -artefact_R7;
    by_artefact[9] = t6*t12 + t9*t13 + t11*t14;
    const real t16 = t0*t12;
    const real t17 = cartefact_b*t13;
    by_artefact[10] = sartefact_a*t16 + t4*t17 - sartefact_a*t15;
    const real t18 = -t8;
    by_artefact[11] = t3*t13 + t12*t18;
    by_artefact[12] = -artefact_R2;
    by_artefact[13] = -artefact_R5;
    by_artefact[14] = -artefact_R8;
    by_artefact[15] = t2*t12 + t13*t18 - t10*t14;
    by_artefact[16] = cartefact_a*t16 + t1*t17 - cartefact_a*t15;
    by_artefact[17] = t6*t13 - t9*t12;
    by_point[0] = artefact_R0;
    by_point[1] = artefact_R3;
    by_point[2] = -sartefact_b;
    by_point[3] = artefact_R1;
    by_point[4] = artefact_R4;
    by_point[5] = artefact_R7;
    by_point[6] = artefact_R2;
    by_point[7] = artefact_R5;
    by_point[8] = artefact_R8;
}
#endif

#ifndef NARROW
/*
 * how far the x and y axes of a sensor on the platform point up
 *     atan2(s_i, √(1 - s_i²)), i = x, y;  s = (R Rm)ᵀ up
 * in  pose[6]        of the platform: x y z [mm], α β γ [rad]
 * in  mounting[3]    α β γ of the sensor on the platform [rad]
 * in  up[3]          the vertical, of length one, in base axes
 * out tilt[2]        [rad]
 * out by_turn[6]     by the turning ω, 2 x 3 row by row
 * out by_mounting[6] ∂tilt/∂mounting, 2 x 3 row by row
 * out by_up[6]       ∂tilt/∂up, of changes that keep its length, 2 x 3 row by row
 * operations: 48 +, 111 *, 2 /, 2 sqrt
 */
INLINE void FN(measured_tilt)(const real pose[6], const real mounting[3], const real up[3],
        real tilt[2], real by_turn[6], real by_mounting[6], real by_up[6])
{
    real spose_a, cpose_a;
    FN(sincos)(pose[3], &spose_a, &cpose_a);
    real spose_b, cpose_b;
    FN(sincos)(pose[4], &spose_b, &cpose_b);
    real spose_g, cpose_g;
    FN(sincos)(pose[5], &spose_g, &cpose_g);
    const real pose_R0 = cpose_b*cpose_g;
    const real t0 = cpose_a*spose_g;
    const real pose_R1 = spose_a*spose_b*cpose_g - t0;
    const real t1 = spose_a*spose_g;
    const real t2 = cpose_a*cpose_g;
    const real pose_R2 = spose_b*t2 + t1;
    const real pose_R3 = cpose_b*spose_g;
    const real pose_R4 = spose_b*t1 + t2;
    const real pose_R5 = spose_b*t0 - spose_a*cpose_g;
    const real pose_R7 = spose_a*cpose_b;
    const real pose_R8 = cpose_a*cpose_b;
    real smounting_a, cmounting_a;
    FN(sincos)(mounting[0], &smounting_a, &cmounting_a);
    real smounting_b, cmounting_b;
    FN(sincos)(mounting[1], &smounting_b, &cmounting_b);
    real smounting_g, cmounting_g;
    FN(sincos)(mounting[2], &smounting_g, &cmounting_g);
    const real t3 = cmounting_b*cmounting_g;
    const real Rm0 = t3;
    const real t4 = cmounting_a*smounting_g;
    const real t5 = smounting_a*smounting_b*cmounting_g - t4;
    const real Rm1 = t5;
    const real t6 = smounting_a*smounting_g;
    const real t7 = cmounting_a*cmounting_g;
    const real t8 = smounting_b*t7 + t6;
    const real Rm2 = t8;
    const real t9 = cmounting_b*smounting_g;
    const real Rm3 = t9;
    const real t10 = smounting_b*t6 + t7;
    const real Rm4 = t10;
    const real t11 = smounting_b*t4 - smounting_a*cmounting_g;
    const real Rm5 = t11;
    const real Rm7 = smounting_a*cmounting_b;
    const real t12 = cmounting_a*cmounting_b;
    const real Rm8 = t12;
    /* the vertical in platform axes */
    const real level0 = pose_R0*up[0] + pose_R3*up[1] - spose_b*up[2];
    const real level1 = pose_R1*up[0] + pose_R4*up[1] + pose_R7*up[2];
    const real level2 = pose_R2*up[0] + pose_R5*up[1] + pose_R8*up[2];
    /* the vertical in the sensor's axes */
    const real t13 = smounting_b*level2;
    const real s0 = Rm0*level0 + Rm3*level1 - t13;
    const real s1 = Rm1*level0 + Rm4*level1 + Rm7*level2;
    const real s2 = Rm2*level0 + Rm5*level1 + Rm8*level2;
    /* cosines */
    const real t14 = s2*s2;
    const real cx = FN(root)(s1*s1 + t14);
    const real cy = FN(root)(s0*s0 + t14);
    const real tilt_x = arctangent2(s0, cx);
    const real tilt_y = arctangent2(s1, cy);
    /* x and y of the sensor in base axes */
    const real axes0 = pose_R0*Rm0 + pose_R1*Rm3 - pose_R2*smounting_b;
    const real axes1 = pose_R0*Rm1 + pose_R1*Rm4 + pose_R2*Rm7;
    const real axes2 = pose_R3*Rm0 + pose_R4*Rm3 - pose_R5*smounting_b;
    const real axes3 = pose_R3*Rm1 + pose_R4*Rm4 + pose_R5*Rm7;
    const real axes4 = pose_R7*Rm3 - spose_b*Rm0 - pose_R8*smounting_b;
    const real axes5 = pose_R7*Rm4 + pose_R8*Rm7 - spose_b*Rm1;
    tilt[0] = tilt_x;
    tilt[1] = tilt_y;
    const real t15 = 1.0f/cx;
    by_turn[0] = (up[2]*axes2 - up[1]*axes4)*t15;
    by_turn[1] = (up[0]*axes4 - up[2]*axes0)*t15;
    by_turn[2] = (up[1]*axes0 - up[0]*axes2)*t15;
    const real t16 = 1.0f/cy;
    by_turn[3] = (up[2]*axes3 - up[1]*axes5)*t16;
    by_turn[4] = (up[0]*axes5 - up[2]*axes1)*t16;
    by_turn[5] = (up[1]*axes1 - up[0]*axes3)*t16;
    by_mounting[0] = FN(fill)(0.0f);
    by_mounting[1] = (-smounting_b*smounting_g*level1 - smounting_b*cmounting_g*level0 -
        cmounting_b*level2)*t15;
    by_mounting[2] = (level1*t3 - level0*t9)*t15;
    by_mounting[3] = (level0*t8 + level1*t11 + level2*t12)*t16;
    by_mounting[4] = (smounting_a*level0*t3 + cmounting_b*level1*t6 - smounting_a*t13)*t16;
    by_mounting[5] = (level1*t5 - level0*t10)*t16;
    by_up[0] = axes0*t15;
    by_up[1] = axes2*t15;
    by_up[2] = axes4*t15;
    by_up[3] = axes1*t16;
    by_up[4] = axes3*t16;
    by_up[5] = axes5*t16;
}
#endif

#ifndef NARROW
/*
 * where a camera sees a corner of a board; axes of the camera: x right, y down, z forward
 *     u = fx (x L + 2 p1 x y + p2 (r² + 2 x²)) + cx, L = 1 + k1 r² + k2 r⁴ + k3 r⁶, (x, y) = p / p_z, p = pb + Rb (1 + s) X
 * in  board[6]       of the board, as the camera has it: x y z [mm], α β γ [rad]
 * in  corner[3]      X, in axes of the board [mm]
 * in  lens[9]        fx fy cx cy [px], k1 k2 p1 p2 k3
 * in  size           s, by which the board is larger than stated
 * out seen[2]        u, v; (0, 0) is the centre of the first pixel [px]
 * out by_twist[12]   v + ω × p by the board's turning and velocity at the camera, 2 x 6 row by row
 * out by_lens[18]    ∂(u, v)/∂lens, 2 x 9 row by row
 * out by_size[2]     ∂(u, v)/∂s
 * out depth          p_z; what is not before the camera is not seen [mm]
 * operations: 55 +, 122 *, 2 /, 0 sqrt
 */
INLINE void FN(measured_pixel)(const real board[6], const real corner[3], const real lens[9],
        real size, real seen[2], real by_twist[12], real by_lens[18], real by_size[2], real *depth)
{
    real sboard_a, cboard_a;
    FN(sincos)(board[3], &sboard_a, &cboard_a);
    real sboard_b, cboard_b;
    FN(sincos)(board[4], &sboard_b, &cboard_b);
    real sboard_g, cboard_g;
    FN(sincos)(board[5], &sboard_g, &cboard_g);
    const real board_R0 = cboard_b*cboard_g;
    const real t0 = cboard_a*sboard_g;
    const real board_R1 = sboard_a*sboard_b*cboard_g - t0;
    const real t1 = sboard_a*sboard_g;
    const real t2 = cboard_a*cboard_g;
    const real board_R2 = sboard_b*t2 + t1;
    const real board_R3 = cboard_b*sboard_g;
    const real board_R4 = sboard_b*t1 + t2;
    const real board_R5 = sboard_b*t0 - sboard_a*cboard_g;
    const real board_R7 = sboard_a*cboard_b;
    const real board_R8 = cboard_a*cboard_b;
    /* Rb X */
    const real arm0 = board_R0*corner[0] + board_R1*corner[1] + board_R2*corner[2];
    const real arm1 = board_R3*corner[0] + board_R4*corner[1] + board_R5*corner[2];
    const real arm2 = board_R7*corner[1] + board_R8*corner[2] - sboard_b*corner[0];
    /* the corner, from the camera */
    const real t3 = 1.0f + size;
    const real p0 = board[0] + arm0*t3;
    const real p1 = board[1] + arm1*t3;
    const real p2 = board[2] + arm2*t3;
    const real t4 = 1.0f/p2;
    const real x = p0*t4;
    const real y = p1*t4;
    /* r² */
    const real t5 = x*x;
    const real t6 = y*y;
    const real r2 = t5 + t6;
    const real t7 = lens[8]*r2;
    const real t8 = lens[4] + (lens[5] + t7)*r2;
    const real L = 1.0f + r2*t8;
    const real t9 = lens[6]*y;
    const real t10 = 2.0f*t9;
    const real t11 = 2.0f*t5;
    const real t12 = r2 + t11;
    const real bent_x = lens[7]*t12 + x*L + x*t10;
    const real t13 = lens[7]*x;
    const real t14 = 2.0f*t13;
    const real t15 = 2.0f*t6;
    const real t16 = r2 + t15;
    const real bent_y = lens[6]*t16 + y*L + y*t14;
    /* ∂(u, v)/∂p */
    const real t17 = L + t10 + 4.0f*t13;
    const real t18 = (lens[5] + 2.0f*t7)*r2 + t8;
    const real t19 = t4*t18;
    const real by_p0 = lens[0]*(t4*t14 + t4*t17 + t11*t19);
    const real t20 = 2.0f*t4;
    const real t21 = lens[6]*x;
    const real t22 = lens[7]*y;
    const real t23 = 2.0f*x;
    const real t24 = y*t19*t23 + t20*t21 + t20*t22;
    const real by_p1 = lens[0]*t24;
    const real t25 = 1.0f/(p2*p2);
    const real t26 = p1*t25;
    const real t27 = p0*t25;
    const real t28 = 2.0f*y;
    const real t29 = -t23*t27 - t26*t28;
    const real by_p2 = lens[0]*(lens[7]*t29 + x*t18*t29 - t17*t27 - 2.0f*t21*t26);
    const real by_p3 = lens[1]*t24;
    const real t30 = L + 4.0f*t9 + t14;
    const real by_p4 = lens[1]*(t4*t10 + t4*t30 + t15*t19);
    const real by_p5 = lens[1]*(lens[6]*t29 + y*t18*t29 - 2.0f*t22*t27 - t26*t30);
    seen[0] = lens[0]*bent_x + lens[2];
    seen[1] = lens[1]*bent_y + lens[3];
    by_twist[0] = p1*by_p2 - p2*by_p1;
    by_twist[1] = p2*by_p0 - p0*by_p2;
    by_twist[2] = p0*by_p1 - p1*by_p0;
    by_twist[3] = by_p0;
    by_twist[4] = by_p1;
    by_twist[5] = by_p2;
    by_twist[6] = p1*by_p5 - p2*by_p4;
    by_twist[7] = p2*by_p3 - p0*by_p5;
    by_twist[8] = p0*by_p4 - p1*by_p3;
    by_twist[9] = by_p3;
    by_twist[10] = by_p4;
    by_twist[11] = by_p5;
    by_lens[0] = bent_x;
    by_lens[1] = FN(fill)(0.0f);
    by_lens[2] = FN(fill)(1.0f);
    by_lens[3] = FN(fill)(0.0f);
    const real t31 = lens[0]*x;
    by_lens[4] = r2*t31;
    const real t32 = r2*r2;
    by_lens[5] = t31*t32;
    by_lens[6] = t28*t31;
    by_lens[7] = lens[0]*t12;
    const real t33 = r2*r2*r2;
    by_lens[8] = t31*t33;
    by_lens[9] = FN(fill)(0.0f);
    by_lens[10] = bent_y;
    by_lens[11] = FN(fill)(0.0f);
    by_lens[12] = FN(fill)(1.0f);
    const real t34 = lens[1]*y;
    by_lens[13] = r2*t34;
    by_lens[14] = t32*t34;
    by_lens[15] = lens[1]*t16;
    by_lens[16] = t23*t34;
    by_lens[17] = t33*t34;
    by_size[0] = arm0*by_p0 + arm1*by_p1 + arm2*by_p2;
    by_size[1] = arm0*by_p3 + arm1*by_p4 + arm2*by_p5;
    *depth = p2;
}
#endif
