/* The calls of machines of chains (see chain_system.h, chain_newton.h and chain_alone.h). */
#ifndef CHAIN_CALLS_H
#define CHAIN_CALLS_H

#include "chain_alone.h"

typedef struct {
    const pkm_chains *machine;
    const double *geometry;
    ptrdiff_t stride;
} chain_geometry;

/* The numbers of chains for the block of rows from `first` on: once where all rows share them. */
INLINE void chain_prepare(const chain_geometry *of, ptrdiff_t first, const ptrdiff_t *row,
                          chain_numbers *numbers)
{
    if (first == 0 || of->stride) prepare_chains(of->machine, of->geometry, of->stride, row, numbers);
}

#define AT_HOME 0.1  /* rad, of the length: passive joints so near those of home are of its posture */
#define POSTURE 2e-4 /* of the size: actuators that are farther from those of a posture may be another's */
#define LIKELY 0.2   /* of that way: what the other then misses at most, where the way is wide, */
#define WIDE 0.1     /* of the size; less in proportion where it is shorter, for errors of the geometry
                        move actuators too, and a universal joint turned over may miss less by chance */
#define AGREED 1e-9  /* of the size: what chains miss that agree on the joints they share */

/* How far passive joints are from home, and drives from those asked for, mm. */
INLINE void chain_way(const pkm_chains *machine, const real *theta, const real *from, const real *to,
                      real *moved, real *way)
{
    *moved = *way = fill(0.0);
    for (int j = 0; j < machine->joints; j++) {
        const int a = machine->actuator[j], c = machine->coordinate[j];
        const double arm = machine->prismatic[j] ? 1.0 : machine->length;
        real off = a < 0 ? theta[c] : to[a] - from[a];
        if (a < 0) *moved = larger(*moved, absolute(off) * arm);
        else if (!machine->prismatic[j]) off = nearest_turn(off, fill(0.0), fill(TWO_PI));
        if (a >= 0) *way = larger(*way, absolute(off) * arm);
    }
}

INLINE void chain_choose(const pkm_chains *machine, mask taken, const real *theta, const real *drive,
                         real *to_theta, real *to_drive)
{
    for (int c = 0; c < machine->passive; c++) to_theta[c] = select(taken, theta[c], to_theta[c]);
    for (int a = 0; a < machine->actuators; a++) to_drive[a] = select(taken, drive[a], to_drive[a]);
}

/* The tail of a guess at the drives asked for: with the platform where it is at home the tool is carried
 * along, any other tool says where the platform is. */
SHARED void chain_turn_tail(const pkm_chains *machine, const chain_numbers *numbers, const real *R,
                            const real *p, const real *to, mask other, chain_state *at, real *from,
                            mask *good)
{
    real theta[PKM_MAX_JOINTS], drive[PKM_MAX_LIMBS], pose[6], state[MAX_STATE] = {0};
    motion frame[PKM_MAX_CHAIN + 1];
    memcpy(drive, to, sizeof(real) * machine->actuators);
    const mask fine = chains_assembled(machine, numbers, R, p, NULL, 0, theta, drive);
    chain_choose(machine, other, theta, drive, at->theta, from);
    *good = select_mask(other, fine, *good);
    for (int a = machine->tail; a < machine->actuators; a++) from[a] = to[a];
    chain_walk(machine, 0, numbers, at->theta, from, frame);
    const motion *end = &frame[machine->first[1] - machine->first[0]];
    FN(motion_pose)(end->R, end->p, pose);
    map_from_pose(machine->map, pose, state);
    for (int s = 0; s < MAX_STATE; s++) at->state[s] = select(other, at->state[s], state[s]);
}

/* Where to begin: the state of a guess and the drives that lead there; `doubt`, whether other drives may
 * be meant, and another state, `second`, which is with those asked for where `likely`. */
typedef struct {
    chain_state at, second;
    real from[PKM_MAX_LIMBS];
    mask doubt, likely;
} chain_start;

/* A guess: the pose, its passive joints, and the drives that lead there. Of chains that have several
 * postures at the pose it is that which is found from home, or, where none is, that with the drives that
 * are asked for, `to`. Where those of the first are far from them, others may be meant; where the chains
 * nearly close with these, they are `likely`. What is no number is as at home. Returns where `to` may
 * matter: not at home. */
SHARED mask chain_guess(const pkm_chains *machine, const chain_numbers *numbers, const real *pose,
                        const real *to, chain_start *start)
{
    real R[9], p[3], drive[PKM_MAX_LIMBS], missed, moved, way;
    chain_state *at = &start->at;
    map_from_pose(machine->map, pose, at->state);
    FN(map_frame)(machine->map, at->state, R, p);
    for (int a = 0; a < machine->actuators; a++) start->from[a] = fill(0.0);
    mask good = chains_assembled(machine, numbers, R, p, NULL, 0, at->theta, start->from);
    chain_way(machine, at->theta, start->from, to, &moved, &way);
    const mask other = ~(good & (moved <= AT_HOME * machine->length));
    if (machine->tail < machine->actuators) {
        chain_turn_tail(machine, numbers, R, p, to, other, at, start->from, &good);
        chain_way(machine, at->theta, start->from, to, &moved, &way);
    }
    const mask far = ~(good & (way <= POSTURE * machine->size));
    start->doubt = other & far & good;
    if (machine->shared) { /* one by one they may have a joint in two places */
        const real apart = chains_miss(machine, numbers, R, p, 0, at->theta, start->from);
        start->doubt |= good & ~(apart <= fill(AGREED * machine->size));
    }
    start->likely = fill_mask(0);
    if (any(other & far)) {
        memcpy(drive, to, sizeof(real) * machine->actuators);
        start->second = *at;
        chains_assembled(machine, numbers, R, p, &missed, 1, start->second.theta, drive);
        const real wide = larger(way, fill(WIDE * machine->size));
        start->likely = start->doubt & (missed * wide <= LIKELY * way * way);
        chain_choose(machine, other & far & ~good, start->second.theta, to, at->theta, start->from);
    }
    for (int c = 0; c < machine->passive; c++)
        at->theta[c] = select(is_finite(at->theta[c]), at->theta[c], fill(0.0));
    for (int a = 0; a < machine->actuators; a++)
        start->from[a] = select(is_finite(start->from[a]), start->from[a], fill(0.0));
    return machine->tail < machine->actuators ? fill_mask(-1) : other;
}

/* One block of forward kinematics: Newton from the guess, then, for what that does not solve, the
 * same in parts of the way there. */
SHARED void chain_solve(const pkm_chains *machine, const chain_numbers *numbers,
                        const chain_state *guess, const chain_prediction *start, const real *from,
                        const real *to, mask usable, chain_state *at, mask *status, real *iterations,
                        real *residual)
{
    mask known = fill_mask(0), solved;
    *at = *guess;
    *iterations = fill(1.0);
    *residual = fill(INFINITY);
    chain_begin(machine, start, from, to, usable, at);
    solved = chain_iterate(machine, numbers, to, MAX_ITERATIONS / 2, usable, at, &known, iterations,
                           residual);
    const mask again = usable & ~solved;
    if (any(again)) {
        chain_state path = *guess;
        chain_prediction next = *start;
        real begin[PKM_MAX_LIMBS], end[PKM_MAX_LIMBS];
        mask there = fill_mask(0), sure = fill_mask(0);
        real missed = fill(INFINITY);
        memcpy(begin, from, sizeof begin);
        for (int part = 1; part <= PATH_PARTS; part++) {
            const double share = (double)part / PATH_PARTS;
            for (int a = 0; a < machine->actuators; a++)
                end[a] = part == PATH_PARTS ? to[a] : from[a] + share * (to[a] - from[a]);
            if (part > 1) chain_predict(machine, numbers, &path, begin, &next);
            chain_begin(machine, &next, begin, end, again, &path);
            there = chain_iterate(machine, numbers, end,
                                  part == PATH_PARTS ? MAX_ITERATIONS / 2 : PATH_STEPS, again, &path,
                                  &sure, iterations, &missed);
            memcpy(begin, end, sizeof begin);
        }
        for (int s = 0; s < MAX_STATE; s++) at->state[s] = select(there, path.state[s], at->state[s]);
        for (int c = 0; c < machine->passive; c++)
            at->theta[c] = select(there, path.theta[c], at->theta[c]);
        *residual = select(there, missed, *residual);
        known = select_mask(there, sure, known);
        solved |= there;
    }
    const mask flat = ~known | (*residual <= fill(CHAIN_CLOSED * machine->size));
    *status = select_mask(flat, fill_mask(PKM_SINGULAR), fill_mask(PKM_NOT_CONVERGED));
    *status = select_mask(solved, fill_mask(PKM_OK), *status);
    if (machine->over) {
        const mask open = solved & ~(*residual <= fill(machine->closure_tolerance));
        *status = select_mask(open, fill_mask(PKM_NOT_CLOSED), *status);
    }
}

/* How far two states of the platform are apart, a turning as its arc. */
SHARED real states_apart(const pkm_chains *machine, const real *one, const real *other)
{
    real R[2][9], p[2][3], apart = fill(0.0);
    FN(map_frame)(machine->map, one, R[0], p[0]);
    FN(map_frame)(machine->map, other, R[1], p[1]);
    for (int i = 0; i < 9; i++) apart = larger(apart, machine->length * absolute(R[0][i] - R[1][i]));
    for (int i = 0; i < 3; i++) apart = larger(apart, absolute(p[0][i] - p[1][i]));
    return apart;
}

/* What a row comes to. */
typedef struct {
    chain_state at;
    mask status;
    real iterations, residual;
} chain_answer;

/* From another state, and of both answers the one that is nearer to the guess. */
SHARED void chain_solve_again(const pkm_chains *machine, const chain_numbers *numbers,
                              const chain_state *guess, const chain_state *other_start,
                              const real *from, const real *to, mask doubt, chain_answer *found)
{
    chain_prediction start;
    chain_answer other;
    chain_predict(machine, numbers, other_start, from, &start);
    chain_solve(machine, numbers, other_start, &start, from, to, doubt, &other.at, &other.status,
                &other.iterations, &other.residual);
    const mask ok = fill_mask(PKM_OK);
    const mask nearer = states_apart(machine, other.at.state, guess->state)
                        < states_apart(machine, found->at.state, guess->state);
    const mask taken = doubt & (other.status == ok) & (nearer | (found->status != ok));
    for (int s = 0; s < MAX_STATE; s++)
        found->at.state[s] = select(taken, other.at.state[s], found->at.state[s]);
    for (int c = 0; c < machine->passive; c++)
        found->at.theta[c] = select(taken, other.at.theta[c], found->at.theta[c]);
    found->status = select_mask(taken, other.status, found->status);
    found->iterations = select(doubt, found->iterations + other.iterations, found->iterations);
    found->residual = select(taken, other.residual, found->residual);
}

/* Whole turns are no way to go. */
INLINE void chain_unwind(const pkm_chains *machine, const real *from, real *drive)
{
    for (int j = 0; j < machine->joints; j++) {
        const int a = machine->actuator[j];
        if (a >= 0 && !machine->prismatic[j])
            drive[a] = nearest_turn(drive[a], from[a], fill(TWO_PI));
    }
}

/* The same where a guess leaves doubt: with the drives asked for, or, if chains do not nearly close
 * with them at the guess, from home. */
SHARED void chain_settle_doubt(const pkm_chains *machine, const chain_numbers *numbers,
                               const chain_start *start, const real *to, mask valid,
                               chain_answer *found)
{
    const mask likely = start->likely & valid, other = start->doubt & ~start->likely & valid;
    if (any(likely))
        chain_solve_again(machine, numbers, &start->at, &start->second, to, to, likely, found);
    if (!any(other)) return;
    const motion frame = fill_motion(machine->home);
    chain_start home;
    real pose[6], drive[PKM_MAX_LIMBS];
    memcpy(drive, to, sizeof(real) * machine->actuators);
    FN(motion_pose)(frame.R, frame.p, pose);
    chain_guess(machine, numbers, pose, drive, &home);
    const mask lost = other & (states_apart(machine, start->at.state, home.at.state) > fill(0.0));
    if (!any(lost)) return;
    chain_unwind(machine, home.from, drive);
    chain_solve_again(machine, numbers, &start->at, &home.at, home.from, drive, lost, found);
}

/* Are the drives such as a machine can be at? Angles beyond these have lost digits, and so have their
 * turns. */
INLINE mask chain_within(const pkm_chains *machine, const real *drive)
{
    mask within = fill_mask(-1);
    for (int j = 0; j < machine->joints; j++) {
        const double most = machine->prismatic[j] ? 1e30 : MAX_ANGLE;
        if (machine->actuator[j] >= 0) within &= absolute(drive[machine->actuator[j]]) <= fill(most);
    }
    return within;
}

int CALL(chain_forward)(const pkm_chains *machine, ptrdiff_t n, const double *geometry,
                        ptrdiff_t geometry_stride, const double *q, const double *guess,
                        ptrdiff_t guess_stride, double *pose, int32_t *status, int32_t *iterations,
                        double *residual)
{
    if (!pkm_chain_count(machine)) return PKM_BAD_MACHINE;
    const chain_geometry of = {machine, geometry, geometry_stride};
    chain_numbers numbers;
    chain_start start = {0};
    chain_prediction predicted;
    int own = 0; /* is what follows of the guess each row's own? */
    EACH_BLOCK(first, n, row, count) {
        real lane_q[PKM_MAX_LIMBS], drive[PKM_MAX_LIMBS], begin[6], found[6];
        chain_answer answer;
        mask valid = fill_mask(-1);
        chain_prepare(&of, first, row, &numbers);
        gather_row(q, machine->actuators, machine->actuators, row, lane_q);
        gather_row(guess, guess_stride, 6, row, begin);
        chain_drives(machine, &numbers, lane_q, drive);
        if (first == 0 || geometry_stride || guess_stride || own) {
            own = any(chain_guess(machine, &numbers, begin, drive, &start));
            chain_predict(machine, &numbers, &start.at, start.from, &predicted);
        }
        const mask within = chain_within(machine, drive);
        chain_unwind(machine, start.from, drive);
        for (int a = 0; a < machine->actuators; a++) valid &= is_finite(lane_q[a]);
        for (int k = 0; k < 6; k++) valid &= is_finite(begin[k]);
        for (int k = 0; geometry_stride && k < machine->numbers; k++)
            valid &= is_finite(gather(geometry + k, geometry_stride, row));
        const mask usable = valid & within;
        chain_solve(machine, &numbers, &start.at, &predicted, start.from, drive, usable, &answer.at,
                    &answer.status, &answer.iterations, &answer.residual);
        chain_settle_doubt(machine, &numbers, &start, drive, usable, &answer);
        mask how = select_mask(within, answer.status, fill_mask(PKM_INFEASIBLE));
        how = select_mask(valid, how, fill_mask(PKM_INVALID));
        const mask good = how == fill_mask(PKM_OK), closest = good | (how == fill_mask(PKM_NOT_CLOSED));
        map_to_pose(machine->map, answer.at.state, found);
        for (int k = 0; k < 6; k++) found[k] = select(good, found[k], fill(NAN));
        scatter_row(found, 6, pose, 6, row, count);
        scatter(select(closest, answer.residual, fill(NAN)), residual, 1, row, count);
        for (int l = 0; l < count; l++) {
            status[row[l]] = (int32_t)how[l];
            iterations[row[l]] = (int32_t)answer.iterations[l];
        }
    }
    return 0;
}

int CALL(chain_inverse)(const pkm_chains *machine, ptrdiff_t n, const double *geometry,
                        ptrdiff_t geometry_stride, const double *pose, double *q)
{
    if (!pkm_chain_count(machine)) return PKM_BAD_MACHINE;
    const chain_geometry of = {machine, geometry, geometry_stride};
    chain_numbers numbers;
    EACH_BLOCK(first, n, row, count) {
        real lane_pose[6], R[9], p[3], drive[PKM_MAX_LIMBS], theta[PKM_MAX_JOINTS];
        chain_prepare(&of, first, row, &numbers);
        gather_row(pose, 6, 6, row, lane_pose);
        FN(pose_frame)(lane_pose, R, p);
        for (int a = machine->tail; a < machine->actuators; a++) drive[a] = fill(0.0);
        const mask good = chains_assembled(machine, &numbers, R, p, NULL, 0, theta, drive);
        for (int a = 0; a < machine->actuators; a++) {
            drive[a] = (drive[a] + machine->zero[a] - numbers.offset[a]) / numbers.gain[a];
            drive[a] = select(good, drive[a], fill(NAN));
        }
        whole_or_nan(drive, machine->actuators);
        scatter_row(drive, machine->actuators, q, machine->actuators, row, count);
    }
    return 0;
}

#define HELD 1e-4 /* of the size: a chain that misses by more is not where its pose and actuators say */

/* Where chains one by one do not agree on a joint that they share: the passive joints with which Newton's
 * method rests at the pose, from there or from home. */
SHARED void chain_agree(const pkm_chains *machine, const chain_numbers *numbers, real *pose,
                        const real *R, const real *p, const real *drive, chain_state *at, real *missed)
{
    const motion home = fill_motion(machine->home);
    for (int attempt = 0; attempt < 2; attempt++) {
        const mask open = ~(*missed <= fill(AGREED * machine->size)) & is_finite(pose[0]);
        chain_start start;
        chain_answer answer = {.status = fill_mask(PKM_NOT_CONVERGED)};
        real to[PKM_MAX_LIMBS];
        if (!any(open)) return;
        if (attempt) FN(motion_pose)(home.R, home.p, pose);
        memcpy(to, drive, sizeof(real) * machine->actuators);
        chain_guess(machine, numbers, pose, to, &start);
        chain_unwind(machine, start.from, to);
        chain_solve_again(machine, numbers, &start.at, &start.at, start.from, to, open, &answer);
        const real misses = chains_miss(machine, numbers, R, p, 0, answer.at.theta, drive);
        const mask better = open & (answer.status == fill_mask(PKM_OK)) & ~(misses >= *missed);
        chain_choose(machine, better, answer.at.theta, drive, at->theta, to);
        *missed = select(better, misses, *missed);
    }
}

/* What inspection starts from: a block of poses and coordinates, with the passive joints there; `held`
 * says where these are found. */
INLINE mask chain_inspect(const pkm_chains *machine, const chain_numbers *numbers,
                          const double *pose, const double *q, const ptrdiff_t *row, real *lane_q,
                          real *drive, chain_state *at, mask *held)
{
    real lane_pose[6], R[9], p[3];
    gather_row(pose, 6, 6, row, lane_pose);
    gather_row(q, machine->actuators, machine->actuators, row, lane_q);
    map_from_pose(machine->map, lane_pose, at->state);
    FN(map_frame)(machine->map, at->state, R, p);
    chain_drives(machine, numbers, lane_q, drive);
    real missed;
    mask good = chains_assembled(machine, numbers, R, p, &missed, 0, at->theta, drive);
    if (machine->shared) {
        chain_agree(machine, numbers, lane_pose, R, p, drive, at, &missed);
        good |= missed <= fill(HELD * machine->size);
    }
    *held = machine->over ? fill_mask(-1) : missed <= fill(HELD * machine->size);
    return good;
}

int CALL(chain_frames)(const pkm_chains *machine, ptrdiff_t n, const double *geometry,
                       ptrdiff_t geometry_stride, const double *pose, const double *q,
                       double *passive, double *frames)
{
    if (!pkm_chain_count(machine)) return PKM_BAD_MACHINE;
    const chain_geometry of = {machine, geometry, geometry_stride};
    const int width = 12 * (machine->first[machine->chains] + machine->chains);
    chain_numbers numbers;
    EACH_BLOCK(first, n, row, count) {
        real lane_q[PKM_MAX_LIMBS], drive[PKM_MAX_LIMBS];
        chain_state at;
        chain_prepare(&of, first, row, &numbers);
        mask held;
        const mask good = chain_inspect(machine, &numbers, pose, q, row, lane_q, drive, &at, &held);
        const real zero = select(good & held, fill(0.0), fill(NAN));
        for (int c = 0; c < machine->passive; c++) at.theta[c] += zero;
        scatter_row(at.theta, machine->passive, passive, machine->passive, row, count);
        for (int l = 0; l < machine->chains; l++) {
            motion frame[PKM_MAX_CHAIN + 1];
            chain_walk(machine, l, &numbers, at.theta, drive, frame);
            for (int j = 0; j <= machine->first[l + 1] - machine->first[l]; j++) {
                double *to = frames + 12 * (machine->first[l] + l + j);
                for (int i = 0; i < 9; i++) frame[j].R[i] += zero;
                for (int i = 0; i < 3; i++) frame[j].p[i] += zero;
                scatter_row(frame[j].R, 9, to, width, row, count);
                scatter_row(frame[j].p, 3, to + 9, width, row, count);
            }
        }
    }
    return 0;
}

#endif
