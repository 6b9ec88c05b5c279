/* Chains that contradict each other rest where their joints' yielding balances: with the wrench
 * u = C⁻¹ r of each chain, C its compliance, x·u is 0 of every passive joint's column x, and so is the
 * sum over chains of every step of the platform. How that point moves: whatever moves a chain behind a
 * joint turns and shifts what is there rigidly, its columns and its joints with their compliance.
 */
#ifndef CHAIN_BALANCE_H
#define CHAIN_BALANCE_H

#include "chain_calls.h"

enum { MAX_BALANCE = PKM_MAX_CHAIN + MAX_CHAIN_UNKNOWNS };

/* A chain at rest. What its balance consists of: its own passive joints, the map's steps, and what
 * chains share. Twists are hybrid, turns as arcs. */
typedef struct {
    int own, rows, joints, size;    /* size: own and all unknowns of the machine */
    motion frame[PKM_MAX_CHAIN + 1];
    real r[6], lever[3], L[6][6];
    real u[6];
    int passive, at[PKM_MAX_CHAIN], to[PKM_MAX_CHAIN]; /* which joints are, and what they balance */
    real column[PKM_MAX_CHAIN][6], by_turn[PKM_MAX_CHAIN][3], by_shift[PKM_MAX_CHAIN][3];
    const real *turns;              /* of the platform by the map's steps, (ω, v) */
    real step[6][6];                /* their twist; of its ball */
    real by_end[9], by_platform[9];
    real taken[6][MAX_CHAIN_UNKNOWNS]; /* what the own joints' balance takes from the others' */
} chain_balance;

/* Rows that close in their places among all six; the reverse of chain_cut. */
INLINE void chain_lift(const pkm_chains *machine, int l, const real *cut, real *out)
{
    const int *which, rows = group_rows(machine->map, &which);
    for (int i = 0; i < 6; i++) out[i] = fill(0.0);
    if (machine->ball[l])
        for (int i = 0; i < 3; i++) out[3 + i] = cut[i];
    else
        for (int i = 0; i < rows; i++) out[which[i]] = cut[i];
}

/* The wrench C⁻¹ x, x all six rows of a change of r. */
INLINE void chain_wrench(const pkm_chains *machine, int l, chain_balance *rest, const real *x, real *u)
{
    real cut[6];
    chain_cut(machine, l, x, cut);
    divide_by(rest->rows, rest->L, cut);
    divide_by_transposed(rest->rows, rest->L, cut);
    chain_lift(machine, l, cut, u);
}

/* How the balance changes with the wrench. */
INLINE void balance_by_wrench(const pkm_chains *machine, const chain_balance *rest, const real *u,
                              real *out)
{
    for (int i = 0; i < rest->size; i++) out[i] = fill(0.0);
    for (int c = 0; c < rest->passive; c++) out[rest->to[c]] = products(0, 6, rest->column[c], u);
    for (int j = 0; j < map_m(machine->map); j++) out[rest->own + j] = products(0, 6, rest->step[j], u);
}

/* How the balance of steps changes where the lever of the platform's ball does. */
INLINE void balance_by_lever(const pkm_chains *machine, const chain_balance *rest, const real *lever,
                             real *out)
{
    real moved[3];
    for (int j = 0; j < map_m(machine->map); j++) {
        cross(rest->turns + 6 * j, lever, moved);
        out[rest->own + j] += products(0, 3, moved, rest->u + 3);
    }
}

/* How the balance changes where a twist moves the chain from joint `from` on, and its end; beyond the
 * end it moves the platform's ball back, and the chain not at all. */
SHARED void balance_by_twist(const pkm_chains *machine, int l, chain_balance *rest, int from,
                             const real *twist, real *out)
{
    const double inverse_length = 1.0 / machine->length;
    const int first = machine->first[l];
    const int of_chain = from <= rest->joints;
    const motion *end = &rest->frame[rest->joints];
    real change[6], du[6], w[3];
    for (int i = 0; i < 3; i++) {
        w[i] = twist[i] * inverse_length;
        change[i] = products(0, 3, rest->by_end + 3 * i, twist);
        change[3 + i] = twist[3 + i];
    }
    for (int n = 0; of_chain && n < rest->joints; n++) { /* what yields is elsewhere, beside the end */
        real d[3], moved[3], bent[6];
        for (int i = 0; i < 3; i++) d[i] = (end->p[i] - rest->frame[n].p[i]) * inverse_length;
        if (n >= from) cross(w, d, moved);
        else
            for (int i = 0; i < 3; i++) moved[i] = twist[3 + i] * inverse_length;
        FN(chain_bend)(d, moved, rest->u, bent);
        for (int i = 0; i < 6; i++) change[i] -= machine->soft[machine->member[first + n]] * bent[i];
    }
    chain_wrench(machine, l, rest, change, du);
    balance_by_wrench(machine, rest, du, out);
    for (int c = 0; of_chain && c < rest->passive; c++)
        out[rest->to[c]] += rest->at[c] >= from ? products(0, 3, w, rest->by_turn[c])
                                                : products(0, 3, twist + 3, rest->by_shift[c]);
    if (of_chain) return;
    for (int i = 0; i < 3; i++) w[i] = -twist[3 + i];
    balance_by_lever(machine, rest, w, out);
}

/* How the balance changes with step j of the map. */
INLINE void balance_by_step(const pkm_chains *machine, int l, chain_balance *rest, int j, real *out)
{
    real change[6], du[6], moved[3];
    for (int i = 0; i < 3; i++) {
        change[i] = products(0, 3, rest->by_platform + 3 * i, rest->step[j]);
        change[3 + i] = -rest->step[j][3 + i];
    }
    chain_wrench(machine, l, rest, change, du);
    balance_by_wrench(machine, rest, du, out);
    if (!machine->ball[l]) return;
    cross(rest->turns + 6 * j, rest->lever, moved);
    balance_by_lever(machine, rest, moved, out);
}

/* Chain l at a state at rest, and what its balance, its own joints taken out, adds to that of all:
 * `all` (unknowns x unknowns). `twist` are those of the platform by steps, (ω, v), scaled. */
SHARED void chain_rest(const pkm_chains *machine, int l, const chain_numbers *numbers,
                       const chain_state *at, const real *drive, const real *R, const real *p,
                       const real *twist, chain_balance *rest, real *all)
{
    const int m = map_m(machine->map), unknowns = m + machine->shared, first = machine->first[l];
    chain_view view;
    real by[MAX_BALANCE][MAX_BALANCE], A[36], B[6 * MAX_CHAIN_UNKNOWNS], pivot;
    chain_look(machine, l, numbers, at->theta, drive, R, p, &view);
    rest->turns = twist;
    rest->own = view.own, rest->rows = view.rows, rest->size = view.own + unknowns;
    rest->joints = machine->first[l + 1] - first;
    memcpy(rest->L, view.L, sizeof rest->L);
    memcpy(rest->lever, view.lever, sizeof rest->lever);
    chain_walk(machine, l, numbers, at->theta, drive, rest->frame);
    const motion *end = &rest->frame[rest->joints];
    for (int i = 0; i < 9; i++) rest->by_end[i] = rest->by_platform[i] = fill(0.0);
    if (!machine->ball[l]) FN(chain_turned)(end->R, R, rest->by_end, rest->by_platform);
    chain_lift(machine, l, view.r, rest->r);
    chain_wrench(machine, l, rest, rest->r, rest->u);
    for (int j = 0; j < m; j++) chain_met(machine, l, rest->lever, twist + 6 * j, rest->step[j]);
    rest->passive = 0;
    for (int j = 0, own = 0; j < rest->joints; j++) {
        const int joint = machine->member[first + j], c = rest->passive;
        if (machine->actuator[joint] >= 0) continue;
        const int coordinate = machine->coordinate[joint];
        rest->at[c] = j;
        rest->to[c] = coordinate < machine->shared ? rest->own + m + coordinate : own++;
        chain_twist(machine, joint, &rest->frame[j], end, rest->column[c]);
        FN(chain_pairing)(rest->column[c], rest->u, fill(machine->length), rest->by_turn[c],
                          rest->by_shift[c]);
        rest->passive++;
    }
    for (int i = 0; i < rest->size; i++)
        for (int k = 0; k < rest->size; k++) by[i][k] = fill(0.0);
    for (int c = 0; c < rest->passive; c++)
        balance_by_twist(machine, l, rest, rest->at[c] + 1, rest->column[c], by[rest->to[c]]);
    for (int j = 0; j < m; j++) balance_by_step(machine, l, rest, j, by[rest->own + j]);
    for (int i = 0; i < rest->own; i++) { /* by[k][i]: of balance i by k */
        for (int k = 0; k < rest->own; k++) A[i * rest->own + k] = by[i][k];
        for (int s = 0; s < unknowns; s++) B[i * unknowns + s] = by[i][rest->own + s];
    }
    solve(rest->own, unknowns, A, B, &pivot);
    for (int i = 0; i < rest->own; i++)
        for (int s = 0; s < unknowns; s++) rest->taken[i][s] = B[i * unknowns + s];
    for (int s = 0; s < unknowns; s++)
        for (int k = 0; k < unknowns; k++) {
            const real *column = by[rest->own + k];
            real sum = column[rest->own + s];
            for (int i = 0; i < rest->own; i++) sum -= rest->taken[i][s] * column[i];
            all[s * unknowns + k] += sum;
        }
}

#endif
