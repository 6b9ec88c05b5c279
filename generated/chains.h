/* Generated from derive/chains.py by `python -m derive`; never edited by hand.
 * derivation ab4a00b608b30e11
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
