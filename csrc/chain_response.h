/* Derivatives of machines of chains: of their rows, and of the pose by actuators and errors. */
#ifndef CHAIN_RESPONSE_H
#define CHAIN_RESPONSE_H

#include "chain_balance.h"

int CALL(chain_closure)(const pkm_chains *machine, ptrdiff_t n, const double *geometry,
                        ptrdiff_t geometry_stride, const double *pose, const double *q,
                        double *residual, double *by_step, double *by_free, double *by_q,
                        double *on_map, double *pose_by_free)
{
    const int all = pkm_chain_count(machine), m = map_m(machine->map), unknowns = m + machine->shared;
    const int actuators = machine->actuators;
    if (!all) return PKM_BAD_MACHINE;
    const chain_geometry of = {machine, geometry, geometry_stride};
    chain_numbers numbers;
    EACH_BLOCK(first, n, row, count) {
        real lane_q[PKM_MAX_LIMBS], drive[PKM_MAX_LIMBS], worst, flat;
        real phi[PKM_MAX_CHAIN_ROWS], jacobian[PKM_MAX_CHAIN_ROWS * MAX_CHAIN_UNKNOWNS];
        chain_view view[PKM_MAX_LIMBS];
        chain_state at;
        chain_prepare(&of, first, row, &numbers);
        mask held;
        const mask good = chain_inspect(machine, &numbers, pose, q, row, lane_q, drive, &at, &held);
        const real zero = select(good, fill(0.0), fill(NAN)), sure = select(held, zero, fill(NAN));
        const int rows = chain_views(machine, &numbers, &at, drive, view, phi, jacobian, &worst, &flat);
        real found[6], by_free_of_pose[36];
        map_to_pose(machine->map, at.state, found);
        scatter_row(found, 6, on_map, 6, row, count);
        pose_rates_by_free(machine->map, at.state, by_free_of_pose);
        scatter_row(by_free_of_pose, 6 * m, pose_by_free, 6 * m, row, count);
        for (int r = 0; r < rows; r++) {
            real step[6], free[6];
            phi[r] += zero;
            for (int j = 0; j < unknowns; j++) jacobian[r * unknowns + j] += zero;
            for (int j = 0; j < m; j++)
                step[j] = jacobian[r * unknowns + j]
                          * (map_is_angle(machine->map, j) ? machine->length : 1.0);
            map_free(machine->map, at.state, step, free);
            scatter_row(free, m, by_free + r * m, rows * m, row, count);
            scatter(phi[r], residual + r, rows, row, count);
            for (int j = 0; j < m; j++) jacobian[r * unknowns + j] += sure;
            scatter_row(jacobian + r * unknowns, unknowns, by_step + r * unknowns, rows * unknowns,
                        row, count);
        }
        for (int l = 0, r = 0; l < machine->chains; r += view[l].rows - view[l].own, l++) {
            motion frame[PKM_MAX_CHAIN + 1];
            chain_walk(machine, l, &numbers, at.theta, drive, frame);
            for (int a = 0; a < actuators; a++) {
                real change[6], by[6];
                chain_by_drive(machine, l, frame, a, change);
                chain_pull(&view[l], change, by);
                for (int k = 0; k < view[l].rows - view[l].own; k++)
                    scatter(by[k] * numbers.gain[a] + zero, by_q + (r + k) * actuators + a,
                            rows * actuators, row, count);
            }
        }
    }
    return 0;
}

/* Where the errors of a chain's numbers go: the answer of the pose to rows, or to what brings rest out
 * of balance, is `answer` (6 x all). */
typedef struct {
    const pkm_chains *machine;
    const real *answer;
    int all, columns;
    const int16_t *at; /* the column of a place, or -1 */
    real *out;
} chain_sink;

/* The chain whose numbers they are: its rows begin at `first_row`, or it is at rest. */
typedef struct {
    int l, first_row;
    const chain_view *view;
    chain_balance *rest;
} chain_of;

/* A number's column: by it a hybrid twist moves the chain from joint `from` on, and its end. */
SHARED void chain_drop(const chain_sink *sink, const chain_of *of, int from, const real *twist,
                       real factor, int column)
{
    real rows[MAX_BALANCE], change[6];
    int count, first = of->first_row;
    if (sink->machine->over) {
        const chain_balance *rest = of->rest;
        real by[MAX_BALANCE];
        balance_by_twist(sink->machine, of->l, of->rest, from, twist, by);
        first = 0, count = sink->all;
        for (int s = 0; s < count; s++) {
            rows[s] = by[rest->own + s];
            for (int i = 0; i < rest->own; i++) rows[s] -= rest->taken[i][s] * by[i];
        }
    } else {
        chain_cut(sink->machine, of->l, twist, change);
        count = chain_pull(of->view, change, rows);
    }
    for (int n = 0; n < count; n++)
        for (int k = 0; k < 6; k++)
            sink->out[k * sink->columns + column] += sink->answer[k * sink->all + first + n]
                                                     * (rows[n] * factor);
}

/* By the first `count` errors at `place` of what is at `at`, the joint before moved from axes Qa to Qx. */
SHARED void chain_by_errors(const chain_sink *sink, const chain_of *of, int from, int place, int count,
                            const real *e, const real *Qx, const real *Qa, const real *at,
                            const motion *end, double sign)
{
    real along[9], turn[9], moment[9];
    FN(arm_error_twists)(Qx, Qa, at, e, along, turn, moment);
    for (int i = 0; i < count; i++) {
        const int column = sink->at[place + i];
        real twist[6];
        if (column < 0) continue;
        for (int k = 0; k < 3; k++) twist[k] = i < 3 ? fill(0.0) : turn[3 * (i - 3) + k];
        FN(chain_turn)(twist, at, end->p, twist + 3);
        for (int k = 0; k < 3; k++) {
            if (i < 3) twist[3 + k] = along[3 * i + k];
            twist[k] *= sink->machine->length;
        }
        chain_drop(sink, of, from, twist, fill(sign), column);
    }
}

SHARED void chain_by_numbers(const chain_sink *sink, const chain_of *own, const chain_geometry *of,
                             const chain_numbers *numbers, const ptrdiff_t *row, const chain_state *at,
                             const real *drive, const real *lane_q)
{
    const pkm_chains *machine = sink->machine;
    const int l = own->l, first = machine->first[l], k = machine->first[l + 1] - first;
    motion frame[PKM_MAX_CHAIN + 1], moved = unmoved();
    joint_frame before = {{{0}}, {{0}}};
    real e[6];
    chain_walk(machine, l, numbers, at->theta, drive, frame);
    before.Q[0] = before.Q[4] = before.Q[8] = fill(1.0);
    for (int j = 0; j < k; j++) {
        const int joint = machine->member[first + j], place = machine->place[joint];
        for (int i = 0; i < 6; i++) e[i] = chain_number(of->geometry, of->stride, place + i, row);
        chain_by_errors(sink, own, j, place, 6, e, moved.R, before.Q, frame[j].p, &frame[k], 1.0);
        before = chain_frame(machine, joint);
        moved = frame[j];
        if (!machine->prismatic[joint]) {
            real sine, cosine;
            FN(sincos)(joint_value(machine, joint, at->theta, drive), &sine, &cosine);
            FN(arm_turned)(frame[j].R, sine, cosine, moved.R);
        }
    }
    if (machine->ball[l]) {
        real R[9], p[3], zero[6] = {fill(0.0), fill(0.0), fill(0.0), fill(0.0), fill(0.0), fill(0.0)};
        const motion home = fill_motion(machine->home), still = unmoved();
        motion turned;
        chain_by_errors(sink, own, k, machine->ball_place[l], 3, zero, moved.R, before.Q, frame[k].p,
                        &frame[k], 1.0);
        FN(map_frame)(machine->map, at->state, R, p);
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                turned.R[3 * i + j] = R[3 * i] * home.R[3 * j] + R[3 * i + 1] * home.R[3 * j + 1]
                                      + R[3 * i + 2] * home.R[3 * j + 2];
        chain_by_errors(sink, own, k + 1, machine->end_place[l], 3, zero, turned.R, still.R, frame[k].p,
                        &frame[k], -1.0);
    } else { /* of the end: about its point as the chain has the platform, C T_home⁻¹ */
        const motion home = fill_motion(machine->home), still = unmoved();
        motion back, carried;
        real point[3];
        FN(motion_invert)(home.R, home.p, back.R, back.p);
        carried = composed(&frame[k], &back);
        for (int i = 0; i < 6; i++)
            e[i] = chain_number(of->geometry, of->stride, machine->end_place[l] + i, row);
        for (int i = 0; i < 3; i++) {
            point[i] = carried.p[i];
            for (int j = 0; j < 3; j++)
                point[i] += carried.R[3 * i + j] * (machine->end[3 * l + j] + e[j]);
        }
        chain_by_errors(sink, own, k, machine->end_place[l], 6, e, carried.R, still.R, point, &frame[k],
                        -1.0);
    }
    for (int j = 0; j < k; j++) {
        const int joint = machine->member[first + j], a = machine->actuator[joint];
        real twist[6];
        if (a < 0) continue;
        const int offset = sink->at[machine->drive_place[a]], gain = sink->at[machine->drive_place[a] + 1];
        const real unit = fill(machine->prismatic[joint] ? 1.0 : machine->length);
        chain_twist(machine, joint, &frame[j], &frame[k], twist);
        if (offset >= 0) chain_drop(sink, own, j + 1, twist, unit, offset);
        if (gain >= 0) chain_drop(sink, own, j + 1, twist, unit * lane_q[a], gain);
    }
}

/* How the pose answers unknowns of the scaled steps, their `count` columns x (unknowns x count) each
 * scaled by -1: (6 x count). */
INLINE void chain_answer_to(const pkm_chains *machine, const chain_state *at, int twists, mask good,
                            int count, const real *x, real *answer)
{
    for (int r = 0; r < count; r++) {
        real step[6], rates[6];
        for (int j = 0; j < map_m(machine->map); j++)
            step[j] = -x[j * count + r] * (map_is_angle(machine->map, j) ? 1.0 / machine->length : 1.0);
        if (twists) map_twist(machine->map, at->state, step, rates);
        else map_rates(machine->map, at->state, step, rates);
        for (int k = 0; k < 6; k++) answer[k * count + r] = select(good, rates[k], fill(NAN));
    }
}

/* The columns of all numbers where the chains close exactly: by the rows that they leave. Returns the
 * lanes where they are known. */
SHARED mask chain_by_rows(chain_sink *sink, const chain_geometry *of, const chain_numbers *numbers,
                          const ptrdiff_t *row, const chain_state *at, const real *drive,
                          const real *lane_q, int twists, mask good)
{
    const pkm_chains *machine = sink->machine;
    const int unknowns = map_m(machine->map) + machine->shared;
    real phi[PKM_MAX_CHAIN_ROWS], jac[PKM_MAX_CHAIN_ROWS * MAX_CHAIN_UNKNOWNS], worst, flat, pivot;
    real A[MAX_CHAIN_UNKNOWNS * MAX_CHAIN_UNKNOWNS], X[MAX_CHAIN_UNKNOWNS * PKM_MAX_CHAIN_ROWS];
    real answer[6 * PKM_MAX_CHAIN_ROWS];
    chain_view view[PKM_MAX_LIMBS];
    const int rows = chain_views(machine, numbers, at, drive, view, phi, jac, &worst, &flat);
    normal_matrix(unknowns, rows, jac, A);
    normal_sides(unknowns, rows, jac, X);
    solve(unknowns, rows, A, X, &pivot);
    good &= (pivot > fill(LEAST_PIVOT)) & (flat < fill(1.0 / LEAST_COLUMN));
    chain_answer_to(machine, at, twists, good, rows, X, answer);
    sink->answer = answer, sink->all = rows;
    for (int l = 0, r = 0; l < machine->chains; r += view[l].rows - view[l].own, l++) {
        const chain_of own = {l, r, &view[l], NULL};
        chain_by_numbers(sink, &own, of, numbers, row, at, drive, lane_q);
    }
    return good;
}

/* The same where they contradict each other: by their balance. The state goes to where they rest. */
SHARED mask chain_by_balance(chain_sink *sink, const chain_geometry *of, const chain_numbers *numbers,
                             const ptrdiff_t *row, chain_state *at, const real *drive,
                             const real *lane_q, int twists, mask good)
{
    const pkm_chains *machine = sink->machine;
    const int m = map_m(machine->map), unknowns = m + machine->shared;
    real R[9], p[3], twist[36], all[MAX_CHAIN_UNKNOWNS * MAX_CHAIN_UNKNOWNS], pivot;
    real X[MAX_CHAIN_UNKNOWNS * MAX_CHAIN_UNKNOWNS], answer[6 * MAX_CHAIN_UNKNOWNS];
    real iterations = fill(0.0), missed = fill(INFINITY);
    mask known = fill_mask(0);
    chain_balance rest;
    good &= chain_iterate(machine, numbers, drive, MAX_ITERATIONS, good, at, &known, &iterations,
                          &missed);
    good &= known & (missed <= fill(machine->closure_tolerance));
    FN(map_frame)(machine->map, at->state, R, p);
    for (int j = 0; j < m; j++) {
        real step[6];
        for (int i = 0; i < m; i++) step[i] = fill(i == j ? 1.0 : 0.0);
        if (map_is_angle(machine->map, j)) step[j] *= 1.0 / machine->length;
        map_twist(machine->map, at->state, step, twist + 6 * j);
    }
    for (int i = 0; i < unknowns * unknowns; i++) {
        all[i] = fill(0.0);
        X[i] = fill(i % (unknowns + 1) ? 0.0 : 1.0);
    }
    for (int l = 0; l < machine->chains; l++)
        chain_rest(machine, l, numbers, at, drive, R, p, twist, &rest, all);
    solve(unknowns, unknowns, all, X, &pivot);
    chain_answer_to(machine, at, twists, good, unknowns, X, answer);
    sink->answer = answer, sink->all = unknowns;
    for (int l = 0; l < machine->chains; l++) {
        const chain_of own = {l, 0, NULL, &rest}; /* looked at again: all at once are too much for a stack */
        chain_rest(machine, l, numbers, at, drive, R, p, twist, &rest, all);
        chain_by_numbers(sink, &own, of, numbers, row, at, drive, lane_q);
    }
    return good;
}

int CALL(chain_response)(const pkm_chains *machine, ptrdiff_t n, const double *geometry,
                         ptrdiff_t geometry_stride, const double *pose, const double *q,
                         const int32_t *column, int columns, int twists, double *jacobian)
{
    enum { WIDEST = 6 * PKM_MAX_NUMBERS };
    if (!pkm_chain_count(machine)) return PKM_BAD_MACHINE;
    if (columns < 0 || columns > (column ? machine->numbers : machine->actuators)) return PKM_BAD_COLUMN;
    int16_t place[PKM_MAX_NUMBERS];
    for (int k = 0; k < PKM_MAX_NUMBERS; k++) place[k] = -1;
    for (int c = 0; column && c < columns; c++) {
        if (column[c] < 0 || column[c] >= machine->numbers || place[column[c]] >= 0)
            return PKM_BAD_COLUMN; /* a number has one column */
        place[column[c]] = (int16_t)c;
    }
    for (int a = 0; !column && a < columns; a++) place[machine->drive_place[a]] = (int16_t)a;
    const chain_geometry of = {machine, geometry, geometry_stride};
    chain_numbers numbers;
    real out[WIDEST];
    EACH_BLOCK(first, n, row, count) {
        real lane_q[PKM_MAX_LIMBS], drive[PKM_MAX_LIMBS];
        chain_state at;
        chain_prepare(&of, first, row, &numbers);
        mask held;
        mask good = chain_inspect(machine, &numbers, pose, q, row, lane_q, drive, &at, &held) & held;
        for (int k = 0; k < 6 * columns; k++) out[k] = fill(0.0);
        chain_sink sink = {machine, NULL, 0, columns, place, out};
        if (machine->over)
            good = chain_by_balance(&sink, &of, &numbers, row, &at, drive, lane_q, twists, good);
        else
            good = chain_by_rows(&sink, &of, &numbers, row, &at, drive, lane_q, twists, good);
        for (int a = 0; !column && a < columns; a++)
            for (int k = 0; k < 6; k++) out[k * columns + a] *= numbers.gain[a];
        const real zero = select(good, fill(0.0), fill(NAN));
        for (int k = 0; k < 6 * columns; k++) out[k] += zero;
        scatter_row(out, 6 * columns, jacobian, 6 * columns, row, count);
    }
    return 0;
}

#endif
