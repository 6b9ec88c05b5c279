/* Generated from derive/measured.py by `python -m derive`; never edited by hand.
 * derivation 707b1ae0ca9c7b1e
 * `real` is a number or a lane of numbers, FN(name) the function for that type. */

#ifndef NARROW
/*
 * a point that the platform carries
 *     p + R t
 * in  pose[6]        of the platform: x y z [mm], α β γ [rad]
 * in  target[3]      t, in platform axes [mm]
 * out point[3]       in base axes [mm]
 * out by_pose[18]    ∂point/∂pose, 3 x 6 row by row
 * out by_target[9]   ∂point/∂t, 3 x 3 row by row
 * operations: 26 +, 47 *, 0 /, 0 sqrt
 */
INLINE void FN(measured_point)(const real pose[6], const real target[3], real point[3],
        real by_pose[18], real by_target[9])
{
    real spose_a, cpose_a;
    FN(sincos)(pose[3], &spose_a, &cpose_a);
    real spose_b, cpose_b;
    FN(sincos)(pose[4], &spose_b, &cpose_b);
    real spose_g, cpose_g;
    FN(sincos)(pose[5], &spose_g, &cpose_g);
    const real t0 = cpose_b*cpose_g;
    const real pose_R0 = t0;
    const real t1 = cpose_a*spose_g;
    const real t2 = t1 - spose_a*spose_b*cpose_g;
    const real t3 = -t2;
    const real pose_R1 = t3;
    const real t4 = spose_a*spose_g;
    const real t5 = cpose_a*cpose_g;
    const real t6 = spose_b*t5 + t4;
    const real pose_R2 = t6;
    const real t7 = cpose_b*spose_g;
    const real pose_R3 = t7;
    const real t8 = spose_b*t4 + t5;
    const real pose_R4 = t8;
    const real t9 = spose_b*t1 - spose_a*cpose_g;
    const real pose_R5 = t9;
    const real t10 = spose_a*cpose_b;
    const real pose_R7 = t10;
    const real t11 = cpose_a*cpose_b;
    const real pose_R8 = t11;
    point[0] = pose[0] + pose_R0*target[0] + pose_R1*target[1] + pose_R2*target[2];
    point[1] = pose[1] + pose_R3*target[0] + pose_R4*target[1] + pose_R5*target[2];
    const real t12 = spose_b*target[0];
    point[2] = pose[2] + pose_R7*target[1] + pose_R8*target[2] - t12;
    by_pose[0] = FN(fill)(1.0f);
    by_pose[1] = FN(fill)(0.0f);
    by_pose[2] = FN(fill)(0.0f);
    by_pose[3] = target[1]*t6 + target[2]*t2;
    const real t13 = cpose_a*target[2];
    const real t14 = spose_a*target[1];
    by_pose[4] = t0*t13 + t0*t14 - cpose_g*t12;
    const real t15 = -t8;
    by_pose[5] = target[1]*t15 - target[0]*t7 - target[2]*t9;
    by_pose[6] = FN(fill)(0.0f);
    by_pose[7] = FN(fill)(1.0f);
    by_pose[8] = FN(fill)(0.0f);
    by_pose[9] = target[1]*t9 + target[2]*t15;
    by_pose[10] = cpose_b*target[1]*t4 + cpose_b*target[2]*t1 - spose_g*t12;
    by_pose[11] = target[0]*t0 + target[1]*t3 + target[2]*t6;
    by_pose[12] = FN(fill)(0.0f);
    by_pose[13] = FN(fill)(0.0f);
    by_pose[14] = FN(fill)(1.0f);
    by_pose[15] = target[1]*t11 - target[2]*t10;
    by_pose[16] = -spose_b*t13 - spose_b*t14 - cpose_b*target[0];
    by_pose[17] = FN(fill)(0.0f);
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
 * from a point of the base to one of the platform
 *     ‖p + R t - a‖
 * in  pose[6]        of the platform: x y z [mm], α β γ [rad]
 * in  target[3]      t, in platform axes [mm]
 * in  anchor[3]      a, in base axes [mm]
 * out distance       ρ [mm]
 * out by_pose[6]     ∂ρ/∂pose
 * out by_target[3]   ∂ρ/∂t
 * out by_anchor[3]   ∂ρ/∂a
 * operations: 42 +, 70 *, 1 /, 1 sqrt
 */
INLINE void FN(measured_distance)(const real pose[6], const real target[3], const real anchor[3],
        real *distance, real by_pose[6], real by_target[3], real by_anchor[3])
{
    real spose_a, cpose_a;
    FN(sincos)(pose[3], &spose_a, &cpose_a);
    real spose_b, cpose_b;
    FN(sincos)(pose[4], &spose_b, &cpose_b);
    real spose_g, cpose_g;
    FN(sincos)(pose[5], &spose_g, &cpose_g);
    const real t0 = cpose_b*cpose_g;
    const real pose_R0 = t0;
    const real t1 = cpose_a*spose_g;
    const real t2 = t1 - spose_a*spose_b*cpose_g;
    const real t3 = -t2;
    const real pose_R1 = t3;
    const real t4 = spose_a*spose_g;
    const real t5 = cpose_a*cpose_g;
    const real t6 = spose_b*t5 + t4;
    const real pose_R2 = t6;
    const real t7 = cpose_b*spose_g;
    const real pose_R3 = t7;
    const real t8 = spose_b*t4 + t5;
    const real pose_R4 = t8;
    const real t9 = spose_b*t1 - spose_a*cpose_g;
    const real pose_R5 = t9;
    const real t10 = spose_a*cpose_b;
    const real pose_R7 = t10;
    const real t11 = cpose_a*cpose_b;
    const real pose_R8 = t11;
    /* d = p + R t - a */
    const real d0 = pose[0] + pose_R0*target[0] + pose_R1*target[1] + pose_R2*target[2] - anchor[0];
    const real d1 = pose[1] + pose_R3*target[0] + pose_R4*target[1] + pose_R5*target[2] - anchor[1];
    const real t12 = spose_b*target[0];
    const real d2 = pose[2] + pose_R7*target[1] + pose_R8*target[2] - anchor[2] - t12;
    /* ρ = ‖d‖ */
    const real t13 = FN(root)(d0*d0 + d1*d1 + d2*d2);
    const real rho = t13;
    *distance = rho;
    const real t14 = 1.0f/t13;
    const real t15 = d0*t14;
    by_pose[0] = t15;
    const real t16 = d1*t14;
    by_pose[1] = t16;
    const real t17 = d2*t14;
    by_pose[2] = t17;
    const real t18 = -t8;
    by_pose[3] = (target[1]*t6 + target[2]*t2)*t15 + (target[1]*t9 + target[2]*t18)*t16 +
        (target[1]*t11 - target[2]*t10)*t17;
    const real t19 = cpose_a*target[2];
    const real t20 = spose_a*target[1];
    by_pose[4] = (-spose_b*t19 - spose_b*t20 - cpose_b*target[0])*t17 + (cpose_b*target[1]*t4 +
        cpose_b*target[2]*t1 - spose_g*t12)*t16 + (t0*t19 + t0*t20 - cpose_g*t12)*t15;
    by_pose[5] = (target[0]*t0 + target[1]*t3 + target[2]*t6)*t16 + (target[1]*t18 - target[0]*t7 -
        target[2]*t9)*t15;
    by_target[0] = pose_R0*t15 + pose_R3*t16 - spose_b*t17;
    by_target[1] = pose_R1*t15 + pose_R4*t16 + pose_R7*t17;
    by_target[2] = pose_R2*t15 + pose_R5*t16 + pose_R8*t17;
    by_anchor[0] = -t15;
    by_anchor[1] = -t16;
    by_anchor[2] = -t17;
}
#endif
