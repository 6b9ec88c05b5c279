/* Machines whose limbs are chains of joints: the closure of each chain, its passive joints eliminated.
 *
 * A chain is P = E1 exp(S1 θ1) E2 exp(S2 θ2) ... (see serial.h), and closes as P = (T T_home⁻¹) Ep: Ep
 * are the errors of its end on the platform. With ξ the platform's twist and J the hybrid twists of
 * its passive joints, ξ - J δθ = r; angles count as arcs at the characteristic length. Householder's
 * Q R = J leaves the rows Nᵀ ξ = Nᵀ r, with N the wrenches to which the passive joints do not give
 * way, and then δθ = R⁻¹ Qᵀ (ξ - r). A chain that ends in a ball closes in a point: three rows.
 *
 * Passive joints that chains share stay unknowns beside ξ. Where there are more rows than unknowns,
 * J and r are first divided by the Cholesky factor of the chain's compliance: what its joints, each
 * of them elastic, yield to a wrench at the end.
 */
#ifndef CHAIN_SYSTEM_H
#define CHAIN_SYSTEM_H

#include "serial.h"
#include "solve.h"
#include "chains.h"

enum {
    MAX_CHAIN_LINKS = PKM_MAX_LIMBS * (PKM_MAX_CHAIN + 1),
    MAX_CHAIN_UNKNOWNS = 6 + PKM_MAX_SHARED
};

/* What depends on the geometry only. */
typedef struct {
    motion link[MAX_CHAIN_LINKS];
    real ball[PKM_MAX_LIMBS][3]; /* the point on the platform, in its axes */
    real offset[PKM_MAX_LIMBS], gain[PKM_MAX_LIMBS];
} chain_numbers;

/* A chain at a state: its rows and columns are those of the group, or of the ball. */
typedef struct {
    int rows, own;         /* rows, and passive joints of its own */
    real J[6][6];          /* of these, column by column; Householder's vectors after elimination */
    real tau[6], R[6];     /* of Householder; reciprocals of R's diagonal */
    real shared[PKM_MAX_CHAIN][6];
    int which[PKM_MAX_CHAIN], sharing;
    real N[6][6];          /* wrenches; row by row */
    real L[6][6];          /* of the compliance */
    real r[6], lever[3];
} chain_view;

/* Which of (ω, v) close in a group. */
INLINE int group_rows(int map, const int **which)
{
    static const int spatial[6] = {0, 1, 2, 3, 4, 5}, planar[3] = {2, 3, 4};
    *which = map == MAP_PLANAR ? planar : spatial;
    return map == MAP_PLANAR || map == MAP_SPHERICAL ? 3 : 6;
}

INLINE real chain_number(const double *geometry, ptrdiff_t stride, int place, const ptrdiff_t *row)
{
    return stride ? gather(geometry + place, stride, row) : fill(geometry[place]);
}

INLINE joint_frame chain_frame(const pkm_chains *machine, int joint)
{
    joint_frame F;
    for (int k = 0; k < 9; k++) F.Q[k] = fill(machine->axes[9 * joint + k]);
    for (int k = 0; k < 3; k++) F.r[k] = fill(machine->point[3 * joint + k]);
    return F;
}

/* From the last joint to the platform's frame as the chain has it: F⁻¹ Ep⁻¹ T_home. */
INLINE motion chain_end(const pkm_chains *machine, int l, const joint_frame *from, const real *e)
{
    const motion home = fill_motion(machine->home);
    motion E, to, back;
    real end[3];
    for (int k = 0; k < 3; k++) end[k] = fill(machine->end[3 * l + k]);
    FN(joint_error)(e, end, E.R, E.p);
    FN(motion_invert)(E.R, E.p, back.R, back.p);
    to = composed(&back, &home);
    FN(motion_invert)(from->Q, from->r, back.R, back.p);
    return composed(&back, &to);
}

SHARED void prepare_chains(const pkm_chains *machine, const double *geometry, ptrdiff_t stride,
                           const ptrdiff_t *row, chain_numbers *numbers)
{
    for (int l = 0; l < machine->chains; l++) {
        const int first = machine->first[l], k = machine->first[l + 1] - first;
        motion *link = numbers->link + first + l;
        joint_frame from = {{{0}}, {{0}}}, to;
        real e[6];
        for (int i = 0; i < 9; i++) from.Q[i] = fill(i % 4 ? 0.0 : 1.0);
        for (int j = 0; j < k; j++, from = to) {
            const int joint = machine->member[first + j];
            to = chain_frame(machine, joint);
            for (int i = 0; i < 6; i++)
                e[i] = chain_number(geometry, stride, machine->place[joint] + i, row);
            FN(arm_link)(e, from.Q, from.r, to.Q, to.r, link[j].R, link[j].p);
        }
        for (int i = 0; i < (machine->ball[l] ? 3 : 6); i++)
            e[i] = chain_number(geometry, stride, machine->end_place[l] + i, row);
        if (!machine->ball[l]) {
            link[k] = chain_end(machine, l, &from, e);
            continue;
        }
        const motion home = fill_motion(machine->home);
        real off[3];
        for (int i = 0; i < 3; i++) off[i] = machine->end[3 * l + i] + e[i] - home.p[i];
        for (int i = 0; i < 3; i++)
            numbers->ball[l][i] = home.R[i] * off[0] + home.R[3 + i] * off[1] + home.R[6 + i] * off[2];
        for (int i = 0; i < 3; i++) {
            e[i] = chain_number(geometry, stride, machine->ball_place[l] + i, row);
            to.r[i] = fill(machine->end[3 * l + i]);
            e[3 + i] = fill(0.0);
        }
        for (int i = 0; i < 9; i++) to.Q[i] = fill(i % 4 ? 0.0 : 1.0);
        FN(arm_link)(e, from.Q, from.r, to.Q, to.r, link[k].R, link[k].p);
    }
    for (int a = 0; a < machine->actuators; a++) {
        numbers->offset[a] = chain_number(geometry, stride, machine->drive_place[a], row);
        numbers->gain[a] = chain_number(geometry, stride, machine->drive_place[a] + 1, row);
    }
}

/* What an actuator turns or slides its joint by, from home. */
INLINE void chain_drives(const pkm_chains *machine, const chain_numbers *numbers, const real *q,
                         real *drive)
{
    for (int a = 0; a < machine->actuators; a++)
        drive[a] = numbers->gain[a] * q[a] + numbers->offset[a] - machine->zero[a];
}

INLINE real joint_value(const pkm_chains *machine, int joint, const real *theta, const real *drive)
{
    const int a = machine->actuator[joint];
    return a >= 0 ? drive[a] : theta[machine->coordinate[joint]];
}

/* The frames of the joints of chain l before they move, and of its end. Sines come first: side by side
 * they do not wait for each other. */
INLINE void chain_walk(const pkm_chains *machine, int l, const chain_numbers *numbers,
                       const real *theta, const real *drive, motion *frame)
{
    const int first = machine->first[l], k = machine->first[l + 1] - first;
    const motion *link = numbers->link + first + l;
    real x[PKM_MAX_CHAIN], sine[PKM_MAX_CHAIN], cosine[PKM_MAX_CHAIN];
    for (int j = 0; j < k; j++) {
        const int joint = machine->member[first + j];
        x[j] = joint_value(machine, joint, theta, drive);
        if (!machine->prismatic[joint]) FN(sincos)(x[j], &sine[j], &cosine[j]);
    }
    for (int i = 0; i < 9; i++) frame[0].R[i] = link[0].R[i];
    for (int i = 0; i < 3; i++) frame[0].p[i] = link[0].p[i];
    for (int j = 0; j < k; j++) {
        const motion *at = &frame[j], *next = &link[j + 1];
        motion *to = &frame[j + 1];
        real moved[9];
        if (machine->prismatic[machine->member[first + j]]) {
            FN(arm_slid)(at->R, at->p, x[j], moved);
            FN(motion_compose)(at->R, moved, next->R, next->p, to->R, to->p);
        } else {
            FN(arm_turned)(at->R, sine[j], cosine[j], moved);
            FN(motion_compose)(moved, at->p, next->R, next->p, to->R, to->p);
        }
    }
}

/* Rows of a hybrid twist (λ ω, v) that close: those of the group, or a ball's three. */
INLINE void chain_cut(const pkm_chains *machine, int l, const real *twist, real *out)
{
    const int *which, rows = group_rows(machine->map, &which);
    if (machine->ball[l])
        for (int i = 0; i < 3; i++) out[i] = twist[3 + i];
    else
        for (int i = 0; i < rows; i++) out[i] = twist[which[i]];
}

/* The hybrid twist by a joint, an angle as its arc. */
INLINE void chain_twist(const pkm_chains *machine, int joint, const motion *at, const motion *end,
                        real *twist)
{
    real w[3];
    for (int i = 0; i < 3; i++) w[i] = at->R[3 * i + 2];
    if (machine->prismatic[joint]) {
        for (int i = 0; i < 3; i++) twist[i] = fill(0.0), twist[3 + i] = w[i];
    } else {
        memcpy(twist, w, sizeof w);
        FN(chain_turn)(w, at->p, end->p, twist + 3);
        for (int i = 0; i < 3; i++) twist[3 + i] *= 1.0 / machine->length;
    }
}

/* Its rows that close. */
INLINE void chain_column(const pkm_chains *machine, int l, int joint, const motion *at,
                         const motion *end, real *out)
{
    real twist[6];
    chain_twist(machine, joint, at, end, twist);
    chain_cut(machine, l, twist, out);
}

/* r, and of a ball its lever R b. Returns the largest of r; infinite where it is no number, and beyond
 * a quarter turn, where vee falls again and is 0 after half a turn. */
INLINE real chain_misses(const pkm_chains *machine, int l, const chain_numbers *numbers,
                         const motion *end, const real *R, const real *p, real *r, real *lever)
{
    const int *which, rows = machine->ball[l] ? 3 : group_rows(machine->map, &which);
    real worst = fill(0.0);
    if (machine->ball[l]) {
        FN(chain_ball)(R, p, numbers->ball[l], end->p, r, lever);
    } else {
        real all[6];
        FN(chain_closure)(end->R, end->p, R, p, fill(machine->length), all);
        chain_cut(machine, l, all, r);
    }
    for (int i = 0; i < rows; i++) worst = larger(worst, absolute(r[i]));
    if (!machine->ball[l]) {
        real trace = fill(0.0);
        for (int i = 0; i < 9; i++) trace += end->R[i] * R[i];
        worst = select(trace > fill(1.0), worst, fill(INFINITY));
    }
    return select(is_finite(worst), worst, fill(INFINITY));
}

/* Cholesky factor of what the joints yield at the end: each gives way along and about every axis,
 * by its compliance and by as much for an arc at the characteristic length. */
INLINE void chain_compliance(const pkm_chains *machine, int l, const motion *frame, chain_view *view)
{
    const int first = machine->first[l], k = machine->first[l + 1] - first;
    const int *which;
    group_rows(machine->map, &which);
    real C[6][6];
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) C[i][j] = fill(0.0);
    for (int n = 0; n <= k; n++) {
        if (n == k && !machine->ball[l]) break;
        const double soft = n < k ? machine->soft[machine->member[first + n]] : 1.0;
        real d[3], square = fill(0.0), cross[3][3];
        for (int i = 0; i < 3; i++) d[i] = (frame[k].p[i] - frame[n].p[i]) * (1.0 / machine->length);
        for (int i = 0; i < 3; i++) square += d[i] * d[i];
        for (int i = 0; i < 3; i++) {
            cross[i][i] = fill(0.0);
            cross[i][(i + 1) % 3] = d[(i + 2) % 3]; /* v = ω × d = -[d] ω */
            cross[i][(i + 2) % 3] = -d[(i + 1) % 3];
        }
        for (int i = 0; i < 3; i++) {
            C[i][i] += soft;
            C[3 + i][3 + i] += soft * (1.0 + square);
            for (int j = 0; j < 3; j++) {
                C[3 + i][3 + j] -= soft * (d[i] * d[j]);
                C[3 + i][j] += soft * cross[i][j]; /* below the diagonal: no more is read */
            }
        }
    }
    for (int i = 0; i < view->rows; i++)
        for (int j = 0; j <= i; j++) {
            real sum = machine->ball[l] ? C[3 + i][3 + j] : C[which[i]][which[j]];
            for (int n = 0; n < j; n++) sum -= view->L[i][n] * view->L[j][n];
            view->L[i][j] = i == j ? FN(root)(sum) : sum / view->L[j][j];
        }
}

/* L⁻¹ x and L⁻ᵀ x, in place. */
INLINE void divide_by(int rows, real (*L)[6], real *x)
{
    for (int i = 0; i < rows; i++) {
        for (int j = 0; j < i; j++) x[i] -= L[i][j] * x[j];
        x[i] /= L[i][i];
    }
}

INLINE void divide_by_transposed(int rows, real (*L)[6], real *x)
{
    for (int i = rows - 1; i >= 0; i--) {
        for (int j = i + 1; j < rows; j++) x[i] -= L[j][i] * x[j];
        x[i] /= L[i][i];
    }
}

/* Entries of a and b from `first` on, multiplied and added: every other one, so that one sum does not
 * wait for the other. */
INLINE real products(int first, int end, const real *a, const real *b)
{
    real one = a[first] * b[first], other = first + 1 < end ? a[first + 1] * b[first + 1] : fill(0.0);
    for (int i = first + 2; i < end; i += 2) one += a[i] * b[i];
    for (int i = first + 3; i < end; i += 2) other += a[i] * b[i];
    return one + other;
}

/* Q R of the own columns, in place; the wrenches N. The sign of the last one makes det (J N)
 * positive, so that they turn with the limb and never jump. */
INLINE void chain_eliminate_rows(int rows, int over, chain_view *view, real *flat)
{
    const int own = view->own;
    real sign = fill(own % 2 ? -1.0 : 1.0);
    UNROLL for (int c = 0; c < rows; c++) {
        if (c >= own) break;
        real *x = view->J[c];
        const real length = FN(root)(products(c, rows, x, x)), size = length * (length + absolute(x[c]));
        const mask positive = x[c] > fill(0.0);
        const real inverse = 1.0 / length;
        view->R[c] = select(positive, -inverse, inverse);
        sign = select(positive, -sign, sign);
        *flat = larger(*flat, inverse);
        x[c] -= select(positive, -length, length);
        view->tau[c] = 1.0 / size;
        for (int d = c + 1; d < own; d++) {
            real *y = view->J[d];
            const real t = products(c, rows, x, y) * view->tau[c];
            for (int i = c; i < rows; i++) y[i] -= t * x[i];
        }
    }
    for (int n = own; n < rows; n++) {
        real *v = view->N[n - own];
        for (int i = 0; i < rows; i++) v[i] = fill(i == n ? 1.0 : 0.0);
        UNROLL for (int c = rows - 1; c >= 0; c--) {
            if (c >= own) continue;
            const real t = products(c, rows, view->J[c], v) * view->tau[c];
            for (int i = c; i < rows; i++) v[i] -= t * view->J[c][i];
        }
        if (n == rows - 1)
            for (int i = 0; i < rows; i++) v[i] *= sign;
        if (over) divide_by_transposed(rows, view->L, v);
    }
}

INLINE void chain_eliminate(int over, chain_view *view, real *flat)
{
    if (view->rows == 6) chain_eliminate_rows(6, over, view, flat);
    else chain_eliminate_rows(3, over, view, flat);
}

/* Chain l at a state, not yet eliminated. Returns what it misses. */
INLINE real chain_look(const pkm_chains *machine, int l, const chain_numbers *numbers,
                       const real *theta, const real *drive, const real *R, const real *p,
                       chain_view *view)
{
    const int first = machine->first[l], k = machine->first[l + 1] - first;
    const int *which;
    motion frame[PKM_MAX_CHAIN + 1];
    view->rows = machine->ball[l] ? 3 : group_rows(machine->map, &which);
    view->own = view->sharing = 0;
    chain_walk(machine, l, numbers, theta, drive, frame);
    const real missed = chain_misses(machine, l, numbers, &frame[k], R, p, view->r, view->lever);
    for (int j = 0; j < k; j++) {
        const int joint = machine->member[first + j];
        if (machine->actuator[joint] >= 0) continue;
        const int shared = machine->coordinate[joint] < machine->shared;
        real *column = shared ? view->shared[view->sharing] : view->J[view->own];
        chain_column(machine, l, joint, &frame[j], &frame[k], column);
        if (shared) view->which[view->sharing++] = machine->coordinate[joint];
        else view->own++;
    }
    if (machine->over) {
        chain_compliance(machine, l, frame, view);
        for (int c = 0; c < view->own; c++) divide_by(view->rows, view->L, view->J[c]);
    }
    return missed;
}

/* What chain l misses at a state, and r. */
INLINE real chain_missed(const pkm_chains *machine, int l, const chain_numbers *numbers,
                         const real *R, const real *p, const real *theta, const real *drive, real *r)
{
    motion frame[PKM_MAX_CHAIN + 1];
    real lever[3];
    chain_walk(machine, l, numbers, theta, drive, frame);
    return chain_misses(machine, l, numbers, &frame[machine->first[l + 1] - machine->first[l]], R, p, r,
                        lever);
}

#endif
