/* Generated from derive/tpr2tps.py by `python -m derive`; never edited by hand.
 * derivation 4eb9f93e8b43916e
 * `real` is a number or a lane of numbers, FN(name) the function for that type. */

#ifndef NARROW
/*
 * 2TPR&2TPS: leg lengths
 *     L_i² = even + n_i odd, n = +1 -1 +1 -1, with x = z tan β, γ = 0 (A eq. 8, 9)
 * in  size[6]        a b c d e f [mm]
 * in  free[4]        y z [mm], α β [rad]
 * out L[4]           leg lengths [mm]
 * operations: 20 +, 33 *, 1 /, 4 sqrt
 */
INLINE void FN(tpr2tps_lengths)(const real size[6], const real free[4], real L[4])
{
    real sa, ca;
    FN(sincos)(free[2], &sa, &ca);
    real sb, cb;
    FN(sincos)(free[3], &sb, &cb);
    /* 1/cos β and tan β */
    const real k = 1.0f/cb;
    const real tb = sb*k;
    /* x of o1 as seen from T1 and T2 */
    const real ahead = free[1]*tb - size[3];
    /* terms of L_i² without n_i, front and back */
    const real t0 = 0.5f*ca;
    const real t1 = free[1]*free[1];
    const real t2 = free[0]*free[0] + t1;
    const real even0 = size[0]*size[0] + 0.25f*size[1]*size[1] + 0.25f*size[4]*size[4] +
        ahead*ahead + t2 - 2.0f*size[0]*size[3]*cb - size[1]*size[4]*t0;
    const real even1 = 0.25f*size[2]*size[2] + 0.25f*size[5]*size[5] + tb*tb*t1 + t2 -
        size[2]*size[5]*t0;
    /* terms of L_i² with n_i */
    const real t3 = free[0]*ca + free[1]*sa*k;
    const real odd0 = size[1]*(size[3]*sa*sb - t3) + size[4]*free[0];
    const real odd1 = size[2]*t3 - size[5]*free[0];
    L[0] = FN(root)(even0 + odd0);
    L[1] = FN(root)(even0 - odd0);
    L[2] = FN(root)(even1 + odd1);
    L[3] = FN(root)(even1 - odd1);
}
#endif

#ifndef NARROW
/*
 * 2TPR&2TPS: leg lengths by y z α β
 *     J_ij = ∂L_i/∂u_j = (∂even/∂u_j + n_i ∂odd/∂u_j)/(2 L_i) (A eq. 12)
 * in  size[6]        a b c d e f [mm]
 * in  free[4]        y z [mm], α β [rad]
 * out J[16]          ∂L/∂(y z α β), row by row
 * operations: 45 +, 79 *, 5 /, 4 sqrt
 */
INLINE void FN(tpr2tps_jacobian)(const real size[6], const real free[4], real J[16])
{
    real sa, ca;
    FN(sincos)(free[2], &sa, &ca);
    real sb, cb;
    FN(sincos)(free[3], &sb, &cb);
    /* 1/cos β and tan β */
    const real k = 1.0f/cb;
    const real tb = sb*k;
    /* x of o1 as seen from T1 and T2 */
    const real t0 = free[1]*tb;
    const real ahead = t0 - size[3];
    /* terms of L_i² without n_i, front and back */
    const real t1 = 2.0f*size[3];
    const real t2 = size[1]*ca;
    const real t3 = 0.5f*size[4];
    const real t4 = free[1]*free[1];
    const real t5 = free[0]*free[0] + t4;
    const real even0 = size[0]*size[0] + 0.25f*size[1]*size[1] + 0.25f*size[4]*size[4] +
        ahead*ahead + t5 - size[0]*cb*t1 - t2*t3;
    const real t6 = size[2]*ca;
    const real t7 = 0.5f*size[5];
    const real even1 = 0.25f*size[2]*size[2] + 0.25f*size[5]*size[5] + tb*tb*t4 + t5 - t6*t7;
    /* terms of L_i² with n_i */
    const real t8 = sa*k;
    const real t9 = free[0]*ca + free[1]*t8;
    const real odd0 = size[1]*(size[3]*sa*sb - t9) + size[4]*free[0];
    const real odd1 = size[2]*t9 - size[5]*free[0];
    /* 1/(2 L_i) */
    const real r0 = 0.5f/FN(root)(even0 + odd0);
    const real r1 = 0.5f/FN(root)(even0 - odd0);
    const real r2 = 0.5f/FN(root)(even1 + odd1);
    const real r3 = 0.5f/FN(root)(even1 - odd1);
    /* terms of ∂L_i² without n_i, front and back */
    const real t10 = 2.0f*free[0];
    const real D_even0 = t10;
    const real t11 = k*k;
    const real t12 = free[1]*t11;
    const real t13 = 2.0f*t12;
    const real D_even1 = t13 - tb*t1;
    const real D_even2 = size[1]*sa*t3;
    const real t14 = size[3]*sb;
    const real t15 = 2.0f*tb*t4*t11;
    const real D_even3 = 2.0f*size[0]*t14 + t15 - t1*t12;
    const real D_even4 = t10;
    const real D_even5 = t13;
    const real D_even6 = size[2]*sa*t7;
    const real D_even7 = t15;
    /* terms of ∂L_i² with n_i */
    const real D_odd0 = size[4] - t2;
    const real D_odd1 = -size[1]*t8;
    const real t16 = free[0]*sa;
    const real t17 = free[1]*ca*k;
    const real D_odd2 = size[1]*(ca*t14 + t16 - t17);
    const real D_odd3 = size[1]*(size[3]*sa*cb - t0*t8);
    const real D_odd4 = t6 - size[5];
    const real t18 = size[2]*t8;
    const real D_odd5 = t18;
    const real D_odd6 = size[2]*(t17 - t16);
    const real D_odd7 = t0*t18;
    J[0] = r0*(D_even0 + D_odd0);
    J[1] = r0*(D_even1 + D_odd1);
    J[2] = r0*(D_even2 + D_odd2);
    J[3] = r0*(D_even3 + D_odd3);
    J[4] = r1*(D_even0 - D_odd0);
    J[5] = r1*(D_even1 - D_odd1);
    J[6] = r1*(D_even2 - D_odd2);
    J[7] = r1*(D_even3 - D_odd3);
    J[8] = r2*(D_even4 + D_odd4);
    J[9] = r2*(D_even5 + D_odd5);
    J[10] = r2*(D_even6 + D_odd6);
    J[11] = r2*(D_even7 + D_odd7);
    J[12] = r3*(D_even4 - D_odd4);
    J[13] = r3*(D_even5 - D_odd5);
    J[14] = r3*(D_even6 - D_odd6);
    J[15] = r3*(D_even7 - D_odd7);
}
#endif
