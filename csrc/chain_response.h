/* Derivatives of machines of chains: of their rows, and of the pose by actuators and errors. */
#ifndef CHAIN_RESPONSE_H
#define CHAIN_RESPONSE_H

#include "chain_calls.h"

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
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_q[PKM_MAX_LIMBS], drive[PKM_MAX_LIMBS], worst, flat;
        real phi[PKM_MAX_CHAIN_ROWS], jacobian[PKM_MAX_CHAIN_ROWS * MAX_CHAIN_UNKNOWNS];
        chain_view view[PKM_MAX_LIMBS];
        chain_state at;
        const int count = block_rows(first, n, row);
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

/* Where the errors of a chain's numbers go: the answer of the pose to rows is `answer` (6 x all). */
typedef struct {
    const pkm_chains *machine;
    const real *answer;
    int all, columns;
    const int16_t *at; /* the column of a place, or -1 */
    real *out;
} chain_sink;

INLINE void chain_drop(const chain_sink *sink, const chain_view *view, int first_row, int column,
                       const real *change)
{
    real rows[6];
    chain_pull(view, change, rows);
    for (int n = 0; n < view->rows - view->own; n++)
        for (int k = 0; k < 6; k++)
            sink->out[k * sink->columns + column] += sink->answer[k * sink->all + first_row + n] * rows[n];
}

/* By the first `count` errors at `place` of a joint at `at`, the joint before moved from axes Qa to Qx. */
SHARED void chain_by_errors(const chain_sink *sink, int l, const chain_view *view, int first_row,
                            int place, int count, const real *e, const real *Qx, const real *Qa,
                            const real *at, const motion *end, double sign)
{
    real along[9], turn[9], moment[9];
    FN(arm_error_twists)(Qx, Qa, at, e, along, turn, moment);
    for (int i = 0; i < count; i++) {
        const int column = sink->at[place + i];
        real twist[6], change[6];
        if (column < 0) continue;
        for (int k = 0; k < 3; k++) twist[k] = i < 3 ? fill(0.0) : turn[3 * (i - 3) + k];
        FN(chain_turn)(twist, at, end->p, twist + 3);
        for (int k = 0; k < 3; k++) {
            if (i < 3) twist[3 + k] = along[3 * i + k];
            twist[k] *= sign * sink->machine->length;
            twist[3 + k] *= sign;
        }
        chain_cut(sink->machine, l, twist, change);
        chain_drop(sink, view, first_row, column, change);
    }
}

SHARED void chain_by_numbers(const chain_sink *sink, int l, const chain_geometry *of,
                             const chain_numbers *numbers, const ptrdiff_t *row, const chain_state *at,
                             const real *drive, const real *lane_q, const chain_view *view,
                             int first_row)
{
    const pkm_chains *machine = sink->machine;
    const int first = machine->first[l], k = machine->first[l + 1] - first;
    motion frame[PKM_MAX_CHAIN + 1], moved = unmoved();
    joint_frame before = {{{0}}, {{0}}};
    real e[6], change[6];
    chain_walk(machine, l, numbers, at->theta, drive, frame);
    before.Q[0] = before.Q[4] = before.Q[8] = fill(1.0);
    for (int j = 0; j < k; j++) {
        const int joint = machine->member[first + j], place = machine->place[joint];
        for (int i = 0; i < 6; i++) e[i] = chain_number(of->geometry, of->stride, place + i, row);
        chain_by_errors(sink, l, view, first_row, place, 6, e, moved.R, before.Q, frame[j].p, &frame[k],
                        1.0);
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
        chain_by_errors(sink, l, view, first_row, machine->ball_place[l], 3, zero, moved.R, before.Q,
                        frame[k].p, &frame[k], 1.0);
        FN(map_frame)(machine->map, at->state, R, p);
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                turned.R[3 * i + j] = R[3 * i] * home.R[3 * j] + R[3 * i + 1] * home.R[3 * j + 1]
                                      + R[3 * i + 2] * home.R[3 * j + 2];
        chain_by_errors(sink, l, view, first_row, machine->end_place[l], 3, zero, turned.R, still.R,
                        frame[k].p, &frame[k], -1.0);
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
        chain_by_errors(sink, l, view, first_row, machine->end_place[l], 6, e, carried.R, still.R, point,
                        &frame[k], -1.0);
    }
    for (int a = 0; a < machine->actuators; a++) {
        const int offset = sink->at[machine->drive_place[a]], gain = sink->at[machine->drive_place[a] + 1];
        if ((offset < 0 && gain < 0) || !chain_by_drive(machine, l, frame, a, change)) continue;
        if (offset >= 0) chain_drop(sink, view, first_row, offset, change);
        for (int i = 0; i < 6; i++) change[i] *= lane_q[a];
        if (gain >= 0) chain_drop(sink, view, first_row, gain, change);
    }
}

int CALL(chain_response)(const pkm_chains *machine, ptrdiff_t n, const double *geometry,
                         ptrdiff_t geometry_stride, const double *pose, const double *q,
                         const int32_t *column, int columns, int twists, double *jacobian)
{
    enum { WIDEST = 6 * PKM_MAX_NUMBERS };
    const int all = pkm_chain_count(machine), m = map_m(machine->map), unknowns = m + machine->shared;
    if (!all) return PKM_BAD_MACHINE;
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
    for (ptrdiff_t first = 0; first < n; first += LANES) {
        ptrdiff_t row[LANES];
        real lane_q[PKM_MAX_LIMBS], drive[PKM_MAX_LIMBS], worst, flat, pivot;
        real phi[PKM_MAX_CHAIN_ROWS], jac[PKM_MAX_CHAIN_ROWS * MAX_CHAIN_UNKNOWNS];
        real A[MAX_CHAIN_UNKNOWNS * MAX_CHAIN_UNKNOWNS], X[MAX_CHAIN_UNKNOWNS * PKM_MAX_CHAIN_ROWS];
        real answer[6 * PKM_MAX_CHAIN_ROWS];
        chain_view view[PKM_MAX_LIMBS];
        chain_state at;
        const int count = block_rows(first, n, row);
        chain_prepare(&of, first, row, &numbers);
        mask held;
        mask good = chain_inspect(machine, &numbers, pose, q, row, lane_q, drive, &at, &held) & held;
        const int rows = chain_views(machine, &numbers, &at, drive, view, phi, jac, &worst, &flat);
        normal_matrix(unknowns, rows, jac, A);
        normal_sides(unknowns, rows, jac, X);
        solve(unknowns, rows, A, X, &pivot);
        if (rows > unknowns) pivot = FN(root)(pivot);
        good &= (pivot > fill(LEAST_PIVOT)) & (flat < fill(1.0 / LEAST_COLUMN));
        for (int r = 0; r < rows; r++) {
            real step[6], rates[6];
            for (int j = 0; j < m; j++)
                step[j] = -X[j * rows + r] * (map_is_angle(machine->map, j) ? 1.0 / machine->length : 1.0);
            if (twists) map_twist(machine->map, at.state, step, rates);
            else map_rates(machine->map, at.state, step, rates);
            for (int k = 0; k < 6; k++) answer[k * rows + r] = select(good, rates[k], fill(NAN));
        }
        for (int k = 0; k < 6 * columns; k++) out[k] = fill(0.0);
        const chain_sink sink = {machine, answer, rows, columns, place, out};
        for (int l = 0, r = 0; l < machine->chains; r += view[l].rows - view[l].own, l++)
            chain_by_numbers(&sink, l, &of, &numbers, row, &at, drive, lane_q, &view[l], r);
        for (int a = 0; !column && a < columns; a++)
            for (int k = 0; k < 6; k++) out[k * columns + a] *= numbers.gain[a];
        const real zero = select(good, fill(0.0), fill(NAN));
        for (int k = 0; k < 6 * columns; k++) out[k] += zero;
        scatter_row(out, 6 * columns, jacobian, 6 * columns, row, count);
    }
    return 0;
}

#endif
