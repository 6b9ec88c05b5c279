/* Generated from derive/measured.py by `python -m derive`; never edited by hand.
 * derivation cca478c486a28e49
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
 * from a point of the base to one of the platform
 *     ‖p + R t - a‖
 * in  pose[6]        of the platform: x y z [mm], α β γ [rad]
 * in  target[3]      t, in platform axes [mm]
 * in  anchor[3]      a, in base axes [mm]
 * out distance       ρ [mm]
 * out by_twist[6]    u · (v + ω × R t) by (ω, v)
 * out by_target[3]   ∂ρ/∂t
 * out by_anchor[3]   ∂ρ/∂a
 * operations: 27 +, 43 *, 1 /, 1 sqrt
 */
INLINE void FN(measured_distance)(const real pose[6], const real target[3], const real anchor[3],
        real *distance, real by_twist[6], real by_target[3], real by_anchor[3])
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
    *distance = rho;
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
