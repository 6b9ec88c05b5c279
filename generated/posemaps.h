/* Generated from derive/posemaps.py by `python -m derive`; never edited by hand.
 * derivation d5ebca21a7c1e36a
 * `real` is a number or a lane of numbers, FN(name) the function for that type. */

#ifndef NARROW
/*
 * the frame of a pose
 *     R = Rz(γ) Ry(β) Rx(α) (A eq. 1)
 * in  pose[6]        x y z [mm], α β γ [rad]
 * out R[9]           platform to base, row by row
 * out p[3]           platform origin [mm]
 * operations: 4 +, 13 *, 0 /, 0 sqrt
 */
INLINE void FN(pose_frame)(const real pose[6], real R[9], real p[3])
{
    real sa, ca;
    FN(sincos)(pose[3], &sa, &ca);
    real sb, cb;
    FN(sincos)(pose[4], &sb, &cb);
    real sg, cg;
    FN(sincos)(pose[5], &sg, &cg);
    R[0] = cb*cg;
    const real t0 = ca*sg;
    R[1] = sa*sb*cg - t0;
    const real t1 = sa*sg;
    const real t2 = ca*cg;
    R[2] = sb*t2 + t1;
    R[3] = cb*sg;
    R[4] = sb*t1 + t2;
    R[5] = sb*t0 - sa*cg;
    R[6] = -sb;
    R[7] = sa*cb;
    R[8] = ca*cb;
    p[0] = pose[0];
    p[1] = pose[1];
    p[2] = pose[2];
}
#endif

#ifndef NARROW
/*
 * spatial: the state of a pose
 *     six free coordinates; state: p and the unit quaternion of R; step: (v, ω)
 * in  pose[6]        x y z [mm], α β γ [rad]
 * out state[7]       of the map
 * operations: 4 +, 16 *, 0 /, 0 sqrt
 */
INLINE void FN(map_spatial_from_pose)(const real pose[6], real state[7])
{
    /* half angles */
    real sa, ca;
    FN(sincos)(0.5f*pose[3], &sa, &ca);
    real sb, cb;
    FN(sincos)(0.5f*pose[4], &sb, &cb);
    real sg, cg;
    FN(sincos)(0.5f*pose[5], &sg, &cg);
    state[0] = pose[0];
    state[1] = pose[1];
    state[2] = pose[2];
    const real t0 = sb*sg;
    state[3] = sa*t0 + ca*cb*cg;
    state[4] = sa*cb*cg - ca*t0;
    const real t1 = sb*cg;
    const real t2 = cb*sg;
    state[5] = sa*t2 + ca*t1;
    state[6] = ca*t2 - sa*t1;
}
#endif

/*
 * spatial: the frame of a state
 *     R = Rz(γ) Ry(β) Rx(α) (eq. 1)
 * in  state[7]       of the map
 * out R[9]           platform to base, row by row
 * out p[3]           platform origin [mm]
 * operations: 11 +, 21 *, 0 /, 0 sqrt
 */
INLINE void FN(map_spatial_frame)(const real state[7], real R[9], real p[3])
{
    const real t0 = 2.0f*state[5]*state[5];
    const real t1 = 2.0f*state[6]*state[6] - 1.0f;
    R[0] = -t0 - t1;
    const real t2 = 2.0f*state[3];
    const real t3 = state[6]*t2;
    R[1] = 2.0f*state[4]*state[5] - t3;
    const real t4 = state[5]*t2;
    const real t5 = 2.0f*state[4];
    R[2] = state[6]*t5 + t4;
    R[3] = state[5]*t5 + t3;
    const real t6 = 2.0f*state[4]*state[4];
    R[4] = -t1 - t6;
    const real t7 = state[4]*t2;
    R[5] = 2.0f*state[5]*state[6] - t7;
    R[6] = 2.0f*state[4]*state[6] - t4;
    R[7] = 2.0f*state[5]*state[6] + t7;
    R[8] = 1.0f - t0 - t6;
    p[0] = state[0];
    p[1] = state[1];
    p[2] = state[2];
}

/*
 * spatial: the state moved by a step
 *     state ⊕ delta
 * in  state[7]       of the map
 * in  delta[6]       step [mm, rad]
 * out moved[7]       the new state
 * operations: 23 +, 27 *, 0 /, 0 sqrt
 */
INLINE void FN(map_spatial_retract)(const real state[7], const real delta[6], real moved[7])
{
    /* (1, ω/2) q, then to unit length */
    const real t0 = 0.5f*delta[3];
    const real t1 = 0.5f*delta[4];
    const real t2 = 0.5f*delta[5];
    const real q0 = state[3] - state[4]*t0 - state[5]*t1 - state[6]*t2;
    const real q1 = state[3]*t0 + state[4] + state[6]*t1 - state[5]*t2;
    const real q2 = state[3]*t1 + state[4]*t2 + state[5] - state[6]*t0;
    const real q3 = state[3]*t2 + state[5]*t0 + state[6] - state[4]*t1;
    /* how far from unit length: 1/√(1 + e) by its series */
    const real e = q0*q0 + q1*q1 + q2*q2 + q3*q3 - 1.0f;
    const real k = 1.0f + e*(e*(0.375f + (0.2734375f*e - 0.3125f)*e) - 0.5f);
    moved[0] = state[0] + delta[0];
    moved[1] = state[1] + delta[1];
    moved[2] = state[2] + delta[2];
    moved[3] = q0*k;
    moved[4] = q1*k;
    moved[5] = q2*k;
    moved[6] = q3*k;
}

/*
 * spatial: the state without what rounding added
 *     state ⊕ 0
 * in  state[7]       of the map, nearly
 * out moved[7]       the state
 * operations: 8 +, 12 *, 0 /, 0 sqrt
 */
INLINE void FN(map_spatial_tidy)(const real state[7], real moved[7])
{
    /* how far from unit length: 1/√(1 + e) by its series */
    const real e = state[3]*state[3] + state[4]*state[4] + state[5]*state[5] + state[6]*state[6] -
        1.0f;
    const real k = 1.0f + e*(e*(0.375f + (0.2734375f*e - 0.3125f)*e) - 0.5f);
    moved[0] = state[0];
    moved[1] = state[1];
    moved[2] = state[2];
    moved[3] = state[3]*k;
    moved[4] = state[4]*k;
    moved[5] = state[5]*k;
    moved[6] = state[6]*k;
}

#ifndef NARROW
/*
 * spatial: the reported orientation
 *     R = Rz(γ) Ry(β) Rx(α) (eq. 1)
 * in  state[7]       of the map
 * out angles[3]      α β γ [rad]
 * operations: 11 +, 25 *, 0 /, 1 sqrt
 */
INLINE void FN(map_spatial_angles)(const real state[7], real angles[3])
{
    const real t0 = 2.0f*state[6]*state[6] - 1.0f;
    const real R0 = -2.0f*state[5]*state[5] - t0;
    const real t1 = 2.0f*state[3];
    const real t2 = state[6]*t1;
    const real R1 = 2.0f*state[4]*state[5] - t2;
    const real t3 = state[5]*t1;
    const real t4 = 2.0f*state[4];
    const real R2 = state[6]*t4 + t3;
    const real R3 = state[5]*t4 + t2;
    const real R4 = -2.0f*state[4]*state[4] - t0;
    const real R5 = 2.0f*state[5]*state[6] - state[4]*t1;
    const real R6 = 2.0f*state[4]*state[6] - t3;
    const real gamma = arctangent2(R3, R0);
    /* α from Rz(γ)ᵀ R, which holds whatever γ is near β = ±90° */
    real sg, cg;
    FN(sincos)(gamma, &sg, &cg);
    const real alpha = arctangent2(R2*sg - R5*cg, R4*cg - R1*sg);
    const real beta = arctangent2(-R6, FN(root)(R0*R0 + R3*R3));
    angles[0] = alpha;
    angles[1] = beta;
    angles[2] = gamma;
}
#endif

/*
 * spatial: covector of a twist to covector of a step
 *     λ = ωᵀ ∂ω/∂δ + vᵀ ∂p/∂δ
 * in  state[7]       of the map
 * in  omega[3]       rotation part of the covector
 * in  v[3]           translation part of the covector
 * out row[6]         covector of the step
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_spatial_pull)(const real state[7], const real omega[3], const real v[3],
        real row[6])
{
    row[0] = v[0];
    row[1] = v[1];
    row[2] = v[2];
    row[3] = omega[0];
    row[4] = omega[1];
    row[5] = omega[2];
}

/*
 * spatial: rates of the pose for a step
 *     d(x y z α β γ) = M delta
 * in  state[7]       of the map
 * in  delta[6]       step [mm, rad]
 * out pose[6]        rates
 * operations: 8 +, 20 *, 1 /, 1 sqrt
 */
INLINE void FN(map_spatial_rates)(const real state[7], const real delta[6], real pose[6])
{
    /* sin β, cos β, and γ, from R */
    const real t0 = 2.0f*state[5];
    const real t1 = 2.0f*state[6];
    const real sb = state[3]*t0 - state[4]*t1;
    const real r00 = 1.0f - 2.0f*state[5]*state[5] - 2.0f*state[6]*state[6];
    const real r10 = state[3]*t1 + state[4]*t0;
    const real cb = FN(root)(r00*r00 + r10*r10);
    const real t2 = 1.0f/cb;
    const real sg = r10*t2;
    const real cg = r00*t2;
    /* E⁻¹ ω, ω = E (α̇, β̇, γ̇) */
    const real along = (delta[3]*cg + delta[4]*sg)*t2;
    pose[0] = delta[0];
    pose[1] = delta[1];
    pose[2] = delta[2];
    pose[3] = along;
    pose[4] = delta[4]*cg - delta[3]*sg;
    pose[5] = delta[5] + sb*along;
}

/*
 * spatial: twist of the frame for a step
 *     ω = ∂ω/∂δ δ, v = ∂p/∂δ δ
 * in  state[7]       of the map
 * in  delta[6]       step [mm, rad]
 * out twist[6]       (ω, v), base axes
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_spatial_twist)(const real state[7], const real delta[6], real twist[6])
{
    twist[0] = delta[3];
    twist[1] = delta[4];
    twist[2] = delta[5];
    twist[3] = delta[0];
    twist[4] = delta[1];
    twist[5] = delta[2];
}

/*
 * spatial: rates of the state for a step
 *     ∂state/∂delta delta
 * in  state[7]       of the map
 * in  delta[6]       step [mm, rad]
 * out rate[7]        rates of the state
 * operations: 8 +, 15 *, 0 /, 0 sqrt
 */
INLINE void FN(map_spatial_velocity)(const real state[7], const real delta[6], real rate[7])
{
    rate[0] = delta[0];
    rate[1] = delta[1];
    rate[2] = delta[2];
    const real t0 = 0.5f*delta[3];
    const real t1 = 0.5f*delta[4];
    const real t2 = 0.5f*delta[5];
    rate[3] = -state[4]*t0 - state[5]*t1 - state[6]*t2;
    rate[4] = state[3]*t0 + state[6]*t1 - state[5]*t2;
    rate[5] = state[3]*t1 + state[4]*t2 - state[6]*t0;
    rate[6] = state[3]*t2 + state[5]*t0 - state[4]*t1;
}

/*
 * spatial: covector of a step to one of the free coordinates
 *     ∂/∂free
 * in  state[7]       of the map
 * in  row[6]         covector of the step
 * out out[6]         by x y z alpha beta gamma
 * operations: 8 +, 21 *, 1 /, 1 sqrt
 */
INLINE void FN(map_spatial_free)(const real state[7], const real row[6], real out[6])
{
    /* sin β, cos β, and γ, from R */
    const real t0 = 2.0f*state[5];
    const real t1 = 2.0f*state[6];
    const real sb = state[3]*t0 - state[4]*t1;
    const real r00 = 1.0f - 2.0f*state[5]*state[5] - 2.0f*state[6]*state[6];
    const real r10 = state[3]*t1 + state[4]*t0;
    const real cb = FN(root)(r00*r00 + r10*r10);
    const real t2 = 1.0f/cb;
    const real sg = r10*t2;
    const real cg = r00*t2;
    out[0] = row[0];
    out[1] = row[1];
    out[2] = row[2];
    out[3] = row[3]*cb*cg + row[4]*cb*sg - row[5]*sb;
    out[4] = row[4]*cg - row[3]*sg;
    out[5] = row[5];
}

/*
 * translation: the state of a pose
 *     x y z, R = 1; state: p; step: v
 * in  pose[6]        x y z [mm], α β γ [rad]
 * out state[3]       of the map
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_translation_from_pose)(const real pose[6], real state[3])
{
    state[0] = pose[0];
    state[1] = pose[1];
    state[2] = pose[2];
}

/*
 * translation: the frame of a state
 *     R = Rz(γ) Ry(β) Rx(α) (eq. 1)
 * in  state[3]       of the map
 * out R[9]           platform to base, row by row
 * out p[3]           platform origin [mm]
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_translation_frame)(const real state[3], real R[9], real p[3])
{
    R[0] = FN(fill)(1.0f);
    R[1] = FN(fill)(0.0f);
    R[2] = FN(fill)(0.0f);
    R[3] = FN(fill)(0.0f);
    R[4] = FN(fill)(1.0f);
    R[5] = FN(fill)(0.0f);
    R[6] = FN(fill)(0.0f);
    R[7] = FN(fill)(0.0f);
    R[8] = FN(fill)(1.0f);
    p[0] = state[0];
    p[1] = state[1];
    p[2] = state[2];
}

/*
 * translation: the state moved by a step
 *     state ⊕ delta
 * in  state[3]       of the map
 * in  delta[3]       step [mm, rad]
 * out moved[3]       the new state
 * operations: 3 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_translation_retract)(const real state[3], const real delta[3], real moved[3])
{
    moved[0] = state[0] + delta[0];
    moved[1] = state[1] + delta[1];
    moved[2] = state[2] + delta[2];
}

/*
 * translation: the state without what rounding added
 *     state ⊕ 0
 * in  state[3]       of the map, nearly
 * out moved[3]       the state
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_translation_tidy)(const real state[3], real moved[3])
{
    moved[0] = state[0];
    moved[1] = state[1];
    moved[2] = state[2];
}

/*
 * translation: the reported orientation
 *     R = Rz(γ) Ry(β) Rx(α) (eq. 1)
 * in  state[3]       of the map
 * out angles[3]      α β γ [rad]
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_translation_angles)(const real state[3], real angles[3])
{
    angles[0] = FN(fill)(0.0f);
    angles[1] = FN(fill)(0.0f);
    angles[2] = FN(fill)(0.0f);
}

/*
 * translation: covector of a twist to covector of a step
 *     λ = ωᵀ ∂ω/∂δ + vᵀ ∂p/∂δ
 * in  state[3]       of the map
 * in  omega[3]       rotation part of the covector
 * in  v[3]           translation part of the covector
 * out row[3]         covector of the step
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_translation_pull)(const real state[3], const real omega[3], const real v[3],
        real row[3])
{
    row[0] = v[0];
    row[1] = v[1];
    row[2] = v[2];
}

/*
 * translation: rates of the pose for a step
 *     d(x y z α β γ) = M delta
 * in  state[3]       of the map
 * in  delta[3]       step [mm, rad]
 * out pose[6]        rates
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_translation_rates)(const real state[3], const real delta[3], real pose[6])
{
    pose[0] = delta[0];
    pose[1] = delta[1];
    pose[2] = delta[2];
    pose[3] = FN(fill)(0.0f);
    pose[4] = FN(fill)(0.0f);
    pose[5] = FN(fill)(0.0f);
}

/*
 * translation: twist of the frame for a step
 *     ω = ∂ω/∂δ δ, v = ∂p/∂δ δ
 * in  state[3]       of the map
 * in  delta[3]       step [mm, rad]
 * out twist[6]       (ω, v), base axes
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_translation_twist)(const real state[3], const real delta[3], real twist[6])
{
    twist[0] = FN(fill)(0.0f);
    twist[1] = FN(fill)(0.0f);
    twist[2] = FN(fill)(0.0f);
    twist[3] = delta[0];
    twist[4] = delta[1];
    twist[5] = delta[2];
}

/*
 * translation: rates of the state for a step
 *     ∂state/∂delta delta
 * in  state[3]       of the map
 * in  delta[3]       step [mm, rad]
 * out rate[3]        rates of the state
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_translation_velocity)(const real state[3], const real delta[3], real rate[3])
{
    rate[0] = delta[0];
    rate[1] = delta[1];
    rate[2] = delta[2];
}

/*
 * translation: covector of a step to one of the free coordinates
 *     ∂/∂free
 * in  state[3]       of the map
 * in  row[3]         covector of the step
 * out out[3]         by x y z
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_translation_free)(const real state[3], const real row[3], real out[3])
{
    out[0] = row[0];
    out[1] = row[1];
    out[2] = row[2];
}

#ifndef NARROW
/*
 * planar: the state of a pose
 *     x y γ in the plane z = 0; state: x, y, cos γ, sin γ; step: (vx, vy, ωz)
 * in  pose[6]        x y z [mm], α β γ [rad]
 * out state[4]       of the map
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_planar_from_pose)(const real pose[6], real state[4])
{
    real sg, cg;
    FN(sincos)(pose[5], &sg, &cg);
    state[0] = pose[0];
    state[1] = pose[1];
    state[2] = cg;
    state[3] = sg;
}
#endif

/*
 * planar: the frame of a state
 *     R = Rz(γ) Ry(β) Rx(α) (eq. 1)
 * in  state[4]       of the map
 * out R[9]           platform to base, row by row
 * out p[3]           platform origin [mm]
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_planar_frame)(const real state[4], real R[9], real p[3])
{
    R[0] = state[2];
    R[1] = -state[3];
    R[2] = FN(fill)(0.0f);
    R[3] = state[3];
    R[4] = state[2];
    R[5] = FN(fill)(0.0f);
    R[6] = FN(fill)(0.0f);
    R[7] = FN(fill)(0.0f);
    R[8] = FN(fill)(1.0f);
    p[0] = state[0];
    p[1] = state[1];
    p[2] = FN(fill)(0.0f);
}

/*
 * planar: the state moved by a step
 *     state ⊕ delta
 * in  state[4]       of the map
 * in  delta[3]       step [mm, rad]
 * out moved[4]       the new state
 * operations: 10 +, 10 *, 0 /, 0 sqrt
 */
INLINE void FN(map_planar_retract)(const real state[4], const real delta[3], real moved[4])
{
    const real xg = state[2] - state[3]*delta[2];
    const real yg = state[2]*delta[2] + state[3];
    /* how far from unit length: 1/√(1 + e) by its series */
    const real eg = xg*xg + yg*yg - 1.0f;
    const real kg = 1.0f + eg*(eg*(0.375f + (0.2734375f*eg - 0.3125f)*eg) - 0.5f);
    moved[0] = state[0] + delta[0];
    moved[1] = state[1] + delta[1];
    moved[2] = xg*kg;
    moved[3] = yg*kg;
}

/*
 * planar: the state without what rounding added
 *     state ⊕ 0
 * in  state[4]       of the map, nearly
 * out moved[4]       the state
 * operations: 6 +, 8 *, 0 /, 0 sqrt
 */
INLINE void FN(map_planar_tidy)(const real state[4], real moved[4])
{
    /* how far from unit length: 1/√(1 + e) by its series */
    const real eg = state[2]*state[2] + state[3]*state[3] - 1.0f;
    const real kg = 1.0f + eg*(eg*(0.375f + (0.2734375f*eg - 0.3125f)*eg) - 0.5f);
    moved[0] = state[0];
    moved[1] = state[1];
    moved[2] = state[2]*kg;
    moved[3] = state[3]*kg;
}

#ifndef NARROW
/*
 * planar: the reported orientation
 *     R = Rz(γ) Ry(β) Rx(α) (eq. 1)
 * in  state[4]       of the map
 * out angles[3]      α β γ [rad]
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_planar_angles)(const real state[4], real angles[3])
{
    const real gamma = arctangent2(state[3], state[2]);
    angles[0] = FN(fill)(0.0f);
    angles[1] = FN(fill)(0.0f);
    angles[2] = gamma;
}
#endif

/*
 * planar: covector of a twist to covector of a step
 *     λ = ωᵀ ∂ω/∂δ + vᵀ ∂p/∂δ
 * in  state[4]       of the map
 * in  omega[3]       rotation part of the covector
 * in  v[3]           translation part of the covector
 * out row[3]         covector of the step
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_planar_pull)(const real state[4], const real omega[3], const real v[3],
        real row[3])
{
    row[0] = v[0];
    row[1] = v[1];
    row[2] = omega[2];
}

/*
 * planar: rates of the pose for a step
 *     d(x y z α β γ) = M delta
 * in  state[4]       of the map
 * in  delta[3]       step [mm, rad]
 * out pose[6]        rates
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_planar_rates)(const real state[4], const real delta[3], real pose[6])
{
    pose[0] = delta[0];
    pose[1] = delta[1];
    pose[2] = FN(fill)(0.0f);
    pose[3] = FN(fill)(0.0f);
    pose[4] = FN(fill)(0.0f);
    pose[5] = delta[2];
}

/*
 * planar: twist of the frame for a step
 *     ω = ∂ω/∂δ δ, v = ∂p/∂δ δ
 * in  state[4]       of the map
 * in  delta[3]       step [mm, rad]
 * out twist[6]       (ω, v), base axes
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_planar_twist)(const real state[4], const real delta[3], real twist[6])
{
    twist[0] = FN(fill)(0.0f);
    twist[1] = FN(fill)(0.0f);
    twist[2] = delta[2];
    twist[3] = delta[0];
    twist[4] = delta[1];
    twist[5] = FN(fill)(0.0f);
}

/*
 * planar: rates of the state for a step
 *     ∂state/∂delta delta
 * in  state[4]       of the map
 * in  delta[3]       step [mm, rad]
 * out rate[4]        rates of the state
 * operations: 0 +, 2 *, 0 /, 0 sqrt
 */
INLINE void FN(map_planar_velocity)(const real state[4], const real delta[3], real rate[4])
{
    rate[0] = delta[0];
    rate[1] = delta[1];
    rate[2] = -state[3]*delta[2];
    rate[3] = state[2]*delta[2];
}

/*
 * planar: covector of a step to one of the free coordinates
 *     ∂/∂free
 * in  state[4]       of the map
 * in  row[3]         covector of the step
 * out out[3]         by x y gamma
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_planar_free)(const real state[4], const real row[3], real out[3])
{
    out[0] = row[0];
    out[1] = row[1];
    out[2] = row[2];
}

#ifndef NARROW
/*
 * 2tpr2tps: the state of a pose
 *     y z α β with x = z tan β, γ = 0 (A eq. 7); state: y, w = z / cos β, cos and sin of α, β
 * in  pose[6]        x y z [mm], α β γ [rad]
 * out state[6]       of the map
 * operations: 0 +, 0 *, 1 /, 0 sqrt
 */
INLINE void FN(map_2tpr2tps_from_pose)(const real pose[6], real state[6])
{
    real sa, ca;
    FN(sincos)(pose[3], &sa, &ca);
    real sb, cb;
    FN(sincos)(pose[4], &sb, &cb);
    state[0] = pose[1];
    state[1] = pose[2]/cb;
    state[2] = ca;
    state[3] = sa;
    state[4] = cb;
    state[5] = sb;
}
#endif

/*
 * 2tpr2tps: the frame of a state
 *     R = Rz(γ) Ry(β) Rx(α) (eq. 1)
 * in  state[6]       of the map
 * out R[9]           platform to base, row by row
 * out p[3]           platform origin [mm]
 * operations: 0 +, 6 *, 0 /, 0 sqrt
 */
INLINE void FN(map_2tpr2tps_frame)(const real state[6], real R[9], real p[3])
{
    R[0] = state[4];
    R[1] = state[3]*state[5];
    R[2] = state[2]*state[5];
    R[3] = FN(fill)(0.0f);
    R[4] = state[2];
    R[5] = -state[3];
    R[6] = -state[5];
    R[7] = state[3]*state[4];
    R[8] = state[2]*state[4];
    p[0] = state[1]*state[5];
    p[1] = state[0];
    p[2] = state[1]*state[4];
}

/*
 * 2tpr2tps: the state moved by a step
 *     state ⊕ delta
 * in  state[6]       of the map
 * in  delta[4]       step [mm, rad]
 * out moved[6]       the new state
 * operations: 18 +, 20 *, 0 /, 0 sqrt
 */
INLINE void FN(map_2tpr2tps_retract)(const real state[6], const real delta[4], real moved[6])
{
    const real xa = state[2] - state[3]*delta[2];
    const real ya = state[2]*delta[2] + state[3];
    /* how far from unit length: 1/√(1 + e) by its series */
    const real ea = xa*xa + ya*ya - 1.0f;
    const real ka = 1.0f + ea*(ea*(0.375f + (0.2734375f*ea - 0.3125f)*ea) - 0.5f);
    const real xb = state[4] - state[5]*delta[3];
    const real yb = state[4]*delta[3] + state[5];
    /* how far from unit length: 1/√(1 + e) by its series */
    const real eb = xb*xb + yb*yb - 1.0f;
    const real kb = 1.0f + eb*(eb*(0.375f + (0.2734375f*eb - 0.3125f)*eb) - 0.5f);
    moved[0] = state[0] + delta[0];
    moved[1] = state[1] + delta[1];
    moved[2] = xa*ka;
    moved[3] = ya*ka;
    moved[4] = xb*kb;
    moved[5] = yb*kb;
}

/*
 * 2tpr2tps: the state without what rounding added
 *     state ⊕ 0
 * in  state[6]       of the map, nearly
 * out moved[6]       the state
 * operations: 12 +, 16 *, 0 /, 0 sqrt
 */
INLINE void FN(map_2tpr2tps_tidy)(const real state[6], real moved[6])
{
    /* how far from unit length: 1/√(1 + e) by its series */
    const real ea = state[2]*state[2] + state[3]*state[3] - 1.0f;
    const real ka = 1.0f + ea*(ea*(0.375f + (0.2734375f*ea - 0.3125f)*ea) - 0.5f);
    /* how far from unit length: 1/√(1 + e) by its series */
    const real eb = state[4]*state[4] + state[5]*state[5] - 1.0f;
    const real kb = 1.0f + eb*(eb*(0.375f + (0.2734375f*eb - 0.3125f)*eb) - 0.5f);
    moved[0] = state[0];
    moved[1] = state[1];
    moved[2] = state[2]*ka;
    moved[3] = state[3]*ka;
    moved[4] = state[4]*kb;
    moved[5] = state[5]*kb;
}

#ifndef NARROW
/*
 * 2tpr2tps: the reported orientation
 *     R = Rz(γ) Ry(β) Rx(α) (eq. 1)
 * in  state[6]       of the map
 * out angles[3]      α β γ [rad]
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_2tpr2tps_angles)(const real state[6], real angles[3])
{
    const real alpha = arctangent2(state[3], state[2]);
    const real beta = arctangent2(state[5], state[4]);
    angles[0] = alpha;
    angles[1] = beta;
    angles[2] = FN(fill)(0.0f);
}
#endif

/*
 * 2tpr2tps: covector of a twist to covector of a step
 *     λ = ωᵀ ∂ω/∂δ + vᵀ ∂p/∂δ
 * in  state[6]       of the map
 * in  omega[3]       rotation part of the covector
 * in  v[3]           translation part of the covector
 * out row[4]         covector of the step
 * operations: 4 +, 8 *, 0 /, 0 sqrt
 */
INLINE void FN(map_2tpr2tps_pull)(const real state[6], const real omega[3], const real v[3],
        real row[4])
{
    row[0] = v[1];
    row[1] = state[4]*v[2] + state[5]*v[0];
    row[2] = state[4]*omega[0] - state[5]*omega[2];
    row[3] = state[1]*state[4]*v[0] + omega[1] - state[1]*state[5]*v[2];
}

/*
 * 2tpr2tps: rates of the pose for a step
 *     d(x y z α β γ) = M delta
 * in  state[6]       of the map
 * in  delta[4]       step [mm, rad]
 * out pose[6]        rates
 * operations: 2 +, 5 *, 0 /, 0 sqrt
 */
INLINE void FN(map_2tpr2tps_rates)(const real state[6], const real delta[4], real pose[6])
{
    const real t0 = state[1]*delta[3];
    pose[0] = state[4]*t0 + state[5]*delta[1];
    pose[1] = delta[0];
    pose[2] = state[4]*delta[1] - state[5]*t0;
    pose[3] = delta[2];
    pose[4] = delta[3];
    pose[5] = FN(fill)(0.0f);
}

/*
 * 2tpr2tps: twist of the frame for a step
 *     ω = ∂ω/∂δ δ, v = ∂p/∂δ δ
 * in  state[6]       of the map
 * in  delta[4]       step [mm, rad]
 * out twist[6]       (ω, v), base axes
 * operations: 2 +, 7 *, 0 /, 0 sqrt
 */
INLINE void FN(map_2tpr2tps_twist)(const real state[6], const real delta[4], real twist[6])
{
    twist[0] = state[4]*delta[2];
    twist[1] = delta[3];
    twist[2] = -state[5]*delta[2];
    const real t0 = state[1]*delta[3];
    twist[3] = state[4]*t0 + state[5]*delta[1];
    twist[4] = delta[0];
    twist[5] = state[4]*delta[1] - state[5]*t0;
}

/*
 * 2tpr2tps: rates of the state for a step
 *     ∂state/∂delta delta
 * in  state[6]       of the map
 * in  delta[4]       step [mm, rad]
 * out rate[6]        rates of the state
 * operations: 0 +, 4 *, 0 /, 0 sqrt
 */
INLINE void FN(map_2tpr2tps_velocity)(const real state[6], const real delta[4], real rate[6])
{
    rate[0] = delta[0];
    rate[1] = delta[1];
    rate[2] = -state[3]*delta[2];
    rate[3] = state[2]*delta[2];
    rate[4] = -state[5]*delta[3];
    rate[5] = state[4]*delta[3];
}

/*
 * 2tpr2tps: covector of a step to one of the free coordinates
 *     ∂/∂free
 * in  state[6]       of the map
 * in  row[4]         covector of the step
 * out out[4]         by y z alpha beta
 * operations: 1 +, 3 *, 1 /, 0 sqrt
 */
INLINE void FN(map_2tpr2tps_free)(const real state[6], const real row[4], real out[4])
{
    const real k = 1.0f/state[4];
    out[0] = row[0];
    const real t0 = row[1]*k;
    out[1] = t0;
    out[2] = row[2];
    out[3] = state[1]*state[5]*t0 + row[3];
}

#ifndef NARROW
/*
 * spherical: the state of a pose
 *     α β γ about the origin, p = 0; state: the unit quaternion of R; step: ω
 * in  pose[6]        x y z [mm], α β γ [rad]
 * out state[4]       of the map
 * operations: 4 +, 16 *, 0 /, 0 sqrt
 */
INLINE void FN(map_spherical_from_pose)(const real pose[6], real state[4])
{
    /* half angles */
    real sa, ca;
    FN(sincos)(0.5f*pose[3], &sa, &ca);
    real sb, cb;
    FN(sincos)(0.5f*pose[4], &sb, &cb);
    real sg, cg;
    FN(sincos)(0.5f*pose[5], &sg, &cg);
    const real t0 = sb*sg;
    state[0] = sa*t0 + ca*cb*cg;
    state[1] = sa*cb*cg - ca*t0;
    const real t1 = sb*cg;
    const real t2 = cb*sg;
    state[2] = sa*t2 + ca*t1;
    state[3] = ca*t2 - sa*t1;
}
#endif

/*
 * spherical: the frame of a state
 *     R = Rz(γ) Ry(β) Rx(α) (eq. 1)
 * in  state[4]       of the map
 * out R[9]           platform to base, row by row
 * out p[3]           platform origin [mm]
 * operations: 11 +, 21 *, 0 /, 0 sqrt
 */
INLINE void FN(map_spherical_frame)(const real state[4], real R[9], real p[3])
{
    const real t0 = 2.0f*state[2]*state[2];
    const real t1 = 2.0f*state[3]*state[3] - 1.0f;
    R[0] = -t0 - t1;
    const real t2 = 2.0f*state[0];
    const real t3 = state[3]*t2;
    R[1] = 2.0f*state[1]*state[2] - t3;
    const real t4 = state[2]*t2;
    const real t5 = 2.0f*state[1];
    R[2] = state[3]*t5 + t4;
    R[3] = state[2]*t5 + t3;
    const real t6 = 2.0f*state[1]*state[1];
    R[4] = -t1 - t6;
    const real t7 = state[1]*t2;
    R[5] = 2.0f*state[2]*state[3] - t7;
    R[6] = 2.0f*state[1]*state[3] - t4;
    R[7] = 2.0f*state[2]*state[3] + t7;
    R[8] = 1.0f - t0 - t6;
    p[0] = FN(fill)(0.0f);
    p[1] = FN(fill)(0.0f);
    p[2] = FN(fill)(0.0f);
}

/*
 * spherical: the state moved by a step
 *     state ⊕ delta
 * in  state[4]       of the map
 * in  delta[3]       step [mm, rad]
 * out moved[4]       the new state
 * operations: 20 +, 27 *, 0 /, 0 sqrt
 */
INLINE void FN(map_spherical_retract)(const real state[4], const real delta[3], real moved[4])
{
    /* (1, ω/2) q, then to unit length */
    const real t0 = 0.5f*delta[0];
    const real t1 = 0.5f*delta[1];
    const real t2 = 0.5f*delta[2];
    const real q0 = state[0] - state[1]*t0 - state[2]*t1 - state[3]*t2;
    const real q1 = state[0]*t0 + state[1] + state[3]*t1 - state[2]*t2;
    const real q2 = state[0]*t1 + state[1]*t2 + state[2] - state[3]*t0;
    const real q3 = state[0]*t2 + state[2]*t0 + state[3] - state[1]*t1;
    /* how far from unit length: 1/√(1 + e) by its series */
    const real e = q0*q0 + q1*q1 + q2*q2 + q3*q3 - 1.0f;
    const real k = 1.0f + e*(e*(0.375f + (0.2734375f*e - 0.3125f)*e) - 0.5f);
    moved[0] = q0*k;
    moved[1] = q1*k;
    moved[2] = q2*k;
    moved[3] = q3*k;
}

/*
 * spherical: the state without what rounding added
 *     state ⊕ 0
 * in  state[4]       of the map, nearly
 * out moved[4]       the state
 * operations: 8 +, 12 *, 0 /, 0 sqrt
 */
INLINE void FN(map_spherical_tidy)(const real state[4], real moved[4])
{
    /* how far from unit length: 1/√(1 + e) by its series */
    const real e = state[0]*state[0] + state[1]*state[1] + state[2]*state[2] + state[3]*state[3] -
        1.0f;
    const real k = 1.0f + e*(e*(0.375f + (0.2734375f*e - 0.3125f)*e) - 0.5f);
    moved[0] = state[0]*k;
    moved[1] = state[1]*k;
    moved[2] = state[2]*k;
    moved[3] = state[3]*k;
}

#ifndef NARROW
/*
 * spherical: the reported orientation
 *     R = Rz(γ) Ry(β) Rx(α) (eq. 1)
 * in  state[4]       of the map
 * out angles[3]      α β γ [rad]
 * operations: 11 +, 25 *, 0 /, 1 sqrt
 */
INLINE void FN(map_spherical_angles)(const real state[4], real angles[3])
{
    const real t0 = 2.0f*state[3]*state[3] - 1.0f;
    const real R0 = -2.0f*state[2]*state[2] - t0;
    const real t1 = 2.0f*state[0];
    const real t2 = state[3]*t1;
    const real R1 = 2.0f*state[1]*state[2] - t2;
    const real t3 = state[2]*t1;
    const real t4 = 2.0f*state[1];
    const real R2 = state[3]*t4 + t3;
    const real R3 = state[2]*t4 + t2;
    const real R4 = -2.0f*state[1]*state[1] - t0;
    const real R5 = 2.0f*state[2]*state[3] - state[1]*t1;
    const real R6 = 2.0f*state[1]*state[3] - t3;
    const real gamma = arctangent2(R3, R0);
    /* α from Rz(γ)ᵀ R, which holds whatever γ is near β = ±90° */
    real sg, cg;
    FN(sincos)(gamma, &sg, &cg);
    const real alpha = arctangent2(R2*sg - R5*cg, R4*cg - R1*sg);
    const real beta = arctangent2(-R6, FN(root)(R0*R0 + R3*R3));
    angles[0] = alpha;
    angles[1] = beta;
    angles[2] = gamma;
}
#endif

/*
 * spherical: covector of a twist to covector of a step
 *     λ = ωᵀ ∂ω/∂δ + vᵀ ∂p/∂δ
 * in  state[4]       of the map
 * in  omega[3]       rotation part of the covector
 * in  v[3]           translation part of the covector
 * out row[3]         covector of the step
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_spherical_pull)(const real state[4], const real omega[3], const real v[3],
        real row[3])
{
    row[0] = omega[0];
    row[1] = omega[1];
    row[2] = omega[2];
}

/*
 * spherical: rates of the pose for a step
 *     d(x y z α β γ) = M delta
 * in  state[4]       of the map
 * in  delta[3]       step [mm, rad]
 * out pose[6]        rates
 * operations: 8 +, 20 *, 1 /, 1 sqrt
 */
INLINE void FN(map_spherical_rates)(const real state[4], const real delta[3], real pose[6])
{
    /* sin β, cos β, and γ, from R */
    const real t0 = 2.0f*state[2];
    const real t1 = 2.0f*state[3];
    const real sb = state[0]*t0 - state[1]*t1;
    const real r00 = 1.0f - 2.0f*state[2]*state[2] - 2.0f*state[3]*state[3];
    const real r10 = state[0]*t1 + state[1]*t0;
    const real cb = FN(root)(r00*r00 + r10*r10);
    const real t2 = 1.0f/cb;
    const real sg = r10*t2;
    const real cg = r00*t2;
    /* E⁻¹ ω, ω = E (α̇, β̇, γ̇) */
    const real along = (delta[0]*cg + delta[1]*sg)*t2;
    pose[0] = FN(fill)(0.0f);
    pose[1] = FN(fill)(0.0f);
    pose[2] = FN(fill)(0.0f);
    pose[3] = along;
    pose[4] = delta[1]*cg - delta[0]*sg;
    pose[5] = delta[2] + sb*along;
}

/*
 * spherical: twist of the frame for a step
 *     ω = ∂ω/∂δ δ, v = ∂p/∂δ δ
 * in  state[4]       of the map
 * in  delta[3]       step [mm, rad]
 * out twist[6]       (ω, v), base axes
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_spherical_twist)(const real state[4], const real delta[3], real twist[6])
{
    twist[0] = delta[0];
    twist[1] = delta[1];
    twist[2] = delta[2];
    twist[3] = FN(fill)(0.0f);
    twist[4] = FN(fill)(0.0f);
    twist[5] = FN(fill)(0.0f);
}

/*
 * spherical: rates of the state for a step
 *     ∂state/∂delta delta
 * in  state[4]       of the map
 * in  delta[3]       step [mm, rad]
 * out rate[4]        rates of the state
 * operations: 8 +, 15 *, 0 /, 0 sqrt
 */
INLINE void FN(map_spherical_velocity)(const real state[4], const real delta[3], real rate[4])
{
    const real t0 = 0.5f*delta[0];
    const real t1 = 0.5f*delta[1];
    const real t2 = 0.5f*delta[2];
    rate[0] = -state[1]*t0 - state[2]*t1 - state[3]*t2;
    rate[1] = state[0]*t0 + state[3]*t1 - state[2]*t2;
    rate[2] = state[0]*t1 + state[1]*t2 - state[3]*t0;
    rate[3] = state[0]*t2 + state[2]*t0 - state[1]*t1;
}

/*
 * spherical: covector of a step to one of the free coordinates
 *     ∂/∂free
 * in  state[4]       of the map
 * in  row[3]         covector of the step
 * out out[3]         by alpha beta gamma
 * operations: 8 +, 21 *, 1 /, 1 sqrt
 */
INLINE void FN(map_spherical_free)(const real state[4], const real row[3], real out[3])
{
    /* sin β, cos β, and γ, from R */
    const real t0 = 2.0f*state[2];
    const real t1 = 2.0f*state[3];
    const real sb = state[0]*t0 - state[1]*t1;
    const real r00 = 1.0f - 2.0f*state[2]*state[2] - 2.0f*state[3]*state[3];
    const real r10 = state[0]*t1 + state[1]*t0;
    const real cb = FN(root)(r00*r00 + r10*r10);
    const real t2 = 1.0f/cb;
    const real sg = r10*t2;
    const real cg = r00*t2;
    out[0] = row[0]*cb*cg + row[1]*cb*sg - row[2]*sb;
    out[1] = row[1]*cg - row[0]*sg;
    out[2] = row[2];
}

/*
 * xy: the state of a pose
 *     x y in the plane z = 0, R = 1; state: x, y; step: (vx, vy)
 * in  pose[6]        x y z [mm], α β γ [rad]
 * out state[2]       of the map
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_xy_from_pose)(const real pose[6], real state[2])
{
    state[0] = pose[0];
    state[1] = pose[1];
}

/*
 * xy: the frame of a state
 *     R = Rz(γ) Ry(β) Rx(α) (eq. 1)
 * in  state[2]       of the map
 * out R[9]           platform to base, row by row
 * out p[3]           platform origin [mm]
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_xy_frame)(const real state[2], real R[9], real p[3])
{
    R[0] = FN(fill)(1.0f);
    R[1] = FN(fill)(0.0f);
    R[2] = FN(fill)(0.0f);
    R[3] = FN(fill)(0.0f);
    R[4] = FN(fill)(1.0f);
    R[5] = FN(fill)(0.0f);
    R[6] = FN(fill)(0.0f);
    R[7] = FN(fill)(0.0f);
    R[8] = FN(fill)(1.0f);
    p[0] = state[0];
    p[1] = state[1];
    p[2] = FN(fill)(0.0f);
}

/*
 * xy: the state moved by a step
 *     state ⊕ delta
 * in  state[2]       of the map
 * in  delta[2]       step [mm, rad]
 * out moved[2]       the new state
 * operations: 2 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_xy_retract)(const real state[2], const real delta[2], real moved[2])
{
    moved[0] = state[0] + delta[0];
    moved[1] = state[1] + delta[1];
}

/*
 * xy: the state without what rounding added
 *     state ⊕ 0
 * in  state[2]       of the map, nearly
 * out moved[2]       the state
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_xy_tidy)(const real state[2], real moved[2])
{
    moved[0] = state[0];
    moved[1] = state[1];
}

/*
 * xy: the reported orientation
 *     R = Rz(γ) Ry(β) Rx(α) (eq. 1)
 * in  state[2]       of the map
 * out angles[3]      α β γ [rad]
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_xy_angles)(const real state[2], real angles[3])
{
    angles[0] = FN(fill)(0.0f);
    angles[1] = FN(fill)(0.0f);
    angles[2] = FN(fill)(0.0f);
}

/*
 * xy: covector of a twist to covector of a step
 *     λ = ωᵀ ∂ω/∂δ + vᵀ ∂p/∂δ
 * in  state[2]       of the map
 * in  omega[3]       rotation part of the covector
 * in  v[3]           translation part of the covector
 * out row[2]         covector of the step
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_xy_pull)(const real state[2], const real omega[3], const real v[3], real row[2])
{
    row[0] = v[0];
    row[1] = v[1];
}

/*
 * xy: rates of the pose for a step
 *     d(x y z α β γ) = M delta
 * in  state[2]       of the map
 * in  delta[2]       step [mm, rad]
 * out pose[6]        rates
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_xy_rates)(const real state[2], const real delta[2], real pose[6])
{
    pose[0] = delta[0];
    pose[1] = delta[1];
    pose[2] = FN(fill)(0.0f);
    pose[3] = FN(fill)(0.0f);
    pose[4] = FN(fill)(0.0f);
    pose[5] = FN(fill)(0.0f);
}

/*
 * xy: twist of the frame for a step
 *     ω = ∂ω/∂δ δ, v = ∂p/∂δ δ
 * in  state[2]       of the map
 * in  delta[2]       step [mm, rad]
 * out twist[6]       (ω, v), base axes
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_xy_twist)(const real state[2], const real delta[2], real twist[6])
{
    twist[0] = FN(fill)(0.0f);
    twist[1] = FN(fill)(0.0f);
    twist[2] = FN(fill)(0.0f);
    twist[3] = delta[0];
    twist[4] = delta[1];
    twist[5] = FN(fill)(0.0f);
}

/*
 * xy: rates of the state for a step
 *     ∂state/∂delta delta
 * in  state[2]       of the map
 * in  delta[2]       step [mm, rad]
 * out rate[2]        rates of the state
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_xy_velocity)(const real state[2], const real delta[2], real rate[2])
{
    rate[0] = delta[0];
    rate[1] = delta[1];
}

/*
 * xy: covector of a step to one of the free coordinates
 *     ∂/∂free
 * in  state[2]       of the map
 * in  row[2]         covector of the step
 * out out[2]         by x y
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_xy_free)(const real state[2], const real row[2], real out[2])
{
    out[0] = row[0];
    out[1] = row[1];
}
