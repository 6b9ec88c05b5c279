/* Generated from derive/rates.py by `python -m derive`; never edited by hand.
 * derivation 481631c8fc81851c
 * `real` is a number or a lane of numbers, FN(name) the function for that type. */

/*
 * length: velocity and acceleration of q̃ as the joint moves
 *     Φ(h(t), q̃(t)) = 0 differentiated twice by t, solved for dq̃/dt and d²q̃/dt²
 * in  qt             q̃ [mm or rad]
 * in  h[3]           p + R b - base [mm]
 * in  h1[3]          its velocity [/s]
 * in  h2[3]          its acceleration [/s²]
 * in  first[3]       s, or crank e
 * in  second[3]      0, or crank axis × e
 * out qt1            dq̃/dt [mm/s or rad/s]
 * out qt2            d²q̃/dt² [mm/s² or rad/s²]
 * operations: 8 +, 12 *, 1 /, 0 sqrt
 */
INLINE void FN(length_rates)(real qt, const real h[3], const real h1[3], const real h2[3],
        const real first[3], const real second[3], real *qt1, real *qt2)
{
    /* dq̃/dt */
    const real t0 = 1.0f/qt;
    const real speed = -(-h[0]*h1[0] - h[1]*h1[1] - h[2]*h1[2])*t0;
    *qt1 = speed;
    *qt2 = -(speed*speed - h[0]*h2[0] - h[1]*h2[1] - h[2]*h2[2] - h1[0]*h1[0] - h1[1]*h1[1] -
        h1[2]*h1[2])*t0;
}

/*
 * slider: velocity and acceleration of q̃ as the joint moves
 *     Φ(h(t), q̃(t)) = 0 differentiated twice by t, solved for dq̃/dt and d²q̃/dt²
 * in  qt             q̃ [mm or rad]
 * in  h[3]           p + R b - base [mm]
 * in  h1[3]          its velocity [/s]
 * in  h2[3]          its acceleration [/s²]
 * in  first[3]       s, or crank e
 * in  second[3]      0, or crank axis × e
 * out qt1            dq̃/dt [mm/s or rad/s]
 * out qt2            d²q̃/dt² [mm/s² or rad/s²]
 * operations: 15 +, 20 *, 1 /, 0 sqrt
 */
INLINE void FN(slider_rates)(real qt, const real h[3], const real h1[3], const real h2[3],
        const real first[3], const real second[3], real *qt1, real *qt2)
{
    /* from the anchor to the joint */
    const real d0 = h[0] - qt*first[0];
    const real d1 = h[1] - qt*first[1];
    const real d2 = h[2] - qt*first[2];
    /* ∂Φ/∂q̃ */
    const real by_q = -first[0]*d0 - first[1]*d1 - first[2]*d2;
    /* dq̃/dt */
    const real t0 = 1.0f/by_q;
    const real speed = (-h1[0]*d0 - h1[1]*d1 - h1[2]*d2)*t0;
    /* of d */
    const real velocity0 = h1[0] - first[0]*speed;
    const real velocity1 = h1[1] - first[1]*speed;
    const real velocity2 = h1[2] - first[2]*speed;
    *qt1 = speed;
    *qt2 = (-h2[0]*d0 - h2[1]*d1 - h2[2]*d2 - velocity0*velocity0 - velocity1*velocity1 -
        velocity2*velocity2)*t0;
}

#ifndef NARROW
/*
 * crank: velocity and acceleration of q̃ as the joint moves
 *     Φ(h(t), q̃(t)) = 0 differentiated twice by t, solved for dq̃/dt and d²q̃/dt²
 * in  qt             q̃ [mm or rad]
 * in  h[3]           p + R b - base [mm]
 * in  h1[3]          its velocity [/s]
 * in  h2[3]          its acceleration [/s²]
 * in  first[3]       s, or crank e
 * in  second[3]      0, or crank axis × e
 * out qt1            dq̃/dt [mm/s or rad/s]
 * out qt2            d²q̃/dt² [mm/s² or rad/s²]
 * operations: 30 +, 42 *, 1 /, 0 sqrt
 */
INLINE void FN(crank_rates)(real qt, const real h[3], const real h1[3], const real h2[3],
        const real first[3], const real second[3], real *qt1, real *qt2)
{
    real sq, cq;
    FN(sincos)(qt, &sq, &cq);
    /* from the anchor to the joint */
    const real t0 = first[0]*cq;
    const real t1 = second[0]*sq;
    const real d0 = h[0] - t0 - t1;
    const real t2 = first[1]*cq;
    const real t3 = second[1]*sq;
    const real d1 = h[1] - t2 - t3;
    const real t4 = first[2]*cq;
    const real t5 = second[2]*sq;
    const real d2 = h[2] - t4 - t5;
    /* ∂Φ/∂q̃ */
    const real t6 = second[0]*cq;
    const real t7 = second[1]*cq;
    const real t8 = second[2]*cq;
    const real by_q = (first[0]*sq - t6)*d0 + (first[1]*sq - t7)*d1 + (first[2]*sq - t8)*d2;
    /* dq̃/dt */
    const real t9 = 1.0f/by_q;
    const real speed = (-h1[0]*d0 - h1[1]*d1 - h1[2]*d2)*t9;
    /* of d */
    const real velocity0 = h1[0] + first[0]*sq*speed - speed*t6;
    const real velocity1 = h1[1] + first[1]*sq*speed - speed*t7;
    const real velocity2 = h1[2] + first[2]*sq*speed - speed*t8;
    /* d̈ without d²q̃/dt² */
    const real t10 = speed*speed;
    const real bend0 = h2[0] + t0*t10 + t1*t10;
    const real bend1 = h2[1] + t2*t10 + t3*t10;
    const real bend2 = h2[2] + t4*t10 + t5*t10;
    *qt1 = speed;
    *qt2 = (-d0*bend0 - d1*bend1 - d2*bend2 - velocity0*velocity0 - velocity1*velocity1 -
        velocity2*velocity2)*t9;
}
#endif

/*
 * length: how the sphere row bends as joint and actuator move
 *     d²Φ/dt²,  Φ = (d·d - ρ²)/2,  c = base, ρ = q̃
 * in  qt             q̃ [mm or rad]
 * in  qt1            dq̃/dt [/s]
 * in  qt2            d²q̃/dt² [/s²]
 * in  h[3]           p + R b - base [mm]
 * in  h1[3]          its velocity [/s]
 * in  h2[3]          its acceleration [/s²]
 * in  first[3]       s, or crank e
 * in  second[3]      0, or crank axis × e
 * out phi2           d²Φ/dt² [mm²/s²]
 * operations: 7 +, 8 *, 0 /, 0 sqrt
 */
INLINE void FN(length_bend)(real qt, real qt1, real qt2, const real h[3], const real h1[3],
        const real h2[3], const real first[3], const real second[3], real *phi2)
{
    *phi2 = h[0]*h2[0] + h[1]*h2[1] + h[2]*h2[2] + h1[0]*h1[0] + h1[1]*h1[1] + h1[2]*h1[2] - qt*qt2
        - qt1*qt1;
}

/*
 * slider: how the sphere row bends as joint and actuator move
 *     d²Φ/dt²,  Φ = (d·d - ρ²)/2,  c = base + q̃ s, ρ = rod
 * in  qt             q̃ [mm or rad]
 * in  qt1            dq̃/dt [/s]
 * in  qt2            d²q̃/dt² [/s²]
 * in  h[3]           p + R b - base [mm]
 * in  h1[3]          its velocity [/s]
 * in  h2[3]          its acceleration [/s²]
 * in  first[3]       s, or crank e
 * in  second[3]      0, or crank axis × e
 * out phi2           d²Φ/dt² [mm²/s²]
 * operations: 14 +, 15 *, 0 /, 0 sqrt
 */
INLINE void FN(slider_bend)(real qt, real qt1, real qt2, const real h[3], const real h1[3],
        const real h2[3], const real first[3], const real second[3], real *phi2)
{
    const real d0 = h[0] - qt*first[0];
    const real d1 = h[1] - qt*first[1];
    const real d2 = h[2] - qt*first[2];
    const real velocity0 = h1[0] - qt1*first[0];
    const real velocity1 = h1[1] - qt1*first[1];
    const real velocity2 = h1[2] - qt1*first[2];
    const real acceleration0 = h2[0] - qt2*first[0];
    const real acceleration1 = h2[1] - qt2*first[1];
    const real acceleration2 = h2[2] - qt2*first[2];
    *phi2 = d0*acceleration0 + d1*acceleration1 + d2*acceleration2 + velocity0*velocity0 +
        velocity1*velocity1 + velocity2*velocity2;
}

#ifndef NARROW
/*
 * crank: how the sphere row bends as joint and actuator move
 *     d²Φ/dt²,  Φ = (d·d - ρ²)/2,  c = base + crank Rot(axis, q̃) e, ρ = rod
 * in  qt             q̃ [mm or rad]
 * in  qt1            dq̃/dt [/s]
 * in  qt2            d²q̃/dt² [/s²]
 * in  h[3]           p + R b - base [mm]
 * in  h1[3]          its velocity [/s]
 * in  h2[3]          its acceleration [/s²]
 * in  first[3]       s, or crank e
 * in  second[3]      0, or crank axis × e
 * out phi2           d²Φ/dt² [mm²/s²]
 * operations: 29 +, 35 *, 0 /, 0 sqrt
 */
INLINE void FN(crank_bend)(real qt, real qt1, real qt2, const real h[3], const real h1[3],
        const real h2[3], const real first[3], const real second[3], real *phi2)
{
    real sq, cq;
    FN(sincos)(qt, &sq, &cq);
    const real t0 = first[0]*cq;
    const real t1 = second[0]*sq;
    const real d0 = h[0] - t0 - t1;
    const real t2 = first[1]*cq;
    const real t3 = second[1]*sq;
    const real d1 = h[1] - t2 - t3;
    const real t4 = first[2]*cq;
    const real t5 = second[2]*sq;
    const real d2 = h[2] - t4 - t5;
    const real t6 = qt1*sq;
    const real t7 = qt1*cq;
    const real velocity0 = h1[0] + first[0]*t6 - second[0]*t7;
    const real velocity1 = h1[1] + first[1]*t6 - second[1]*t7;
    const real velocity2 = h1[2] + first[2]*t6 - second[2]*t7;
    const real t8 = qt2*sq;
    const real t9 = qt2*cq;
    const real t10 = qt1*qt1;
    const real acceleration0 = h2[0] + first[0]*t8 + t0*t10 + t1*t10 - second[0]*t9;
    const real acceleration1 = h2[1] + first[1]*t8 + t2*t10 + t3*t10 - second[1]*t9;
    const real acceleration2 = h2[2] + first[2]*t8 + t4*t10 + t5*t10 - second[2]*t9;
    *phi2 = d0*acceleration0 + d1*acceleration1 + d2*acceleration2 + velocity0*velocity0 +
        velocity1*velocity1 + velocity2*velocity2;
}
#endif

/*
 * length: from the anchor to the joint as joint and actuator move
 *     d, ḋ, d̈ of d = p + R b - c,  c = base, ρ = q̃
 * in  qt             q̃ [mm or rad]
 * in  qt1            dq̃/dt [/s]
 * in  qt2            d²q̃/dt² [/s²]
 * in  h[3]           p + R b - base [mm]
 * in  h1[3]          its velocity [/s]
 * in  h2[3]          its acceleration [/s²]
 * in  first[3]       s, or crank e
 * in  second[3]      0, or crank axis × e
 * out d[3]           [mm, /s, /s²]
 * out d1[3]          [mm, /s, /s²]
 * out d2[3]          [mm, /s, /s²]
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(length_path)(real qt, real qt1, real qt2, const real h[3], const real h1[3],
        const real h2[3], const real first[3], const real second[3], real d[3], real d1[3],
        real d2[3])
{
    d[0] = h[0];
    d[1] = h[1];
    d[2] = h[2];
    d1[0] = h1[0];
    d1[1] = h1[1];
    d1[2] = h1[2];
    d2[0] = h2[0];
    d2[1] = h2[1];
    d2[2] = h2[2];
}

/*
 * slider: from the anchor to the joint as joint and actuator move
 *     d, ḋ, d̈ of d = p + R b - c,  c = base + q̃ s, ρ = rod
 * in  qt             q̃ [mm or rad]
 * in  qt1            dq̃/dt [/s]
 * in  qt2            d²q̃/dt² [/s²]
 * in  h[3]           p + R b - base [mm]
 * in  h1[3]          its velocity [/s]
 * in  h2[3]          its acceleration [/s²]
 * in  first[3]       s, or crank e
 * in  second[3]      0, or crank axis × e
 * out d[3]           [mm, /s, /s²]
 * out d1[3]          [mm, /s, /s²]
 * out d2[3]          [mm, /s, /s²]
 * operations: 9 +, 9 *, 0 /, 0 sqrt
 */
INLINE void FN(slider_path)(real qt, real qt1, real qt2, const real h[3], const real h1[3],
        const real h2[3], const real first[3], const real second[3], real d[3], real d1[3],
        real d2[3])
{
    d[0] = h[0] - qt*first[0];
    d[1] = h[1] - qt*first[1];
    d[2] = h[2] - qt*first[2];
    d1[0] = h1[0] - qt1*first[0];
    d1[1] = h1[1] - qt1*first[1];
    d1[2] = h1[2] - qt1*first[2];
    d2[0] = h2[0] - qt2*first[0];
    d2[1] = h2[1] - qt2*first[1];
    d2[2] = h2[2] - qt2*first[2];
}

#ifndef NARROW
/*
 * crank: from the anchor to the joint as joint and actuator move
 *     d, ḋ, d̈ of d = p + R b - c,  c = base + crank Rot(axis, q̃) e, ρ = rod
 * in  qt             q̃ [mm or rad]
 * in  qt1            dq̃/dt [/s]
 * in  qt2            d²q̃/dt² [/s²]
 * in  h[3]           p + R b - base [mm]
 * in  h1[3]          its velocity [/s]
 * in  h2[3]          its acceleration [/s²]
 * in  first[3]       s, or crank e
 * in  second[3]      0, or crank axis × e
 * out d[3]           [mm, /s, /s²]
 * out d1[3]          [mm, /s, /s²]
 * out d2[3]          [mm, /s, /s²]
 * operations: 24 +, 29 *, 0 /, 0 sqrt
 */
INLINE void FN(crank_path)(real qt, real qt1, real qt2, const real h[3], const real h1[3],
        const real h2[3], const real first[3], const real second[3], real d[3], real d1[3],
        real d2[3])
{
    real sq, cq;
    FN(sincos)(qt, &sq, &cq);
    const real t0 = first[0]*cq;
    const real t1 = second[0]*sq;
    d[0] = h[0] - t0 - t1;
    const real t2 = first[1]*cq;
    const real t3 = second[1]*sq;
    d[1] = h[1] - t2 - t3;
    const real t4 = first[2]*cq;
    const real t5 = second[2]*sq;
    d[2] = h[2] - t4 - t5;
    const real t6 = qt1*sq;
    const real t7 = qt1*cq;
    d1[0] = h1[0] + first[0]*t6 - second[0]*t7;
    d1[1] = h1[1] + first[1]*t6 - second[1]*t7;
    d1[2] = h1[2] + first[2]*t6 - second[2]*t7;
    const real t8 = qt2*sq;
    const real t9 = qt2*cq;
    const real t10 = qt1*qt1;
    d2[0] = h2[0] + first[0]*t8 + t0*t10 + t1*t10 - second[0]*t9;
    d2[1] = h2[1] + first[1]*t8 + t2*t10 + t3*t10 - second[1]*t9;
    d2[2] = h2[2] + first[2]*t8 + t4*t10 + t5*t10 - second[2]*t9;
}
#endif

/*
 * base_plane: how the row bends along a path
 *     d²Φ/dt²,  Φ = n·d
 * in  h[3]           p + R b - c [mm]
 * in  h1[3]          its velocity [/s]
 * in  h2[3]          its acceleration [/s²]
 * in  n[3]           base-side axis, base frame
 * in  a[3]           platform-side axis, base frame
 * in  a1[3]          its velocity [/s]
 * in  a2[3]          its acceleration [/s²]
 * in  lever          λ [mm]
 * out phi2           d²Φ/dt² [mm/s²]
 * operations: 2 +, 3 *, 0 /, 0 sqrt
 */
INLINE void FN(base_plane_bend)(const real h[3], const real h1[3], const real h2[3],
        const real n[3], const real a[3], const real a1[3], const real a2[3], real lever,
        real *phi2)
{
    *phi2 = h2[0]*n[0] + h2[1]*n[1] + h2[2]*n[2];
}

/*
 * platform_plane: how the row bends along a path
 *     d²Φ/dt²,  Φ = (R a)·d
 * in  h[3]           p + R b - c [mm]
 * in  h1[3]          its velocity [/s]
 * in  h2[3]          its acceleration [/s²]
 * in  n[3]           base-side axis, base frame
 * in  a[3]           platform-side axis, base frame
 * in  a1[3]          its velocity [/s]
 * in  a2[3]          its acceleration [/s²]
 * in  lever          λ [mm]
 * out phi2           d²Φ/dt² [mm/s²]
 * operations: 8 +, 12 *, 0 /, 0 sqrt
 */
INLINE void FN(platform_plane_bend)(const real h[3], const real h1[3], const real h2[3],
        const real n[3], const real a[3], const real a1[3], const real a2[3], real lever,
        real *phi2)
{
    *phi2 = h[0]*a2[0] + h[1]*a2[1] + h[2]*a2[2] + 2.0f*h1[0]*a1[0] + 2.0f*h1[1]*a1[1] +
        2.0f*h1[2]*a1[2] + h2[0]*a[0] + h2[1]*a[1] + h2[2]*a[2];
}

/*
 * couple: how the row bends along a path
 *     d²Φ/dt²,  Φ = λ (R a)·n
 * in  h[3]           p + R b - c [mm]
 * in  h1[3]          its velocity [/s]
 * in  h2[3]          its acceleration [/s²]
 * in  n[3]           base-side axis, base frame
 * in  a[3]           platform-side axis, base frame
 * in  a1[3]          its velocity [/s]
 * in  a2[3]          its acceleration [/s²]
 * in  lever          λ [mm]
 * out phi2           d²Φ/dt² [mm/s²]
 * operations: 2 +, 4 *, 0 /, 0 sqrt
 */
INLINE void FN(couple_bend)(const real h[3], const real h1[3], const real h2[3], const real n[3],
        const real a[3], const real a1[3], const real a2[3], real lever, real *phi2)
{
    *phi2 = (n[0]*a2[0] + n[1]*a2[1] + n[2]*a2[2])*lever;
}

/*
 * hinge_plane: how the row bends along a path
 *     d²Φ/dt²,  Φ = n·d
 * in  h[3]           p + R b - c [mm]
 * in  h1[3]          its velocity [/s]
 * in  h2[3]          its acceleration [/s²]
 * in  n[3]           base-side axis, base frame
 * in  a[3]           platform-side axis, base frame
 * in  a1[3]          its velocity [/s]
 * in  a2[3]          its acceleration [/s²]
 * in  lever          λ [mm]
 * out phi2           d²Φ/dt² [mm/s²]
 * operations: 2 +, 3 *, 0 /, 0 sqrt
 */
INLINE void FN(hinge_plane_bend)(const real h[3], const real h1[3], const real h2[3],
        const real n[3], const real a[3], const real a1[3], const real a2[3], real lever,
        real *phi2)
{
    *phi2 = h2[0]*n[0] + h2[1]*n[1] + h2[2]*n[2];
}

/*
 * spatial: rate of the twist on the path state ⊕ δ t
 *     (ω̇, v̇) at t = 0
 * in  state[7]       of the map
 * in  delta[6]       step a second [mm/s, rad/s]
 * out twist_rate[6]  (ω̇, v̇), base axes
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_spatial_bend)(const real state[7], const real delta[6], real twist_rate[6])
{
    twist_rate[0] = FN(fill)(0.0f);
    twist_rate[1] = FN(fill)(0.0f);
    twist_rate[2] = FN(fill)(0.0f);
    twist_rate[3] = FN(fill)(0.0f);
    twist_rate[4] = FN(fill)(0.0f);
    twist_rate[5] = FN(fill)(0.0f);
}

/*
 * translation: rate of the twist on the path state ⊕ δ t
 *     (ω̇, v̇) at t = 0
 * in  state[3]       of the map
 * in  delta[3]       step a second [mm/s, rad/s]
 * out twist_rate[6]  (ω̇, v̇), base axes
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_translation_bend)(const real state[3], const real delta[3], real twist_rate[6])
{
    twist_rate[0] = FN(fill)(0.0f);
    twist_rate[1] = FN(fill)(0.0f);
    twist_rate[2] = FN(fill)(0.0f);
    twist_rate[3] = FN(fill)(0.0f);
    twist_rate[4] = FN(fill)(0.0f);
    twist_rate[5] = FN(fill)(0.0f);
}

/*
 * planar: rate of the twist on the path state ⊕ δ t
 *     (ω̇, v̇) at t = 0
 * in  state[4]       of the map
 * in  delta[3]       step a second [mm/s, rad/s]
 * out twist_rate[6]  (ω̇, v̇), base axes
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_planar_bend)(const real state[4], const real delta[3], real twist_rate[6])
{
    twist_rate[0] = FN(fill)(0.0f);
    twist_rate[1] = FN(fill)(0.0f);
    twist_rate[2] = FN(fill)(0.0f);
    twist_rate[3] = FN(fill)(0.0f);
    twist_rate[4] = FN(fill)(0.0f);
    twist_rate[5] = FN(fill)(0.0f);
}

/*
 * 2tpr2tps: rate of the twist on the path state ⊕ δ t
 *     (ω̇, v̇) at t = 0
 * in  state[6]       of the map
 * in  delta[4]       step a second [mm/s, rad/s]
 * out twist_rate[6]  (ω̇, v̇), base axes
 * operations: 2 +, 11 *, 0 /, 0 sqrt
 */
INLINE void FN(map_2tpr2tps_bend)(const real state[6], const real delta[4], real twist_rate[6])
{
    const real t0 = delta[2]*delta[3];
    twist_rate[0] = -state[5]*t0;
    twist_rate[1] = FN(fill)(0.0f);
    twist_rate[2] = -state[4]*t0;
    const real t1 = 2.0f*delta[1];
    const real t2 = state[1]*delta[3];
    twist_rate[3] = (state[4]*t1 - state[5]*t2)*delta[3];
    twist_rate[4] = FN(fill)(0.0f);
    twist_rate[5] = -(state[4]*t2 + state[5]*t1)*delta[3];
}

/*
 * spherical: rate of the twist on the path state ⊕ δ t
 *     (ω̇, v̇) at t = 0
 * in  state[4]       of the map
 * in  delta[3]       step a second [mm/s, rad/s]
 * out twist_rate[6]  (ω̇, v̇), base axes
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_spherical_bend)(const real state[4], const real delta[3], real twist_rate[6])
{
    twist_rate[0] = FN(fill)(0.0f);
    twist_rate[1] = FN(fill)(0.0f);
    twist_rate[2] = FN(fill)(0.0f);
    twist_rate[3] = FN(fill)(0.0f);
    twist_rate[4] = FN(fill)(0.0f);
    twist_rate[5] = FN(fill)(0.0f);
}

/*
 * xy: rate of the twist on the path state ⊕ δ t
 *     (ω̇, v̇) at t = 0
 * in  state[2]       of the map
 * in  delta[2]       step a second [mm/s, rad/s]
 * out twist_rate[6]  (ω̇, v̇), base axes
 * operations: 0 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(map_xy_bend)(const real state[2], const real delta[2], real twist_rate[6])
{
    twist_rate[0] = FN(fill)(0.0f);
    twist_rate[1] = FN(fill)(0.0f);
    twist_rate[2] = FN(fill)(0.0f);
    twist_rate[3] = FN(fill)(0.0f);
    twist_rate[4] = FN(fill)(0.0f);
    twist_rate[5] = FN(fill)(0.0f);
}

/*
 * a frame's first three rows with their first and second derivative by time
 *     dR/dt = [ω] R,  d²R/dt² = ([ω̇] + [ω]²) R
 * in  R[9]           platform to base, row by row
 * in  p[3]           origin [mm]
 * in  twist[6]       (ω, v)
 * in  twist_rate[6]  (ω̇, v̇)
 * out T[12]          3 x 4, row by row
 * out T1[12]         3 x 4, row by row
 * out T2[12]         3 x 4, row by row
 * operations: 36 +, 54 *, 0 /, 0 sqrt
 */
INLINE void FN(frame_motion)(const real R[9], const real p[3], const real twist[6],
        const real twist_rate[6], real T[12], real T1[12], real T2[12])
{
    /* [ω] R */
    const real turn0 = R[6]*twist[1] - R[3]*twist[2];
    const real turn1 = R[7]*twist[1] - R[4]*twist[2];
    const real turn2 = R[8]*twist[1] - R[5]*twist[2];
    const real turn3 = R[0]*twist[2] - R[6]*twist[0];
    const real turn4 = R[1]*twist[2] - R[7]*twist[0];
    const real turn5 = R[2]*twist[2] - R[8]*twist[0];
    const real turn6 = R[3]*twist[0] - R[0]*twist[1];
    const real turn7 = R[4]*twist[0] - R[1]*twist[1];
    const real turn8 = R[5]*twist[0] - R[2]*twist[1];
    T[0] = R[0];
    T[1] = R[1];
    T[2] = R[2];
    T[3] = p[0];
    T[4] = R[3];
    T[5] = R[4];
    T[6] = R[5];
    T[7] = p[1];
    T[8] = R[6];
    T[9] = R[7];
    T[10] = R[8];
    T[11] = p[2];
    T1[0] = turn0;
    T1[1] = turn1;
    T1[2] = turn2;
    T1[3] = twist[3];
    T1[4] = turn3;
    T1[5] = turn4;
    T1[6] = turn5;
    T1[7] = twist[4];
    T1[8] = turn6;
    T1[9] = turn7;
    T1[10] = turn8;
    T1[11] = twist[5];
    T2[0] = R[6]*twist_rate[1] + twist[1]*turn6 - R[3]*twist_rate[2] - twist[2]*turn3;
    T2[1] = R[7]*twist_rate[1] + twist[1]*turn7 - R[4]*twist_rate[2] - twist[2]*turn4;
    T2[2] = R[8]*twist_rate[1] + twist[1]*turn8 - R[5]*twist_rate[2] - twist[2]*turn5;
    T2[3] = twist_rate[3];
    T2[4] = R[0]*twist_rate[2] + twist[2]*turn0 - R[6]*twist_rate[0] - twist[0]*turn6;
    T2[5] = R[1]*twist_rate[2] + twist[2]*turn1 - R[7]*twist_rate[0] - twist[0]*turn7;
    T2[6] = R[2]*twist_rate[2] + twist[2]*turn2 - R[8]*twist_rate[0] - twist[0]*turn8;
    T2[7] = twist_rate[4];
    T2[8] = R[3]*twist_rate[0] + twist[0]*turn3 - R[0]*twist_rate[1] - twist[1]*turn0;
    T2[9] = R[4]*twist_rate[0] + twist[0]*turn4 - R[1]*twist_rate[1] - twist[1]*turn1;
    T2[10] = R[5]*twist_rate[0] + twist[0]*turn5 - R[2]*twist_rate[1] - twist[1]*turn2;
    T2[11] = twist_rate[5];
}

#ifndef NARROW
/*
 * velocity and acceleration of x y z α β γ from those of the platform
 *     ω = E (α̇, β̇, γ̇), and differentiated once more
 * in  pose[6]        x y z [mm], α β γ [rad]
 * in  twist[6]       (ω, v)
 * in  twist_rate[6]  (ω̇, v̇)
 * out velocity[6]    of the pose
 * out acceleration[6] of the pose
 * operations: 15 +, 30 *, 1 /, 0 sqrt
 */
INLINE void FN(pose_rates)(const real pose[6], const real twist[6], const real twist_rate[6],
        real velocity[6], real acceleration[6])
{
    real sb, cb;
    FN(sincos)(pose[4], &sb, &cb);
    real sg, cg;
    FN(sincos)(pose[5], &sg, &cg);
    /* E⁻¹ */
    const real t0 = 1.0f/cb;
    const real t1 = cg*t0;
    const real inverse0 = t1;
    const real t2 = sg*t0;
    const real inverse1 = t2;
    const real inverse6 = sb*t1;
    const real inverse7 = sb*t2;
    /* (α̇, β̇, γ̇) */
    const real angles0 = twist[0]*inverse0 + twist[1]*inverse1;
    const real angles1 = twist[1]*cg - twist[0]*sg;
    const real angles2 = twist[0]*inverse6 + twist[1]*inverse7 + twist[2];
    /* ω̇ - Ė (α̇, β̇, γ̇) */
    const real t3 = cg*angles1;
    const real left0 = twist_rate[0] + angles2*t3 - (-sb*t3 - cb*sg*angles2)*angles0;
    const real t4 = sg*angles1;
    const real left1 = twist_rate[1] + angles2*t4 - (cb*cg*angles2 - sb*t4)*angles0;
    const real left2 = twist_rate[2] + cb*angles0*angles1;
    velocity[0] = twist[3];
    velocity[1] = twist[4];
    velocity[2] = twist[5];
    velocity[3] = angles0;
    velocity[4] = angles1;
    velocity[5] = angles2;
    acceleration[0] = twist_rate[3];
    acceleration[1] = twist_rate[4];
    acceleration[2] = twist_rate[5];
    acceleration[3] = inverse0*left0 + inverse1*left1;
    acceleration[4] = cg*left1 - sg*left0;
    acceleration[5] = inverse6*left0 + inverse7*left1 + left2;
}
#endif
