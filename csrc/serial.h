/* Screws and serial arms: exponential and logarithm of motions, the product of exponentials with
 * joint errors (B eq. 5 and 19), and its Jacobians. Motions are 4 x 4, row by row. */
#ifndef SERIAL_H
#define SERIAL_H

#include "rows.h"
#include "screws.h"

typedef struct {
    real R[9], p[3];
} motion;

INLINE motion unmoved(void)
{
    motion one;
    for (int k = 0; k < 9; k++) one.R[k] = fill(k % 4 ? 0.0 : 1.0);
    for (int k = 0; k < 3; k++) one.p[k] = fill(0.0);
    return one;
}

/* Of the first three rows of a matrix, row by row. */
INLINE motion motion_of(const real rows[12])
{
    motion T;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) T.R[3 * i + j] = rows[4 * i + j];
        T.p[i] = rows[4 * i + 3];
    }
    return T;
}

/* The same motion in every lane. */
INLINE motion fill_motion(const double *matrix)
{
    motion T;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) T.R[3 * i + j] = fill(matrix[4 * i + j]);
        T.p[i] = fill(matrix[4 * i + 3]);
    }
    return T;
}

/* The matrix of a motion; if any number is not finite, all sixteen become NaN. */
INLINE void matrix_of(const motion *T, real rows[16])
{
    const real *p = T->p;
    const real zero = ((p[0] - p[0]) + (p[1] - p[1])) + ((p[2] - p[2]) + (T->R[0] - T->R[0]));
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) rows[4 * i + j] = T->R[3 * i + j] + zero;
        rows[4 * i + 3] = p[i] + zero;
        rows[12 + i] = zero;
    }
    rows[15] = zero + 1.0;
}

INLINE motion composed(const motion *a, const motion *b)
{
    motion T;
    FN(motion_compose)(a->R, a->p, b->R, b->p, T.R, T.p);
    return T;
}

/* c0 ... c5 at x = ω·ω. */
INLINE void angle_functions(real x, real c[6])
{
    real c4 = fill(C4_SERIES[SERIES_COUNT - 1]), c5 = fill(C5_SERIES[SERIES_COUNT - 1]);
    for (int k = SERIES_COUNT - 2; k >= 0; k--) {
        c4 = C4_SERIES[k] + x * c4;
        c5 = C5_SERIES[k] + x * c5;
    }
    FN(angle_near)(x, c4, c5, c);
    const mask near = x <= fill(SERIES_END);
    if (any(~near)) {
        real far[6];
        FN(angle_far)(FN(root)(x), far);
        for (int k = 0; k < 6; k++) c[k] = select(near, c[k], far[k]);
    }
}

INLINE real dot3(const real a[3], const real b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* The lanes of one block of rows of the calls that are named so: see derive/calls.py. */
INLINE void exp_row(const real twist[6], real matrix[16])
{
    real c[6];
    motion T;
    angle_functions(dot3(twist, twist), c);
    FN(screw_exp)(twist, twist + 3, c, T.R, T.p);
    matrix_of(&T, matrix);
}

/* ω of a rotation, 0 to π: of the four copies of its quaternion the one with the largest entry,
 * with the scalar part positive. The ratio angle/n holds where n² underflows. */
INLINE void rotation_log(const real R[9], real w[3])
{
    real K[16], q[4], largest;
    FN(rotation_quaternions)(R, K);
    largest = K[0];
    for (int k = 0; k < 4; k++) q[k] = K[k];
    for (int i = 1; i < 4; i++) {
        const mask larger_one = K[5 * i] > largest;
        largest = select(larger_one, K[5 * i], largest);
        for (int k = 0; k < 4; k++) q[k] = select(larger_one, K[4 * i + k], q[k]);
    }
    const mask turned = q[0] < fill(0.0);
    for (int k = 0; k < 4; k++) q[k] = select(turned, -q[k], q[k]);
    const real n = FN(root)(dot3(q + 1, q + 1));
    const mask still = n == fill(0.0);
    const real divisor = select(still, fill(1.0), n);
    const real ratio = select(still, 1.0 / q[0], arctangent2(n, q[0]) / divisor);
    for (int k = 0; k < 3; k++) w[k] = 2.0 * ratio * q[1 + k];
}

INLINE void log_row(const real matrix[12], real twist[6])
{
    real c[6];
    const motion T = motion_of(matrix);
    rotation_log(T.R, twist);
    angle_functions(dot3(twist, twist), c);
    FN(screw_log)(twist, T.p, c, twist + 3);
    whole_or_nan(twist, 6);
}

INLINE void exp_jacobian_row(const real twist[6], real jacobian[36])
{
    real c[6];
    angle_functions(dot3(twist, twist), c);
    FN(screw_exp_jacobian)(twist, twist + 3, c, jacobian);
    whole_or_nan(jacobian, 36);
}

INLINE void log_jacobian_row(const real twist[6], real jacobian[36])
{
    real c[6];
    angle_functions(dot3(twist, twist), c);
    FN(screw_log_jacobian)(twist, twist + 3, c, jacobian);
    whole_or_nan(jacobian, 36);
}

INLINE void adjoint_row(const real matrix[12], real adjoint[36])
{
    const motion T = motion_of(matrix);
    FN(motion_adjoint)(T.R, T.p, adjoint);
    whole_or_nan(adjoint, 36);
}

/* x y z α β γ of a motion. */
INLINE void motion_pose_row(const real matrix[12], real pose[6])
{
    const motion T = motion_of(matrix);
    FN(motion_pose)(T.R, T.p, pose);
}

INLINE void joint_motion_row(const real error[6], const real point[3], real matrix[16])
{
    motion E;
    FN(joint_error)(error, point, E.R, E.p);
    matrix_of(&E, matrix);
}

/* --- arms: T = C1 Z(q1) C2 Z(q2) ... C(n+1), which is B eq. 19 with exp(q S) = F Z(q) F^-1 for
 * the frame F = (Q, r) of a joint, whose z axis is the joint's: Z turns about it or slides along.
 * A link C is twelve numbers, R then p. ------------------------------------------------------ */

typedef struct {
    real Q[9], r[3];
} joint_frame;

/* Of joint 1 to n at zero; joint 0 stands for the base. */
INLINE joint_frame frame_of(const pkm_arm *arm, int joint)
{
    joint_frame F;
    for (int k = 0; k < 9; k++)
        F.Q[k] = fill(joint ? arm->axes[9 * (joint - 1) + k] : k % 4 ? 0.0 : 1.0);
    for (int k = 0; k < 3; k++) F.r[k] = fill(joint ? arm->point[3 * (joint - 1) + k] : 0.0);
    return F;
}

/* Links (n, joints + 1, 12) of an arm with errors (n, joints, 6). */
int CALL(arm_links)(const pkm_arm *arm, ptrdiff_t n, const double *error, double *link)
{
    if (arm->joints < 1) return PKM_BAD_MACHINE;
    const int joints = arm->joints, stride = 12 * (joints + 1);
    const motion home = fill_motion(arm->home);
    EACH_BLOCK(first, n, row, count) {
        for (int i = 0; i <= joints; i++) {
            const joint_frame from = frame_of(arm, i);
            joint_frame to = {{{0}}, {{0}}};
            real e[6] = {0};
            motion C;
            if (i < joints) to = frame_of(arm, i + 1);
            for (int k = 0; k < 9 && i == joints; k++) to.Q[k] = home.R[k];
            for (int k = 0; k < 3 && i == joints; k++) to.r[k] = home.p[k];
            if (i < joints) gather_row(error + 6 * i, 6 * joints, 6, row, e);
            FN(arm_link)(e, from.Q, from.r, to.Q, to.r, C.R, C.p);
            scatter_row(C.R, 9, link + 12 * i, stride, row, count);
            scatter_row(C.p, 3, link + 12 * i + 9, stride, row, count);
        }
    }
    return 0;
}

/* Link i + 1, one for all rows or one a row. */
INLINE motion link_of(const pkm_links *links, int joints, int i, const ptrdiff_t *row)
{
    const double *link = links->link + 12 * i;
    const ptrdiff_t stride = 12 * (joints + 1);
    motion C;
    if (links->by_row) {
        gather_row(link, stride, 9, row, C.R);
        gather_row(link + 9, stride, 3, row, C.p);
    } else {
        for (int k = 0; k < 9; k++) C.R[k] = fill(link[k]);
        for (int k = 0; k < 3; k++) C.p[k] = fill(link[9 + k]);
    }
    return C;
}

INLINE void follow_link(const pkm_links *links, int joints, int i, const ptrdiff_t *row, motion *T)
{
    const motion C = link_of(links, joints, i, row);
    *T = i ? composed(T, &C) : C;
}

INLINE void move_joint(const pkm_arm *arm, int i, real q, motion *T)
{
    motion moved = *T;
    real sine, cosine;
    if (arm->prismatic[i]) {
        FN(arm_slid)(T->R, T->p, q, moved.p);
    } else {
        FN(sincos)(q, &sine, &cosine);
        FN(arm_turned)(T->R, sine, cosine, moved.R);
    }
    *T = moved;
}

INLINE motion arm_tool(const pkm_arm *arm, const pkm_links *links, const double *theta,
                       const ptrdiff_t *row)
{
    motion T;
    for (int i = 0; i < arm->joints; i++) {
        follow_link(links, arm->joints, i, row, &T);
        move_joint(arm, i, gather(theta + i, arm->joints, row), &T);
    }
    follow_link(links, arm->joints, arm->joints, row, &T);
    return T;
}

int CALL(arm_forward)(const pkm_arm *arm, const pkm_links *links, ptrdiff_t n, const double *theta,
                      double *motions)
{
    if (arm->joints < 1) return PKM_BAD_MACHINE;
    EACH_BLOCK(first, n, row, count) {
        real matrix[16];
        const motion T = arm_tool(arm, links, theta, row);
        matrix_of(&T, matrix);
        scatter_row(matrix, 16, motions, 16, row, count);
    }
    return 0;
}

/* What moves a space twist into the frame that is asked for. */
INLINE motion arm_view(const pkm_arm *arm, const pkm_links *links, int frame, const double *theta,
                       const ptrdiff_t *row)
{
    motion view = unmoved();
    if (frame == PKM_SPACE) return view;
    const motion tool = arm_tool(arm, links, theta, row);
    if (frame == PKM_BODY) FN(motion_invert)(tool.R, tool.p, view.R, view.p);
    if (frame == PKM_TIP)
        for (int k = 0; k < 3; k++) view.p[k] = -tool.p[k];
    return view;
}

INLINE void scatter_column(const motion *view, const real w[3], const real v[3], double *column,
                           int columns, const ptrdiff_t *row, int count)
{
    real seen[6];
    FN(screw_moved)(view->R, view->p, w, v, seen, seen + 3);
    for (int k = 0; k < 6; k++) scatter(seen[k], column + k * columns, 6 * columns, row, count);
}

/* Where the arm cannot be said to be there are no derivatives either: NaN, as the tool. */
INLINE void drop_unknown(const motion *T, double *rows, int width, const ptrdiff_t *row, int count)
{
    const mask known = is_finite(T->p[0]) & is_finite(T->p[1]) & is_finite(T->p[2]) & is_finite(T->R[0]);
    if (!any(~known)) return;
    for (int l = 0; l < count; l++)
        for (int k = 0; !known[l] && k < width; k++) rows[row[l] * width + k] = NAN;
}

int CALL(arm_jacobian)(const pkm_arm *arm, const pkm_links *links, int frame, ptrdiff_t n,
                       const double *theta, double *jacobian)
{
    if (arm->joints < 1) return PKM_BAD_MACHINE;
    const real still[3] = {fill(0.0), fill(0.0), fill(0.0)};
    EACH_BLOCK(first, n, row, count) {
        motion T = unmoved();
        const motion view = arm_view(arm, links, frame, theta, row);
        for (int i = 0; i < arm->joints; i++) {
            real w[3], v[3];
            follow_link(links, arm->joints, i, row, &T);
            FN(arm_axis_twist)(T.R, T.p, w, v);
            scatter_column(&view, arm->prismatic[i] ? still : w, arm->prismatic[i] ? w : v,
                           jacobian + i, arm->joints, row, count);
            move_joint(arm, i, gather(theta + i, arm->joints, row), &T);
        }
        drop_unknown(&T, jacobian, 6 * arm->joints, row, count);
    }
    return 0;
}

/* By joint errors (joints, 6), or (n, joints, 6) where links are by row. */
int CALL(arm_error_jacobian)(const pkm_arm *arm, const pkm_links *links, const double *error,
                             int frame, ptrdiff_t n, const double *theta, double *jacobian)
{
    if (arm->joints < 1) return PKM_BAD_MACHINE;
    const int columns = 6 * arm->joints;
    const real still[3] = {fill(0.0), fill(0.0), fill(0.0)};
    EACH_BLOCK(first, n, row, count) {
        motion T = unmoved();
        const motion view = arm_view(arm, links, frame, theta, row);
        for (int i = 0; i < arm->joints; i++) {
            const joint_frame before = frame_of(arm, i);
            const motion moved = T;
            double *column = jacobian + 6 * i;
            real e[6], along[9], turn[9], moment[9];
            gather_row(error + 6 * i, links->by_row ? columns : 0, 6, row, e);
            follow_link(links, arm->joints, i, row, &T);
            FN(arm_error_twists)(moved.R, before.Q, T.p, e, along, turn, moment);
            for (int k = 0; k < 3; k++) {
                scatter_column(&view, still, along + 3 * k, column + k, columns, row, count);
                scatter_column(&view, turn + 3 * k, moment + 3 * k, column + 3 + k, columns, row,
                               count);
            }
            move_joint(arm, i, gather(theta + i, arm->joints, row), &T);
        }
        drop_unknown(&T, jacobian, 6 * columns, row, count);
    }
    return 0;
}

#endif
