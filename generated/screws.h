/* Generated from derive/screws.py by `python -m derive`; never edited by hand.
 * derivation c5dc5c965dcef0cb
 * `real` is a number or a lane of numbers, FN(name) the function for that type. */

#define SERIES_END 10.0
#define SERIES_COUNT 14
/* c4(x), lowest power first */
static const double C4_SERIES[SERIES_COUNT] = {
    0x1.5555555555555p-5,
    -0x1.6c16c16c16c17p-10,
    0x1.a01a01a01a01ap-16,
    -0x1.27e4fb7789f5cp-22,
    0x1.1eed8eff8d898p-29,
    -0x1.93974a8c07c9dp-37,
    0x1.ae7f3e733b81fp-45,
    -0x1.6827863b97d97p-53,
    0x1.e542ba4020225p-62,
    -0x1.0ce396db7f853p-70,
    0x1.f2cf01972f578p-80,
    -0x1.88e85fc6a4e5ap-89,
    0x1.0a18a2635085dp-98,
    -0x1.3932c5047d60ep-108};
/* c5(x), lowest power first */
static const double C5_SERIES[SERIES_COUNT] = {
    0x1.1111111111111p-7,
    -0x1.a01a01a01a01ap-13,
    0x1.71de3a556c734p-19,
    -0x1.ae64567f544e4p-26,
    0x1.6124613a86d09p-33,
    -0x1.ae7f3e733b81fp-41,
    0x1.952c77030ad4ap-49,
    -0x1.2f49b46814157p-57,
    0x1.71b8ef6dcf572p-66,
    -0x1.761b41316381ap-75,
    0x1.3f3ccdd165fa9p-84,
    -0x1.d1ab1c2dccea3p-94,
    0x1.259f98b4358adp-103,
    -0x1.434d2e783f5bcp-113};
#define SIXTH 0x1.5555555555555p-3

/*
 * c0 to c5 from c4 and c5
 *     c_k = 1/k! - x c_{k+2}
 * in  x              ω·ω
 * in  c4             by its series
 * in  c5             by its series
 * out c[6]           c0 ... c5
 * operations: 4 +, 4 *, 0 /, 0 sqrt
 */
INLINE void FN(angle_near)(real x, real c4, real c5, real c[6])
{
    const real c3 = SIXTH - x*c5;
    const real c2 = 0.5f - x*c4;
    c[0] = 1.0f - x*c2;
    c[1] = 1.0f - x*c3;
    c[2] = c2;
    c[3] = c3;
    c[4] = c4;
    c[5] = c5;
}

#ifndef NARROW
/*
 * c0 to c5 away from zero
 *     c_{k+2} = (1/k! - c_k)/x
 * in  theta          √(ω·ω) [rad]
 * out c[6]           c0 ... c5
 * operations: 4 +, 5 *, 2 /, 0 sqrt
 */
INLINE void FN(angle_far)(real theta, real c[6])
{
    real st, ct;
    FN(sincos)(theta, &st, &ct);
    const real x = theta*theta;
    const real c1 = st/theta;
    const real t0 = 1.0f/x;
    const real c2 = (1.0f - ct)*t0;
    const real c3 = (1.0f - c1)*t0;
    c[0] = ct;
    c[1] = c1;
    c[2] = c2;
    c[3] = c3;
    c[4] = (0.5f - c2)*t0;
    c[5] = (SIXTH - c3)*t0;
}
#endif

/*
 * motion by a twist of any norm
 *     R = E + c1 [ω] + c2 [ω]²,  p = (E + c2 [ω] + c3 [ω]²) v   (B eq. 2, 3)
 * in  w[3]           ω [rad]
 * in  v[3]           v [mm]
 * in  c[6]           c0 ... c5 at ω·ω
 * out R[9]           rotation, row by row
 * out p[3]           displacement [mm]
 * operations: 24 +, 38 *, 0 /, 0 sqrt
 */
INLINE void FN(screw_exp)(const real w[3], const real v[3], const real c[6], real R[9], real p[3])
{
    /* ω × v */
    const real m0 = w[1]*v[2] - w[2]*v[1];
    const real m1 = w[2]*v[0] - w[0]*v[2];
    const real m2 = w[0]*v[1] - w[1]*v[0];
    const real t0 = w[1]*w[1];
    const real t1 = w[2]*w[2];
    R[0] = 1.0f + c[2]*(-t0 - t1);
    const real t2 = w[2]*c[1];
    R[1] = w[0]*w[1]*c[2] - t2;
    const real t3 = w[1]*c[1];
    const real t4 = w[0]*c[2];
    R[2] = w[2]*t4 + t3;
    R[3] = w[1]*t4 + t2;
    const real t5 = w[0]*w[0];
    R[4] = 1.0f + c[2]*(-t1 - t5);
    const real t6 = w[0]*c[1];
    R[5] = w[1]*w[2]*c[2] - t6;
    R[6] = w[0]*w[2]*c[2] - t3;
    R[7] = w[1]*w[2]*c[2] + t6;
    R[8] = 1.0f + c[2]*(-t0 - t5);
    p[0] = (w[1]*m2 - w[2]*m1)*c[3] + v[0] + c[2]*m0;
    p[1] = (w[2]*m0 - w[0]*m2)*c[3] + v[1] + c[2]*m1;
    p[2] = (w[0]*m1 - w[1]*m0)*c[3] + v[2] + c[2]*m2;
}

/*
 * the unit quaternion q of a rotation, scalar first, four times over
 *     rows of 4 q qᵀ: each is q times 4 q_i, good where q_i is the largest entry
 * in  R[9]           rotation, row by row
 * out K[16]          4 x 4, row by row
 * operations: 16 +, 0 *, 0 /, 0 sqrt
 */
INLINE void FN(rotation_quaternions)(const real R[9], real K[16])
{
    const real t0 = 1.0f + R[0];
    K[0] = R[4] + R[8] + t0;
    const real t1 = R[7] - R[5];
    K[1] = t1;
    const real t2 = R[2] - R[6];
    K[2] = t2;
    const real t3 = R[3] - R[1];
    K[3] = t3;
    K[4] = t1;
    const real t4 = -R[4];
    const real t5 = -R[8];
    K[5] = t0 + t4 + t5;
    const real t6 = R[1] + R[3];
    K[6] = t6;
    const real t7 = R[2] + R[6];
    K[7] = t7;
    K[8] = t2;
    K[9] = t6;
    const real t8 = R[0] - 1.0f;
    K[10] = -R[8] - t4 - t8;
    const real t9 = R[5] + R[7];
    K[11] = t9;
    K[12] = t3;
    K[13] = t7;
    K[14] = t9;
    K[15] = -R[4] - t5 - t8;
}

/*
 * the twist's v from its ω and the displacement
 *     v = (E - [ω]/2 + k [ω]²) p,  k = (1 - c1/(2 c2))/x   (B eq. 13: v = G⁻¹ p)
 * in  w[3]           ω [rad]
 * in  p[3]           displacement [mm]
 * in  c[6]           c0 ... c5 at ω·ω
 * out v[3]           v [mm]
 * operations: 13 +, 20 *, 1 /, 0 sqrt
 */
INLINE void FN(screw_log)(const real w[3], const real p[3], const real c[6], real v[3])
{
    /* (1 - c1/(2 c2))/x */
    const real k = 0.5f*(c[3] - 2.0f*c[4])/c[2];
    /* ω × p */
    const real m0 = w[1]*p[2] - w[2]*p[1];
    const real m1 = w[2]*p[0] - w[0]*p[2];
    const real m2 = w[0]*p[1] - w[1]*p[0];
    v[0] = (w[1]*m2 - w[2]*m1)*k + p[0] - 0.5f*m0;
    v[1] = (w[2]*m0 - w[0]*m2)*k + p[1] - 0.5f*m1;
    v[2] = (w[0]*m1 - w[1]*m0)*k + p[2] - 0.5f*m2;
}

/*
 * how a motion follows its twist
 *     dT T⁻¹ = [(J 0; Q J) dξ],  J = E + c2 [ω] + c3 [ω]²,  Q = dJ along v
 * in  w[3]           ω [rad]
 * in  v[3]           v [mm]
 * in  c[6]           c0 ... c5 at ω·ω
 * out D[36]          6 x 6, row by row
 * operations: 40 +, 64 *, 0 /, 0 sqrt
 */
INLINE void FN(screw_exp_jacobian)(const real w[3], const real v[3], const real c[6], real D[36])
{
    /* half the change of x */
    const real t0 = w[0]*v[0];
    const real t1 = w[1]*v[1];
    const real t2 = w[2]*v[2];
    const real along = t0 + t1 + t2;
    /* the change of c2 */
    const real d2 = (2.0f*c[4] - c[3])*along;
    /* the change of c3 */
    const real d3 = (3.0f*c[5] - c[4])*along;
    const real t3 = w[1]*w[1];
    const real t4 = w[2]*w[2];
    const real t5 = -t3 - t4;
    const real J0 = 1.0f + c[3]*t5;
    const real t6 = w[2]*c[2];
    const real J1 = w[0]*w[1]*c[3] - t6;
    const real t7 = w[1]*c[2];
    const real t8 = w[0]*c[3];
    const real J2 = w[2]*t8 + t7;
    const real J3 = w[1]*t8 + t6;
    const real t9 = w[0]*w[0];
    const real t10 = -t4 - t9;
    const real J4 = 1.0f + c[3]*t10;
    const real t11 = w[0]*c[2];
    const real J5 = w[1]*w[2]*c[3] - t11;
    const real J6 = w[0]*w[2]*c[3] - t7;
    const real t12 = w[1]*w[2];
    const real J7 = c[3]*t12 + t11;
    const real t13 = -t3 - t9;
    const real J8 = 1.0f + c[3]*t13;
    const real t14 = 2.0f*t1;
    const real t15 = 2.0f*t2;
    const real Q0 = c[3]*(-t14 - t15) + d3*t5;
    const real t16 = w[0]*v[1] + w[1]*v[0];
    const real t17 = w[2]*d2 + v[2]*c[2];
    const real Q1 = w[0]*w[1]*d3 + c[3]*t16 - t17;
    const real t18 = w[0]*v[2] + w[2]*v[0];
    const real t19 = w[0]*d3;
    const real t20 = w[1]*d2 + v[1]*c[2];
    const real Q2 = w[2]*t19 + c[3]*t18 + t20;
    const real Q3 = w[1]*t19 + c[3]*t16 + t17;
    const real t21 = 2.0f*t0;
    const real Q4 = c[3]*(-t15 - t21) + d3*t10;
    const real t22 = w[1]*v[2] + w[2]*v[1];
    const real t23 = w[0]*d2 + v[0]*c[2];
    const real Q5 = w[1]*w[2]*d3 + c[3]*t22 - t23;
    const real Q6 = w[0]*w[2]*d3 + c[3]*t18 - t20;
    const real Q7 = c[3]*t22 + d3*t12 + t23;
    const real Q8 = c[3]*(-t14 - t21) + d3*t13;
    D[0] = J0;
    D[1] = J1;
    D[2] = J2;
    D[3] = FN(fill)(0.0f);
    D[4] = FN(fill)(0.0f);
    D[5] = FN(fill)(0.0f);
    D[6] = J3;
    D[7] = J4;
    D[8] = J5;
    D[9] = FN(fill)(0.0f);
    D[10] = FN(fill)(0.0f);
    D[11] = FN(fill)(0.0f);
    D[12] = J6;
    D[13] = J7;
    D[14] = J8;
    D[15] = FN(fill)(0.0f);
    D[16] = FN(fill)(0.0f);
    D[17] = FN(fill)(0.0f);
    D[18] = Q0;
    D[19] = Q1;
    D[20] = Q2;
    D[21] = J0;
    D[22] = J1;
    D[23] = J2;
    D[24] = Q3;
    D[25] = Q4;
    D[26] = Q5;
    D[27] = J3;
    D[28] = J4;
    D[29] = J5;
    D[30] = Q6;
    D[31] = Q7;
    D[32] = Q8;
    D[33] = J6;
    D[34] = J7;
    D[35] = J8;
}

/*
 * how a twist follows its motion
 *     dξ = (J⁻¹ 0; -J⁻¹ Q J⁻¹ J⁻¹) (dT T⁻¹),  J⁻¹ = E - [ω]/2 + k [ω]²
 * in  w[3]           ω [rad]
 * in  v[3]           v [mm]
 * in  c[6]           c0 ... c5 at ω·ω
 * out D[36]          6 x 6, row by row
 * operations: 76 +, 113 *, 1 /, 0 sqrt
 */
INLINE void FN(screw_log_jacobian)(const real w[3], const real v[3], const real c[6], real D[36])
{
    /* half the change of x */
    const real t0 = w[0]*v[0];
    const real t1 = w[1]*v[1];
    const real t2 = w[2]*v[2];
    const real along = t0 + t1 + t2;
    /* the change of c2 */
    const real t3 = c[3] - 2.0f*c[4];
    const real d2 = -along*t3;
    /* the change of c3 */
    const real d3 = (3.0f*c[5] - c[4])*along;
    const real t4 = 2.0f*t1;
    const real t5 = 2.0f*t2;
    const real t6 = w[1]*w[1];
    const real t7 = w[2]*w[2];
    const real t8 = -t6 - t7;
    const real Q0 = c[3]*(-t4 - t5) + d3*t8;
    const real t9 = w[0]*v[1] + w[1]*v[0];
    const real t10 = w[2]*d2 + v[2]*c[2];
    const real Q1 = w[0]*w[1]*d3 + c[3]*t9 - t10;
    const real t11 = w[0]*v[2] + w[2]*v[0];
    const real t12 = w[0]*d3;
    const real t13 = w[1]*d2 + v[1]*c[2];
    const real Q2 = w[2]*t12 + c[3]*t11 + t13;
    const real Q3 = w[1]*t12 + c[3]*t9 + t10;
    const real t14 = 2.0f*t0;
    const real t15 = w[0]*w[0];
    const real t16 = -t7 - t15;
    const real Q4 = c[3]*(-t5 - t14) + d3*t16;
    const real t17 = w[1]*v[2] + w[2]*v[1];
    const real t18 = w[0]*d2 + v[0]*c[2];
    const real Q5 = w[1]*w[2]*d3 + c[3]*t17 - t18;
    const real Q6 = w[0]*w[2]*d3 + c[3]*t11 - t13;
    const real t19 = w[1]*w[2];
    const real Q7 = c[3]*t17 + d3*t19 + t18;
    const real t20 = -t6 - t15;
    const real Q8 = c[3]*(-t4 - t14) + d3*t20;
    /* (1 - c1/(2 c2))/x */
    const real k = 0.5f*t3/c[2];
    /* J⁻¹ */
    const real I0 = 1.0f + k*t8;
    const real t21 = 0.5f*w[2];
    const real t22 = w[0]*k;
    const real t23 = w[1]*t22;
    const real I1 = t21 + t23;
    const real t24 = 0.5f*w[1];
    const real t25 = w[2]*t22;
    const real I2 = t25 - t24;
    const real I3 = t23 - t21;
    const real I4 = 1.0f + k*t16;
    const real t26 = 0.5f*w[0];
    const real t27 = k*t19;
    const real I5 = t26 + t27;
    const real I6 = t24 + t25;
    const real I7 = t27 - t26;
    const real I8 = 1.0f + k*t20;
    const real IQ0 = Q0*I0 + Q3*I1 + Q6*I2;
    const real IQ1 = Q1*I0 + Q4*I1 + Q7*I2;
    const real IQ2 = Q2*I0 + Q5*I1 + Q8*I2;
    const real IQ3 = Q0*I3 + Q3*I4 + Q6*I5;
    const real IQ4 = Q1*I3 + Q4*I4 + Q7*I5;
    const real IQ5 = Q2*I3 + Q5*I4 + Q8*I5;
    const real IQ6 = Q0*I6 + Q3*I7 + Q6*I8;
    const real IQ7 = Q1*I6 + Q4*I7 + Q7*I8;
    const real IQ8 = Q2*I6 + Q5*I7 + Q8*I8;
    D[0] = I0;
    D[1] = I1;
    D[2] = I2;
    D[3] = FN(fill)(0.0f);
    D[4] = FN(fill)(0.0f);
    D[5] = FN(fill)(0.0f);
    D[6] = I3;
    D[7] = I4;
    D[8] = I5;
    D[9] = FN(fill)(0.0f);
    D[10] = FN(fill)(0.0f);
    D[11] = FN(fill)(0.0f);
    D[12] = I6;
    D[13] = I7;
    D[14] = I8;
    D[15] = FN(fill)(0.0f);
    D[16] = FN(fill)(0.0f);
    D[17] = FN(fill)(0.0f);
    D[18] = -I0*IQ0 - I3*IQ1 - I6*IQ2;
    D[19] = -I1*IQ0 - I4*IQ1 - I7*IQ2;
    D[20] = -I2*IQ0 - I5*IQ1 - I8*IQ2;
    D[21] = I0;
    D[22] = I1;
    D[23] = I2;
    D[24] = -I0*IQ3 - I3*IQ4 - I6*IQ5;
    D[25] = -I1*IQ3 - I4*IQ4 - I7*IQ5;
    D[26] = -I2*IQ3 - I5*IQ4 - I8*IQ5;
    D[27] = I3;
    D[28] = I4;
    D[29] = I5;
    D[30] = -I0*IQ6 - I3*IQ7 - I6*IQ8;
    D[31] = -I1*IQ6 - I4*IQ7 - I7*IQ8;
    D[32] = -I2*IQ6 - I5*IQ7 - I8*IQ8;
    D[33] = I6;
    D[34] = I7;
    D[35] = I8;
}

/*
 * twists seen from another frame
 *     Ad = (R 0; [p] R R)   (B eq. 18)
 * in  R[9]           rotation, row by row
 * in  p[3]           displacement [mm]
 * out A[36]          6 x 6, row by row
 * operations: 9 +, 18 *, 0 /, 0 sqrt
 */
INLINE void FN(motion_adjoint)(const real R[9], const real p[3], real A[36])
{
    A[0] = R[0];
    A[1] = R[1];
    A[2] = R[2];
    A[3] = FN(fill)(0.0f);
    A[4] = FN(fill)(0.0f);
    A[5] = FN(fill)(0.0f);
    A[6] = R[3];
    A[7] = R[4];
    A[8] = R[5];
    A[9] = FN(fill)(0.0f);
    A[10] = FN(fill)(0.0f);
    A[11] = FN(fill)(0.0f);
    A[12] = R[6];
    A[13] = R[7];
    A[14] = R[8];
    A[15] = FN(fill)(0.0f);
    A[16] = FN(fill)(0.0f);
    A[17] = FN(fill)(0.0f);
    A[18] = R[6]*p[1] - R[3]*p[2];
    A[19] = R[7]*p[1] - R[4]*p[2];
    A[20] = R[8]*p[1] - R[5]*p[2];
    A[21] = R[0];
    A[22] = R[1];
    A[23] = R[2];
    A[24] = R[0]*p[2] - R[6]*p[0];
    A[25] = R[1]*p[2] - R[7]*p[0];
    A[26] = R[2]*p[2] - R[8]*p[0];
    A[27] = R[3];
    A[28] = R[4];
    A[29] = R[5];
    A[30] = R[3]*p[0] - R[0]*p[1];
    A[31] = R[4]*p[0] - R[1]*p[1];
    A[32] = R[5]*p[0] - R[2]*p[1];
    A[33] = R[6];
    A[34] = R[7];
    A[35] = R[8];
}

/*
 * a twist moved along
 *     ω' = R ω,  v' = R v + p × ω'   (B eq. 18)
 * in  R[9]           rotation, row by row
 * in  p[3]           displacement [mm]
 * in  w[3]           ω [rad]
 * in  v[3]           v [mm]
 * out moved_w[3]     ω'
 * out moved_v[3]     v'
 * operations: 18 +, 24 *, 0 /, 0 sqrt
 */
INLINE void FN(screw_moved)(const real R[9], const real p[3], const real w[3], const real v[3],
        real moved_w[3], real moved_v[3])
{
    /* ω' */
    const real t_w0 = R[0]*w[0] + R[1]*w[1] + R[2]*w[2];
    const real t_w1 = R[3]*w[0] + R[4]*w[1] + R[5]*w[2];
    const real t_w2 = R[6]*w[0] + R[7]*w[1] + R[8]*w[2];
    moved_w[0] = t_w0;
    moved_w[1] = t_w1;
    moved_w[2] = t_w2;
    moved_v[0] = R[0]*v[0] + R[1]*v[1] + R[2]*v[2] + p[1]*t_w2 - p[2]*t_w1;
    moved_v[1] = R[3]*v[0] + R[4]*v[1] + R[5]*v[2] + p[2]*t_w0 - p[0]*t_w2;
    moved_v[2] = R[6]*v[0] + R[7]*v[1] + R[8]*v[2] + p[0]*t_w1 - p[1]*t_w0;
}

/*
 * one motion after another
 *     R = Ra Rb,  p = pa + Ra pb
 * in  Ra[9]          rotation, row by row
 * in  pa[3]          displacement [mm]
 * in  Rb[9]          rotation, row by row
 * in  pb[3]          displacement [mm]
 * out R[9]           rotation, row by row
 * out p[3]           displacement [mm]
 * operations: 27 +, 36 *, 0 /, 0 sqrt
 */
INLINE void FN(motion_compose)(const real Ra[9], const real pa[3], const real Rb[9],
        const real pb[3], real R[9], real p[3])
{
    R[0] = Ra[0]*Rb[0] + Ra[1]*Rb[3] + Ra[2]*Rb[6];
    R[1] = Ra[0]*Rb[1] + Ra[1]*Rb[4] + Ra[2]*Rb[7];
    R[2] = Ra[0]*Rb[2] + Ra[1]*Rb[5] + Ra[2]*Rb[8];
    R[3] = Ra[3]*Rb[0] + Ra[4]*Rb[3] + Ra[5]*Rb[6];
    R[4] = Ra[3]*Rb[1] + Ra[4]*Rb[4] + Ra[5]*Rb[7];
    R[5] = Ra[3]*Rb[2] + Ra[4]*Rb[5] + Ra[5]*Rb[8];
    R[6] = Ra[6]*Rb[0] + Ra[7]*Rb[3] + Ra[8]*Rb[6];
    R[7] = Ra[6]*Rb[1] + Ra[7]*Rb[4] + Ra[8]*Rb[7];
    R[8] = Ra[6]*Rb[2] + Ra[7]*Rb[5] + Ra[8]*Rb[8];
    p[0] = Ra[0]*pb[0] + Ra[1]*pb[1] + Ra[2]*pb[2] + pa[0];
    p[1] = Ra[3]*pb[0] + Ra[4]*pb[1] + Ra[5]*pb[2] + pa[1];
    p[2] = Ra[6]*pb[0] + Ra[7]*pb[1] + Ra[8]*pb[2] + pa[2];
}

/*
 * a motion undone
 *     Rᵀ, -Rᵀ p
 * in  R[9]           rotation, row by row
 * in  p[3]           displacement [mm]
 * out I[9]           rotation, row by row
 * out d[3]           displacement [mm]
 * operations: 6 +, 9 *, 0 /, 0 sqrt
 */
INLINE void FN(motion_invert)(const real R[9], const real p[3], real I[9], real d[3])
{
    I[0] = R[0];
    I[1] = R[3];
    I[2] = R[6];
    I[3] = R[1];
    I[4] = R[4];
    I[5] = R[7];
    I[6] = R[2];
    I[7] = R[5];
    I[8] = R[8];
    d[0] = -R[0]*p[0] - R[3]*p[1] - R[6]*p[2];
    d[1] = -R[1]*p[0] - R[4]*p[1] - R[7]*p[2];
    d[2] = -R[2]*p[0] - R[5]*p[1] - R[8]*p[2];
}

#ifndef NARROW
/*
 * the error of a joint at its point r, in axes parallel to the base's at home
 *     E = Trans(Δx, Δy, Δz) Rz(Δψ) Ry(Δθ) Rx(Δφ);  R = R_E,  p = Δ + (E - R) r   (B eq. 10, 19)
 * in  e[6]           Δx Δy Δz [mm], Δφ Δθ Δψ [rad]
 * in  r[3]           the joint's point [mm]
 * out R[9]           rotation, row by row
 * out p[3]           displacement [mm]
 * operations: 16 +, 22 *, 0 /, 0 sqrt
 */
INLINE void FN(joint_error)(const real e[6], const real r[3], real R[9], real p[3])
{
    real sa, ca;
    FN(sincos)(e[3], &sa, &ca);
    real sb, cb;
    FN(sincos)(e[4], &sb, &cb);
    real sg, cg;
    FN(sincos)(e[5], &sg, &cg);
    const real R_e0 = cb*cg;
    const real t0 = ca*sg;
    const real R_e1 = sa*sb*cg - t0;
    const real t1 = sa*sg;
    const real t2 = ca*cg;
    const real R_e2 = sb*t2 + t1;
    const real R_e3 = cb*sg;
    const real R_e4 = sb*t1 + t2;
    const real R_e5 = sb*t0 - sa*cg;
    const real R_e7 = sa*cb;
    const real R_e8 = ca*cb;
    R[0] = R_e0;
    R[1] = R_e1;
    R[2] = R_e2;
    R[3] = R_e3;
    R[4] = R_e4;
    R[5] = R_e5;
    R[6] = -sb;
    R[7] = R_e7;
    R[8] = R_e8;
    p[0] = e[0] + r[0]*(1.0f - R_e0) - r[1]*R_e1 - r[2]*R_e2;
    p[1] = e[1] + r[1]*(1.0f - R_e4) - r[0]*R_e3 - r[2]*R_e5;
    p[2] = e[2] + r[0]*sb + r[2]*(1.0f - R_e8) - r[1]*R_e7;
}
#endif

#ifndef NARROW
/*
 * x y z α β γ of a motion
 *     R = Rz(γ) Ry(β) Rx(α)
 * in  R[9]           rotation, row by row
 * in  p[3]           displacement [mm]
 * out pose[6]        x y z [mm], α β γ [rad]
 * operations: 3 +, 6 *, 0 /, 1 sqrt
 */
INLINE void FN(motion_pose)(const real R[9], const real p[3], real pose[6])
{
    const real gamma = arctangent2(R[3], R[0]);
    /* α from Rz(γ)ᵀ R, which holds whatever γ is near β = ±90° */
    real sg, cg;
    FN(sincos)(gamma, &sg, &cg);
    const real alpha = arctangent2(R[2]*sg - R[5]*cg, R[4]*cg - R[1]*sg);
    const real beta = arctangent2(-R[6], FN(root)(R[0]*R[0] + R[3]*R[3]));
    pose[0] = p[0];
    pose[1] = p[1];
    pose[2] = p[2];
    pose[3] = alpha;
    pose[4] = beta;
    pose[5] = gamma;
}
#endif

#ifndef NARROW
/*
 * from the frame (Qa, ra) of one joint to that (Q, r) of the next, which has an error
 *     C = Fa⁻¹ E F:  R = Qaᵀ R_E Q,  p = Qaᵀ (r + Δ - ra)   (B eq. 19)
 * in  e[6]           Δx Δy Δz [mm], Δφ Δθ Δψ [rad] of the next joint
 * in  Qa[9]          axes of the joint before, row by row
 * in  ra[3]          its point
 * in  Q[9]           axes of the next joint, row by row
 * in  r[3]           its point [mm]
 * out R[9]           rotation, row by row
 * out p[3]           displacement [mm]
 * operations: 52 +, 76 *, 0 /, 0 sqrt
 */
INLINE void FN(arm_link)(const real e[6], const real Qa[9], const real ra[3], const real Q[9],
        const real r[3], real R[9], real p[3])
{
    real sa, ca;
    FN(sincos)(e[3], &sa, &ca);
    real sb, cb;
    FN(sincos)(e[4], &sb, &cb);
    real sg, cg;
    FN(sincos)(e[5], &sg, &cg);
    const real R_e0 = cb*cg;
    const real t0 = ca*sg;
    const real R_e1 = sa*sb*cg - t0;
    const real t1 = sa*sg;
    const real t2 = ca*cg;
    const real R_e2 = sb*t2 + t1;
    const real R_e3 = cb*sg;
    const real R_e4 = sb*t1 + t2;
    const real R_e5 = sb*t0 - sa*cg;
    const real R_e7 = sa*cb;
    const real R_e8 = ca*cb;
    const real RQ0 = Q[0]*R_e0 + Q[3]*R_e1 + Q[6]*R_e2;
    const real RQ1 = Q[1]*R_e0 + Q[4]*R_e1 + Q[7]*R_e2;
    const real RQ2 = Q[2]*R_e0 + Q[5]*R_e1 + Q[8]*R_e2;
    const real RQ3 = Q[0]*R_e3 + Q[3]*R_e4 + Q[6]*R_e5;
    const real RQ4 = Q[1]*R_e3 + Q[4]*R_e4 + Q[7]*R_e5;
    const real RQ5 = Q[2]*R_e3 + Q[5]*R_e4 + Q[8]*R_e5;
    const real RQ6 = Q[3]*R_e7 + Q[6]*R_e8 - Q[0]*sb;
    const real RQ7 = Q[4]*R_e7 + Q[7]*R_e8 - Q[1]*sb;
    const real RQ8 = Q[5]*R_e7 + Q[8]*R_e8 - Q[2]*sb;
    const real d0 = e[0] + r[0] - ra[0];
    const real d1 = e[1] + r[1] - ra[1];
    const real d2 = e[2] + r[2] - ra[2];
    R[0] = Qa[0]*RQ0 + Qa[3]*RQ3 + Qa[6]*RQ6;
    R[1] = Qa[0]*RQ1 + Qa[3]*RQ4 + Qa[6]*RQ7;
    R[2] = Qa[0]*RQ2 + Qa[3]*RQ5 + Qa[6]*RQ8;
    R[3] = Qa[1]*RQ0 + Qa[4]*RQ3 + Qa[7]*RQ6;
    R[4] = Qa[1]*RQ1 + Qa[4]*RQ4 + Qa[7]*RQ7;
    R[5] = Qa[1]*RQ2 + Qa[4]*RQ5 + Qa[7]*RQ8;
    R[6] = Qa[2]*RQ0 + Qa[5]*RQ3 + Qa[8]*RQ6;
    R[7] = Qa[2]*RQ1 + Qa[5]*RQ4 + Qa[8]*RQ7;
    R[8] = Qa[2]*RQ2 + Qa[5]*RQ5 + Qa[8]*RQ8;
    p[0] = Qa[0]*d0 + Qa[3]*d1 + Qa[6]*d2;
    p[1] = Qa[1]*d0 + Qa[4]*d1 + Qa[7]*d2;
    p[2] = Qa[2]*d0 + Qa[5]*d1 + Qa[8]*d2;
}
#endif

/*
 * a frame turned about its z axis
 *     R' = R Rz(θ)   (B eq. 2)
 * in  R[9]           rotation, row by row
 * in  s              sin θ
 * in  c              cos θ
 * out turned[9]      rotation, row by row
 * operations: 6 +, 12 *, 0 /, 0 sqrt
 */
INLINE void FN(arm_turned)(const real R[9], real s, real c, real turned[9])
{
    turned[0] = R[0]*c + R[1]*s;
    turned[1] = R[1]*c - R[0]*s;
    turned[2] = R[2];
    turned[3] = R[3]*c + R[4]*s;
    turned[4] = R[4]*c - R[3]*s;
    turned[5] = R[5];
    turned[6] = R[6]*c + R[7]*s;
    turned[7] = R[7]*c - R[6]*s;
    turned[8] = R[8];
}

/*
 * a frame moved along its z axis
 *     p' = p + q R ez
 * in  R[9]           rotation, row by row
 * in  p[3]           displacement [mm]
 * in  q              [mm]
 * out slid[3]        displacement [mm]
 * operations: 3 +, 3 *, 0 /, 0 sqrt
 */
INLINE void FN(arm_slid)(const real R[9], const real p[3], real q, real slid[3])
{
    slid[0] = R[2]*q + p[0];
    slid[1] = R[5]*q + p[1];
    slid[2] = R[8]*q + p[2];
}

/*
 * twist of a turn about a frame's z axis
 *     ω = R ez,  v = p × ω
 * in  R[9]           rotation, row by row
 * in  p[3]           displacement [mm]
 * out w[3]           ω
 * out v[3]           v
 * operations: 3 +, 6 *, 0 /, 0 sqrt
 */
INLINE void FN(arm_axis_twist)(const real R[9], const real p[3], real w[3], real v[3])
{
    w[0] = R[2];
    w[1] = R[5];
    w[2] = R[8];
    v[0] = R[8]*p[1] - R[5]*p[2];
    v[1] = R[2]*p[2] - R[8]*p[0];
    v[2] = R[5]*p[0] - R[2]*p[1];
}

#ifndef NARROW
/*
 * twists by a joint's six errors, with the joint before it moved from axes Qa to Qx
 *     R = Qx Qaᵀ;  by Δx Δy Δz: (0, R e)
 *     by Δφ Δθ Δψ: ω = R Rz(Δψ) Ry(Δθ) ex, R Rz(Δψ) ey, R ez,  v = at × ω
 * in  Qx[9]          axes of the joint before as moved, row by row
 * in  Qa[9]          the same at zero
 * in  at[3]          this joint's point as moved [mm]
 * in  e[6]           Δx Δy Δz [mm], Δφ Δθ Δψ [rad]
 * out along[9]       v by Δx, Δy, Δz, one row each
 * out turn[9]        ω by Δφ, Δθ, Δψ, one row each
 * out moment[9]      v, one row each
 * operations: 36 +, 62 *, 0 /, 0 sqrt
 */
INLINE void FN(arm_error_twists)(const real Qx[9], const real Qa[9], const real at[3],
        const real e[6], real along[9], real turn[9], real moment[9])
{
    real sb, cb;
    FN(sincos)(e[4], &sb, &cb);
    real sg, cg;
    FN(sincos)(e[5], &sg, &cg);
    /* base axes at zero, as moved */
    const real R0 = Qx[0]*Qa[0] + Qx[1]*Qa[1] + Qx[2]*Qa[2];
    const real R1 = Qx[0]*Qa[3] + Qx[1]*Qa[4] + Qx[2]*Qa[5];
    const real R2 = Qx[0]*Qa[6] + Qx[1]*Qa[7] + Qx[2]*Qa[8];
    const real R3 = Qx[3]*Qa[0] + Qx[4]*Qa[1] + Qx[5]*Qa[2];
    const real R4 = Qx[3]*Qa[3] + Qx[4]*Qa[4] + Qx[5]*Qa[5];
    const real R5 = Qx[3]*Qa[6] + Qx[4]*Qa[7] + Qx[5]*Qa[8];
    const real R6 = Qx[6]*Qa[0] + Qx[7]*Qa[1] + Qx[8]*Qa[2];
    const real R7 = Qx[6]*Qa[3] + Qx[7]*Qa[4] + Qx[8]*Qa[5];
    const real R8 = Qx[6]*Qa[6] + Qx[7]*Qa[7] + Qx[8]*Qa[8];
    /* ω in columns */
    const real t0 = cb*cg;
    const real t1 = cb*sg;
    const real T0 = R0*t0 + R1*t1 - sb*R2;
    const real T1 = cg*R1 - sg*R0;
    const real T3 = R3*t0 + R4*t1 - sb*R5;
    const real T4 = cg*R4 - sg*R3;
    const real T6 = R6*t0 + R7*t1 - sb*R8;
    const real T7 = cg*R7 - sg*R6;
    along[0] = R0;
    along[1] = R3;
    along[2] = R6;
    along[3] = R1;
    along[4] = R4;
    along[5] = R7;
    along[6] = R2;
    along[7] = R5;
    along[8] = R8;
    turn[0] = T0;
    turn[1] = T3;
    turn[2] = T6;
    turn[3] = T1;
    turn[4] = T4;
    turn[5] = T7;
    turn[6] = R2;
    turn[7] = R5;
    turn[8] = R8;
    moment[0] = at[1]*T6 - at[2]*T3;
    moment[1] = at[2]*T0 - at[0]*T6;
    moment[2] = at[0]*T3 - at[1]*T0;
    moment[3] = at[1]*T7 - at[2]*T4;
    moment[4] = at[2]*T1 - at[0]*T7;
    moment[5] = at[0]*T4 - at[1]*T1;
    moment[6] = at[1]*R8 - at[2]*R5;
    moment[7] = at[2]*R2 - at[0]*R8;
    moment[8] = at[0]*R5 - at[1]*R2;
}
#endif
