/* Machines of chains for abi.c: as they are mostly made, or with counts, places and kinds of anything. */
#ifndef ABI_CHAINS_H
#define ABI_CHAINS_H

typedef struct {
    pkm_chains is;
    int32_t first[PKM_MAX_LIMBS + 1], member[PKM_MAX_LIMBS * PKM_MAX_CHAIN], ball[PKM_MAX_LIMBS];
    int32_t end_place[PKM_MAX_LIMBS], ball_place[PKM_MAX_LIMBS], drive_place[PKM_MAX_LIMBS];
    int32_t prismatic[PKM_MAX_JOINTS], actuator[PKM_MAX_JOINTS], coordinate[PKM_MAX_JOINTS];
    int32_t place[PKM_MAX_JOINTS];
} chain_arrays;

static int places(chain_arrays *made, int count)
{
    const int at = made->is.numbers;
    made->is.numbers += count;
    return at;
}

/* A joint of a chain: an actuator's, or the coordinate that follows. */
static int chain_joint(chain_arrays *made, int driven)
{
    const int joint = made->is.joints++;
    driven = driven && made->is.actuators < PKM_MAX_LIMBS;
    made->prismatic[joint] = byte() < 60;
    made->actuator[joint] = driven ? made->is.actuators : -1;
    made->coordinate[joint] = driven ? -1 : made->is.passive++;
    made->place[joint] = places(made, 6);
    if (driven) made->drive_place[made->is.actuators++] = places(made, 2);
    return joint;
}

/* Chains of a machine that may close: each with an actuator, and what it leaves is about one row. */
static void likely_chains(chain_arrays *made)
{
    static const int maps[] = {MAP_SPATIAL, MAP_PLANAR, MAP_SPHERICAL};
    pkm_chains *is = &made->is;
    is->map = maps[byte() % 3];
    const int group = is->map == MAP_SPATIAL ? 6 : 3;
    const int chains = byte() < 200 ? group : 1 + (int)byte() % 7, sharing = byte() < 80;
    int common = -1;
    if (sharing) common = chain_joint(made, 0), is->shared = 1;
    for (int l = 0; l < chains; l++) {
        const int ball = group == 6 && byte() < 80, most = ball ? 3 : group;
        const int own = most - 1 - (byte() > 200), at = (int)byte() % (own + 1);
        int end = made->first[l];
        made->ball[l] = ball;
        if (sharing && byte() < 200) made->member[end++] = common;
        for (int j = 0; j <= own; j++)
            if (end - made->first[l] < PKM_MAX_CHAIN && is->joints < PKM_MAX_JOINTS)
                made->member[end++] = chain_joint(made, j == at || byte() > 250);
        made->end_place[l] = places(made, ball ? 3 : 6);
        made->ball_place[l] = ball ? places(made, 3) : 0;
        made->first[l + 1] = end;
    }
    is->chains = chains;
    is->tail = is->actuators;
    if (byte() > 240 && is->actuators > 1) is->tail -= 1;
}

/* One field that says something else. */
static void spoil(chain_arrays *made)
{
    pkm_chains *is = &made->is;
    int *const counts[] = {&is->map, &is->chains, &is->joints, &is->actuators, &is->passive, &is->shared,
                           &is->numbers, &is->tail, &is->over};
    int32_t *const arrays[] = {made->first, made->member, made->ball, made->end_place, made->ball_place,
                               made->drive_place, made->prismatic, made->actuator, made->coordinate,
                               made->place};
    const unsigned which = byte(), entry = byte() % PKM_MAX_LIMBS, count = byte() & 1;
    const int says = small(80);
    if (count) *counts[which % 9] = says;
    else arrays[which % 10][entry] = says;
}

static int within(int count, int most) { return count < 0 || count > most ? 0 : count; }

static const int32_t *copied(const int32_t *from, int count)
{
    int32_t *made = fresh(sizeof(int32_t) * (size_t)count);
    memcpy(made, from, sizeof(int32_t) * (size_t)count);
    return made;
}

/* Arrays to the byte, as long as the counts say; where those are none, nothing may be read. */
static void some_chains(chain_arrays *made, unsigned strange)
{
    pkm_chains *is = &made->is;
    memset(made, 0, sizeof *made);
    likely_chains(made);
    for (int times = byte() < 190 ? 0 : 1 + (int)byte() % 3; times--;) spoil(made);
    const int chains = within(is->chains, PKM_MAX_LIMBS), joints = within(is->joints, PKM_MAX_JOINTS);
    const int actuators = within(is->actuators, PKM_MAX_LIMBS);
    const int members = chains ? within(made->first[chains], PKM_MAX_LIMBS * PKM_MAX_CHAIN) : 0;
    double *axes = numbers(9 * joints, strange), *soft = numbers(joints, strange);
    for (int j = 0; j < joints; j++) {
        const unsigned kind = byte();
        for (int k = 0; k < 9 && kind < 240; k++)
            axes[9 * j + k] = (double)(k % 3 == (k / 3 + (int)kind) % 3);
        if (kind < 240) soft[j] = 1.0;
    }
    is->size = is->length = 100.0, is->closure_tolerance = 1e-7;
    if (byte() > 240) is->size = number(strange), is->length = number(strange);
    for (int k = 0; k < 9; k++) is->home[k] = k % 4 == 0;
    for (int k = 9; k < 12; k++) is->home[k] = number(strange);
    is->over |= byte() > 230;
    is->first = copied(made->first, chains + 1), is->member = copied(made->member, members);
    is->ball = copied(made->ball, chains), is->end_place = copied(made->end_place, chains);
    is->ball_place = copied(made->ball_place, chains);
    is->prismatic = copied(made->prismatic, joints), is->actuator = copied(made->actuator, joints);
    is->coordinate = copied(made->coordinate, joints), is->place = copied(made->place, joints);
    is->drive_place = copied(made->drive_place, actuators);
    is->axes = axes, is->soft = soft, is->end = numbers(3 * chains, strange);
    is->point = numbers(3 * joints, strange), is->zero = numbers(actuators, strange);
}

/* What a passive joint is at home is 0, and gains are 1: as machines mostly are. */
static double *chain_geometry(const chain_arrays *made, ptrdiff_t rows, int count, unsigned strange)
{
    double *geometry = numbers(rows * count, strange);
    const int usual = byte() < 220;
    for (ptrdiff_t i = 0; usual && i < rows * count; i++) geometry[i] = 0.0;
    for (ptrdiff_t i = 0; usual && i < rows; i++)
        for (int a = 0; a < made->is.actuators; a++)
            geometry[i * count + made->is.drive_place[a] + 1] = 1.0;
    return geometry;
}

static void of_chains(ptrdiff_t n, unsigned strange, int isas)
{
    chain_arrays made;
    some_chains(&made, strange);
    const pkm_chains *is = &made.is;
    const int rows = pkm_chain_count(is), count = rows ? is->numbers : 0;
    const ptrdiff_t q = rows ? is->actuators : 0, m = rows ? map_free(is->map) : 0;
    const ptrdiff_t members = rows ? is->first[is->chains] + is->chains : 0;
    const ptrdiff_t step = rows ? m + is->shared : 0, passive = rows ? is->passive : 0;
    n = n % 3; /* a row may be sought from two dozen postures */
    const ptrdiff_t stride = byte() & 1 ? count : 0, some = byte() & 1 ? 6 : 0;
    double *geometry = rows ? chain_geometry(&made, n + 1, count, strange) : fresh(0);
    double *pose = numbers(6 * n, strange), *guess = numbers(6 * n + 6, strange);
    double *drives = numbers(q * n, strange);
    const int near = byte() < 244; /* home, where chains close: elsewhere dozens of postures are tried */
    for (ptrdiff_t i = 0; i < n && near; i++) {
        for (int k = 0; k < 6; k++)
            pose[6 * i + k] = k < 3 ? is->home[9 + k] + 0.01 * number(0) : 1e-4 * number(0);
        for (ptrdiff_t a = 0; a < q; a++) drives[q * i + a] = is->zero[a] + 1e-3 * number(0);
    }
    if (near) memcpy(guess, pose, sizeof(double) * (size_t)(6 * n));
    for (int k = 0; near && k < 6; k++) guess[6 * n + k] = k < 3 ? is->home[9 + k] : 0.0;
    if (near && !some) memcpy(guess, guess + 6 * n, 6 * sizeof(double));
    int32_t column[8];
    for (int k = 0, at = 0; k < 8; k++) {
        at += 1 + (int)byte() % 8;
        column[k] = (int32_t)(byte() < 250 ? at : (int)bits());
    }
    const int twists = byte() & 1;
    one_of(6);
    EACH_ISA(chain_forward, is, n, geometry, stride, drives, guess, some, D(0, 6 * n), I(1, n), I(2, n),
             D(3, n));
    EACH_ISA(chain_inverse, is, n, geometry, stride, pose, D(0, n * q));
    EACH_ISA(chain_closure, is, n, geometry, stride, pose, drives, D(0, n * rows), D(1, n * rows * step),
             D(2, n * rows * m), D(3, n * rows * q), D(4, 6 * n), D(5, 6 * n * m));
    EACH_ISA(chain_response, is, n, geometry, stride, pose, drives, column, 8, twists, D(0, 6 * n * 8));
    EACH_ISA(chain_response, is, n, geometry, stride, pose, drives, NULL, (int)q, twists,
             D(0, 6 * n * q));
    EACH_ISA(chain_frames, is, n, geometry, stride, pose, drives, D(0, n * passive), D(1, 12 * n * members));
}

#endif
