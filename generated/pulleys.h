/* Generated from derive/pulleys.py by `python -m derive`; never edited by hand.
 * derivation 61d8806883e58ebe
 * `real` is a number or a lane of numbers, FN(name) the function for that type. */

#ifndef NARROW
/*
 * a cable over a swivelling pulley, from its entry point A to its end D
 *     D - A = x u + y k,  f = √((x - r)² + y² - r²),  wrapped = 2 atan2(x, y + f)
 *     l = r wrapped + f,  swivel = atan2(e2·(D - A), e1·(D - A)),  (e1, e2, k) = F Rx Ry
 * in  own[3]         radius [mm], two tilts of the swivel axis [rad]
 * in  F[9]           frame of the swivel axis, its third column, row by row
 * in  h[3]           D - A [mm]
 * out l              l [mm]
 * out by_joint[3]    ∂l/∂D
 * out by_own[3]      ∂l/∂(radius, tilts)
 * out bend[9]        ∂²l/∂D², 3 x 3
 * out turned         swivel angle [rad]
 * out turned_by_joint[3] ∂swivel/∂D
 * out turned_by_own[3] ∂swivel/∂(radius, tilts)
 * operations: 91 +, 175 *, 6 /, 2 sqrt
 */
INLINE void FN(pulley)(const real own[3], const real F[9], const real h[3], real *l,
        real by_joint[3], real by_own[3], real bend[9], real *turned, real turned_by_joint[3],
        real turned_by_own[3])
{
    real s1, c1;
    FN(sincos)(own[1], &s1, &c1);
    real s2, c2;
    FN(sincos)(own[2], &s2, &c2);
    const real t0 = F[1]*s1 - F[2]*c1;
    const real t1 = -t0;
    const real t2 = F[0]*c2 - s2*t1;
    const real axes0 = t2;
    const real t3 = F[1]*c1;
    const real t4 = F[2]*s1;
    const real axes1 = t3 + t4;
    const real t5 = F[0]*s2;
    const real axes2 = c2*t1 + t5;
    const real t6 = F[4]*s1 - F[5]*c1;
    const real t7 = -t6;
    const real t8 = F[3]*c2 - s2*t7;
    const real axes3 = t8;
    const real t9 = F[4]*c1;
    const real t10 = F[5]*s1;
    const real axes4 = t9 + t10;
    const real t11 = F[3]*s2;
    const real axes5 = c2*t7 + t11;
    const real t12 = F[7]*s1 - F[8]*c1;
    const real t13 = -t12;
    const real t14 = F[6]*c2 - s2*t13;
    const real axes6 = t14;
    const real t15 = F[7]*c1;
    const real t16 = F[8]*s1;
    const real axes7 = t15 + t16;
    const real t17 = F[6]*s2;
    const real axes8 = c2*t13 + t17;
    const real a = h[0]*axes0 + h[1]*axes3 + h[2]*axes6;
    const real b = h[0]*axes1 + h[1]*axes4 + h[2]*axes7;
    /* from the axis */
    const real t18 = a*a + b*b;
    const real t19 = FN(root)(t18);
    const real x = t19;
    /* along it */
    const real y = h[0]*axes2 + h[1]*axes5 + h[2]*axes8;
    /* the straight part */
    const real t20 = x - own[0];
    const real t21 = FN(root)(y*y + t20*t20 - own[0]*own[0]);
    const real free = t21;
    const real rise = y + free;
    /* half of the wrapped angle */
    const real half = arctangent2(x, rise);
    const real t22 = 2.0f*half;
    const real length = own[0]*t22 + free;
    /* ∂l/∂D: the direction of the straight part */
    const real t23 = 1.0f/t19;
    const real t24 = axes0*a;
    const real t25 = axes1*b;
    const real t26 = t23*t24 + t23*t25;
    const real t27 = x*x;
    const real t28 = 1.0f/(rise*rise + t27);
    const real t29 = rise*t28;
    const real t30 = 1.0f/t21;
    const real t31 = y*t30;
    const real t32 = t20*t30;
    const real t33 = axes2*t31 + t26*t32;
    const real t34 = x*t28;
    const real t35 = 2.0f*own[0];
    const real pull0 = (t26*t29 - (axes2 + t33)*t34)*t35 + t33;
    const real t36 = axes3*a;
    const real t37 = axes4*b;
    const real t38 = t23*t36 + t23*t37;
    const real t39 = axes5*t31 + t32*t38;
    const real pull1 = (t29*t38 - (axes5 + t39)*t34)*t35 + t39;
    const real t40 = axes6*a;
    const real t41 = axes7*b;
    const real t42 = t23*t40 + t23*t41;
    const real t43 = axes8*t31 + t32*t42;
    const real pull2 = (t29*t42 - (axes8 + t43)*t34)*t35 + t43;
    /* from the axis to D */
    const real t44 = 1.0f/x;
    const real u0 = (t24 + t25)*t44;
    const real u1 = (t36 + t37)*t44;
    const real u2 = (t40 + t41)*t44;
    /* normal to the plane of the groove */
    const real n0 = axes5*u2 - axes8*u1;
    const real n1 = axes8*u0 - axes2*u2;
    const real n2 = axes2*u1 - axes5*u0;
    /* in the plane, across the straight part */
    const real beside0 = pull2*n1 - pull1*n2;
    const real beside1 = pull0*n2 - pull2*n0;
    const real beside2 = pull1*n0 - pull0*n1;
    const real swivel = arctangent2(b, a);
    *l = length;
    by_joint[0] = pull0;
    by_joint[1] = pull1;
    by_joint[2] = pull2;
    by_own[0] = t22 + t27*t28*t30*t35 - x*t30;
    const real t45 = h[0]*t1 + h[1]*t7 + h[2]*t13;
    const real t46 = h[0]*(s2*t3 + s2*t4) + h[1]*(s2*t9 + s2*t10) + h[2]*(s2*t15 + s2*t16);
    const real t47 = a*t23;
    const real t48 = b*t23*t45 + t46*t47;
    const real t49 = h[0]*(-c2*t3 - c2*t4) + h[1]*(-c2*t9 - c2*t10) + h[2]*(-c2*t15 - c2*t16);
    const real t50 = t31*t49 + t32*t48;
    by_own[1] = (t29*t48 - t34*(t49 + t50))*t35 + t50;
    const real t51 = h[0]*(c2*t0 - t5) + h[1]*(c2*t6 - t11) + h[2]*(c2*t12 - t17);
    const real t52 = t47*t51;
    const real t53 = h[0]*t2 + h[1]*t8 + h[2]*t14;
    const real t54 = t31*t53 + t32*t52;
    by_own[2] = (t29*t52 - t34*(t53 + t54))*t35 + t54;
    const real t55 = 1.0f/free;
    const real t56 = (pull0*u0 + pull1*u1 + pull2*u2)*t44;
    bend[0] = n0*n0*t56 + beside0*beside0*t55;
    const real t57 = beside0*t55;
    const real t58 = n0*t56;
    const real t59 = n1*t58 + beside1*t57;
    bend[1] = t59;
    const real t60 = n2*t58 + beside2*t57;
    bend[2] = t60;
    bend[3] = t59;
    bend[4] = n1*n1*t56 + beside1*beside1*t55;
    const real t61 = n1*n2*t56 + beside1*beside2*t55;
    bend[5] = t61;
    bend[6] = t60;
    bend[7] = t61;
    bend[8] = n2*n2*t56 + beside2*beside2*t55;
    *turned = swivel;
    const real t62 = 1.0f/t18;
    const real t63 = a*t62;
    const real t64 = b*t62;
    turned_by_joint[0] = axes1*t63 - axes0*t64;
    turned_by_joint[1] = axes4*t63 - axes3*t64;
    turned_by_joint[2] = axes7*t63 - axes6*t64;
    turned_by_own[0] = FN(fill)(0.0f);
    turned_by_own[1] = t45*t63 - t46*t64;
    turned_by_own[2] = -t51*t64;
}
#endif

/*
 * a straight part of a cable, from a point P to its end D
 *     l = ‖D - P‖
 * in  h[3]           D - P [mm]
 * out l              l [mm]
 * out by_joint[3]    ∂l/∂D
 * out bend[9]        ∂²l/∂D², 3 x 3
 * operations: 5 +, 17 *, 1 /, 1 sqrt
 */
INLINE void FN(strand)(const real h[3], real *l, real by_joint[3], real bend[9])
{
    const real length = FN(root)(h[0]*h[0] + h[1]*h[1] + h[2]*h[2]);
    /* its direction */
    const real t0 = 1.0f/length;
    const real pull0 = h[0]*t0;
    const real pull1 = h[1]*t0;
    const real pull2 = h[2]*t0;
    *l = length;
    by_joint[0] = pull0;
    by_joint[1] = pull1;
    by_joint[2] = pull2;
    bend[0] = (1.0f - pull0*pull0)*t0;
    const real t1 = pull0*t0;
    const real t2 = -pull1*t1;
    bend[1] = t2;
    const real t3 = -pull2*t1;
    bend[2] = t3;
    bend[3] = t2;
    bend[4] = (1.0f - pull1*pull1)*t0;
    const real t4 = -pull1*pull2*t0;
    bend[5] = t4;
    bend[6] = t3;
    bend[7] = t4;
    bend[8] = (1.0f - pull2*pull2)*t0;
}
