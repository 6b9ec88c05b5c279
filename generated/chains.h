/* Generated from derive/chains.py by `python -m derive`; never edited by hand.
 * derivation c0b1888918aa80c0
 * `real` is a number or a lane of numbers, FN(name) the function for that type. */

/*
 * what a limb's end misses the platform by
 *     r = (λ vee(C Rᵀ), c - p),  vee(D) = ½ (D32 - D23, D13 - D31, D21 - D12)
 * in  C[9]           platform's axes as the limb has them
 * in  c[3]           its origin [mm]
 * in  R[9]           platform to base, row by row
 * in  p[3]           its origin [mm]
 * in  length         λ [mm]
 * out r[6]           [mm]
 * operations: 18 +, 22 *, 0 /, 0 sqrt
 */
INLINE void FN(chain_closure)(const real C[9], const real c[3], const real R[9], const real p[3],
        real length, real r[6])
{
    const real half = 0.5f*length;
    r[0] = (C[6]*R[3] + C[7]*R[4] + C[8]*R[5] - C[3]*R[6] - C[4]*R[7] - C[5]*R[8])*half;
    r[1] = (C[0]*R[6] + C[1]*R[7] + C[2]*R[8] - C[6]*R[0] - C[7]*R[1] - C[8]*R[2])*half;
    r[2] = (C[3]*R[0] + C[4]*R[1] + C[5]*R[2] - C[0]*R[3] - C[1]*R[4] - C[2]*R[5])*half;
    r[3] = c[0] - p[0];
    r[4] = c[1] - p[1];
    r[5] = c[2] - p[2];
}

/*
 * what a limb that ends in a ball misses the platform's joint by, and that joint's lever
 *     r = c - p - R b;  ∂(p + R b) = v - (R b) × ω
 * in  R[9]           platform to base, row by row
 * in  p[3]           its origin [mm]
 * in  b[3]           joint on the platform [mm]
 * in  c[3]           end of the limb [mm]
 * out r[3]           [mm]
 * out lever[3]       R b [mm]
 * operations: 12 +, 9 *, 0 /, 0 sqrt
 */
INLINE void FN(chain_ball)(const real R[9], const real p[3], const real b[3], const real c[3],
        real r[3], real lever[3])
{
    /* R b */
    const real arm0 = R[0]*b[0] + R[1]*b[1] + R[2]*b[2];
    const real arm1 = R[3]*b[0] + R[4]*b[1] + R[5]*b[2];
    const real arm2 = R[6]*b[0] + R[7]*b[1] + R[8]*b[2];
    r[0] = c[0] - p[0] - arm0;
    r[1] = c[1] - p[1] - arm1;
    r[2] = c[2] - p[2] - arm2;
    lever[0] = arm0;
    lever[1] = arm1;
    lever[2] = arm2;
}

/*
 * hybrid twist of a turn about an axis through `at`, of the limb's end c
 *     v = ω × (c - at)
 * in  w[3]           ω, base axes
 * in  at[3]          on the axis [mm]
 * in  c[3]           end of the limb [mm]
 * out v[3]           velocity of the end
 * operations: 6 +, 6 *, 0 /, 0 sqrt
 */
INLINE void FN(chain_turn)(const real w[3], const real at[3], const real c[3], real v[3])
{
    const real t0 = c[2] - at[2];
    const real t1 = c[1] - at[1];
    v[0] = w[1]*t0 - w[2]*t1;
    const real t2 = c[0] - at[0];
    v[1] = w[2]*t2 - w[0]*t0;
    v[2] = w[0]*t1 - w[1]*t2;
}

/*
 * how a limb's vee follows turns of its end and of the platform, per arc
 *     ∂vee([ω] C Rᵀ), ∂vee(C Rᵀ [ω]ᵀ) by ω
 * in  C[9]           platform's axes as the limb has them
 * in  R[9]           platform to base, row by row
 * out by_end[9]      by the limb's end, row by row
 * out by_platform[9] by the platform
 * operations: 21 +, 36 *, 0 /, 0 sqrt
 */
INLINE void FN(chain_turned)(const real C[9], const real R[9], real by_end[9], real by_platform[9])
{
    const real D0 = C[0]*R[0] + C[1]*R[1] + C[2]*R[2];
    const real D1 = C[0]*R[3] + C[1]*R[4] + C[2]*R[5];
    const real D2 = C[0]*R[6] + C[1]*R[7] + C[2]*R[8];
    const real D3 = C[3]*R[0] + C[4]*R[1] + C[5]*R[2];
    const real D4 = C[3]*R[3] + C[4]*R[4] + C[5]*R[5];
    const real D5 = C[3]*R[6] + C[4]*R[7] + C[5]*R[8];
    const real D6 = C[6]*R[0] + C[7]*R[1] + C[8]*R[2];
    const real D7 = C[6]*R[3] + C[7]*R[4] + C[8]*R[5];
    const real D8 = C[6]*R[6] + C[7]*R[7] + C[8]*R[8];
    const real t0 = 0.5f*D4;
    const real t1 = 0.5f*D8;
    const real t2 = t0 + t1;
    by_end[0] = t2;
    const real t3 = 0.5f*D1;
    by_end[1] = -t3;
    const real t4 = 0.5f*D2;
    by_end[2] = -t4;
    const real t5 = 0.5f*D3;
    by_end[3] = -t5;
    const real t6 = 0.5f*D0;
    const real t7 = t1 + t6;
    by_end[4] = t7;
    const real t8 = 0.5f*D5;
    by_end[5] = -t8;
    const real t9 = 0.5f*D6;
    by_end[6] = -t9;
    const real t10 = 0.5f*D7;
    by_end[7] = -t10;
    const real t11 = t0 + t6;
    by_end[8] = t11;
    by_platform[0] = -t2;
    by_platform[1] = t5;
    by_platform[2] = t9;
    by_platform[3] = t3;
    by_platform[4] = -t7;
    by_platform[5] = t10;
    by_platform[6] = t4;
    by_platform[7] = t8;
    by_platform[8] = -t11;
}

/*
 * how x·u of a joint's column x follows what moves the joint and the end
 *     ∂(x·u) = ω·by_turn where joint and end turn with ω, v·by_shift where the end alone moves
 * in  x[6]           column: turning as arc, velocity of the end
 * in  u[6]           wrench
 * in  length         λ [mm]
 * out by_turn[3]     by ω
 * out by_shift[3]    by v
 * operations: 12 +, 23 *, 1 /, 0 sqrt
 */
INLINE void FN(chain_pairing)(const real x[6], const real u[6], real length, real by_turn[3],
        real by_shift[3])
{
    by_turn[0] = x[1]*u[2] + x[4]*u[5] - x[2]*u[1] - x[5]*u[4];
    by_turn[1] = x[2]*u[0] + x[5]*u[3] - x[0]*u[2] - x[3]*u[5];
    by_turn[2] = x[0]*u[1] + x[3]*u[4] - x[1]*u[0] - x[4]*u[3];
    const real t0 = 1.0f/length;
    const real t1 = x[2]*t0;
    by_shift[0] = u[4]*t1 - x[1]*u[5]*t0;
    by_shift[1] = x[0]*u[5]*t0 - u[3]*t1;
    by_shift[2] = x[1]*u[3]*t0 - x[0]*u[4]*t0;
}

/*
 * how what a joint yields to a wrench u follows its lever d to the end, both as arcs
 *     K u = (t, t × d + f), t = m + d × f, of u = (m, f): ∂(K u) as d changes by δ
 * in  d[3]           lever over λ
 * in  change[3]      δ
 * in  u[6]           wrench (m, f)
 * out bent[6]        ∂(K u)
 * operations: 18 +, 24 *, 0 /, 0 sqrt
 */
INLINE void FN(chain_bend)(const real d[3], const real change[3], const real u[6], real bent[6])
{
    const real t0 = change[1]*u[5] - change[2]*u[4];
    bent[0] = t0;
    const real t1 = change[2]*u[3] - change[0]*u[5];
    bent[1] = t1;
    const real t2 = change[0]*u[4] - change[1]*u[3];
    bent[2] = t2;
    const real t3 = d[0]*u[4] + u[2] - d[1]*u[3];
    const real t4 = d[2]*u[3] + u[1] - d[0]*u[5];
    bent[3] = d[2]*t1 + change[2]*t4 - d[1]*t2 - change[1]*t3;
    const real t5 = d[1]*u[5] + u[0] - d[2]*u[4];
    bent[4] = d[0]*t2 + change[0]*t3 - d[2]*t0 - change[2]*t5;
    bent[5] = d[1]*t0 + change[1]*t5 - d[0]*t1 - change[0]*t4;
}
