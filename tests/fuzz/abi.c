/* Every call of the C interface with a machine, chains, a swarm or an arm and rows made of arbitrary bytes.
 *
 * What a caller owes is kept: arrays are as long as calls.h says, to the byte, so that the address
 * sanitizer sees what is read or written beyond. What the numbers are, and what the structs say, is
 * free. Each call either refuses, and has then written nothing, or gives the same bits with every ISA
 * of this processor. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pkmcal.h"

enum { FEW_ROWS = 9, MOST_ROWS = 24, ARRAYS = 16, ISAS = 3 };

static struct {
    const uint8_t *at, *end;
    uint64_t noise;
    int choice, wanted, call;
} in;

static uint64_t bits(void)
{
    in.noise ^= in.noise << 13, in.noise ^= in.noise >> 7, in.noise ^= in.noise << 17;
    return in.noise;
}

/* What follows the end of an input is chance, without the values that stand for what is seldom. */
static unsigned byte(void) { return in.at < in.end ? *in.at++ : (unsigned)(bits() >> 32) % 240; }

static double any_double(void)
{
    uint64_t word = bits();
    double number;
    memcpy(&number, &word, sizeof number);
    return number;
}

/* An input is for one of the calls of a group. */
static void one_of(int calls)
{
    in.wanted = in.choice % calls;
    in.call = 0;
}

/* Numbers as machines have them, with some that no machine has. */
static double number(unsigned strange)
{
    static const double odd[] = {0.0, -0.0, NAN, INFINITY, -INFINITY, 1e308, -1e308, 5e-324, 1e-160,
                                 1e160, 1e15, -1e15, 1.0, -1.0, 3.14159265358979312, 1e-9};
    const uint64_t word = bits();
    if (strange && (word & 63) < strange) {
        const unsigned which = word >> 8 & 31;
        return which < 16 ? odd[which] : any_double();
    }
    return ((double)(word >> 11) * 0x1p-53 - 0.5) * (word & 64 ? 1000.0 : 2.0);
}

/* An array of exactly `count` numbers, freed by `forget`. */
static struct {
    void *at[4 * ARRAYS * ISAS];
    int count;
} heap;

static void *fresh(size_t bytes)
{
    void *made = malloc(bytes ? bytes : 1);
    if (!made) abort();
    memset(made, 0xa5, bytes);
    heap.at[heap.count++] = made;
    return made;
}

static void forget(void)
{
    while (heap.count) free(heap.at[--heap.count]);
}

static double *numbers(ptrdiff_t count, unsigned strange)
{
    double *made = fresh(sizeof(double) * (size_t)count);
    for (ptrdiff_t i = 0; i < count; i++) made[i] = number(strange);
    return made;
}

/* Outputs of one call with every ISA, which are compared when it has returned. */
static struct {
    char *of[ISAS][ARRAYS];
    size_t bytes[ARRAYS];
    int code[ISAS], count, written;
} out;

static void *output(int isa, int which, size_t bytes)
{
    out.bytes[which] = bytes;
    out.count = which + 1 > out.count ? which + 1 : out.count;
    return out.of[isa][which] = fresh(bytes);
}

static double *doubles(int isa, int which, ptrdiff_t count)
{
    return output(isa, which, sizeof(double) * (size_t)count);
}

static int32_t *whole(int isa, int which, ptrdiff_t count)
{
    return output(isa, which, sizeof(int32_t) * (size_t)count);
}

static void wrong(const char *call, const char *what)
{
    fprintf(stderr, "%s: %s\n", call, what);
    abort();
}

static uint64_t digest = UINT64_C(14695981039346656037); /* of all outputs so far: see digest.c */

static void digested(const char *bytes, size_t count)
{
    for (size_t b = 0; b < count; b += 8) {
        uint64_t word = 0;
        double x;
        memcpy(&word, bytes + b, count - b < 8 ? count - b : 8), memcpy(&x, &word, 8);
        digest = (digest ^ (isnan(x) ? 1 : word)) * UINT64_C(1099511628211);
    }
}

/* Equal bits, but for which NaN it is: that differs between vector instructions. */
static void compared(const char *call, int isas)
{
    for (int k = 0; k < out.count && out.code[0] >= 0; k++) digested(out.of[0][k], out.bytes[k]);
    for (int i = 0; i < isas; i++) {
        if (out.code[i] != out.code[0]) wrong(call, "another code with another ISA");
        for (int k = 0; k < out.count; k++) {
            const char *first = out.of[0][k], *other = out.of[i][k];
            if (out.code[i] < 0) {
                for (size_t b = 0; b < out.bytes[k]; b++)
                    if (other[b] != (char)0xa5) wrong(call, "written although refused");
                continue;
            }
            if (!memcmp(first, other, out.bytes[k])) continue;
            for (size_t b = 0; b + 8 <= out.bytes[k]; b += 8) {
                double x, y;
                memcpy(&x, first + b, 8), memcpy(&y, other + b, 8);
                if (memcmp(&x, &y, 8) && !(isnan(x) && isnan(y))) {
                    fprintf(stderr, "output %d, number %zu: %a %a\n", k, b / 8, x, y);
                    wrong(call, "other bits with another ISA");
                }
            }
            if (out.bytes[k] % 8) wrong(call, "other whole numbers with another ISA");
        }
    }
    memset(&out, 0, sizeof out);
}

#if defined __x86_64__ && !defined ONE_ISA
#define EACH_ISA(name, ...)                                                                           \
    do {                                                                                          \
        int isa = 0;                                                                              \
        if (in.call++ != in.wanted) break;                                                        \
        out.code[0] = pkm_base_##name(__VA_ARGS__);                                               \
        if (isas > 1) isa = 1, out.code[1] = pkm_avx2_##name(__VA_ARGS__);                        \
        if (isas > 2) isa = 2, out.code[2] = pkm_avx512_##name(__VA_ARGS__);                      \
        compared(#name, isas);                                                                    \
    } while (0)
#else
#define EACH_ISA(name, ...)                                                                           \
    do {                                                                                          \
        int isa = 0;                                                                              \
        if (in.call++ != in.wanted) break;                                                        \
        out.code[0] = pkm_base_##name(__VA_ARGS__);                                               \
        compared(#name, isas);                                                                    \
    } while (0)
#endif
#define D(which, count) doubles(isa, which, count)
#define I(which, count) whole(isa, which, count)

static int map_free(int map)
{
#define CASE(NAME, name, M, ...) if (map == MAP_##NAME) return M;
    EACH_MAP(CASE)
#undef CASE
    return 0;
}

/* A number that is nearly always within [0, most], sometimes anything. */
static int small(int most)
{
    const unsigned found = byte();
    if (found >= 250) return (int)bits();
    return (int)(found % (unsigned)(most + 1));
}

static void some_machine(pkm_machine *machine, unsigned strange)
{
    memset(machine, 0, sizeof *machine);
    machine->map = small(7);
    const int needed = map_free(machine->map), usual = byte() < 200 && needed;
    machine->limbs = usual ? needed + (byte() > 200) : small(PKM_MAX_LIMBS);
    machine->actuators = byte() < 230 ? machine->limbs : small(PKM_MAX_LIMBS);
    machine->size = fabs(number(strange));
    machine->length = fabs(number(strange));
    machine->closure_tolerance = fabs(number(strange));
    for (int i = 0; i < PKM_MAX_LIMBS; i++) {
        machine->driver[i] = small(DRIVERS - 1);
        machine->rows[i] = byte() < 210 ? 0 : small(ALL_ROWS);
        machine->actuator[i] = byte() < 245 ? i : small(PKM_MAX_LIMBS - 1);
        machine->branch[i] = byte() & 1 ? 1.0 : number(strange);
        machine->angle[i] = byte() & 1;
        machine->near[i] = byte() & 1 ? NAN : number(strange);
        machine->lever[i] = number(strange);
        for (int a = 0; a < AXES; a++) { /* three axes at right angles, or anything */
            double *frame = machine->frame + 9 * (AXES * i + a);
            const unsigned kind = byte();
            for (int k = 0; k < 9; k++)
                frame[k] = kind & 64 ? number(strange) : (double)(k % 3 == (k / 3 + (int)kind) % 3);
        }
    }
    for (int r = 0; r < PKM_MAX_ROWS; r++) machine->weight[r] = byte() & 1 ? 1.0 : number(strange);
}

static void of_machine(ptrdiff_t n, unsigned strange, int isas)
{
    pkm_machine machine;
    some_machine(&machine, strange);
    const int limbs = machine.limbs >= 0 && machine.limbs <= PKM_MAX_LIMBS ? machine.limbs : 0;
    const ptrdiff_t size = (ptrdiff_t)limbs * SLOTS, stride = byte() & 1 ? size : 0;
    double *geometry = numbers(n * size + size, strange);
    for (ptrdiff_t i = 0; i < n + 1; i++)
        for (int limb = 0; limb < limbs; limb++)
            if (byte() < 128) { /* as they mostly are */
                double *g = geometry + i * size + (ptrdiff_t)limb * SLOTS;
                for (int slot = OFFSET; slot < SLOTS; slot++)
                    if (slot != ROD && slot != CRANK) g[slot] = slot == GAIN;
            }
    const int code = pkm_prepare(&machine, geometry, numbers(6, strange));
    const int count = pkm_closure_count(&machine), m = map_free(machine.map);
    if ((code < 0) != (count == 0)) wrong("prepare", "a machine refused here and taken there");
    if (byte() > 240) /* not prepared, or spoilt since */
        for (int r = 0; r < PKM_MAX_ROWS; r++) machine.order[r] = small(PKM_MAX_ROWS - 1);
    const ptrdiff_t q = count ? machine.actuators : 0, rows = count;
    const double *pose = numbers(6 * n, strange), *near = byte() & 1 ? numbers(q * n, strange) : NULL;
    const double *guess = numbers(6 * n + 6, strange), *motion = numbers(48 * n, strange);
    const double *q1 = numbers(q * n, strange), *q2 = numbers(q * n, strange);
    double *drives = numbers(q * n, strange);
    const double *places = numbers(2 * q, strange), *starts = numbers(12, strange);
    if (count && byte() & 1) pkm_base_inverse(&machine, n, geometry, stride, pose, NULL, 0, drives);
    const ptrdiff_t some = byte() & 1 ? 6 : 0, about = byte() & 1 ? q : 0;
    int32_t column[8];
    for (int k = 0, at = -1; k < 8; k++) { /* mostly in order, as they are asked for */
        at += 1 + (int)byte() % 12;
        column[k] = (int32_t)(byte() < 250 ? at : (int)bits());
    }
    const pkm_machine *is = &machine;
    const int twists = byte() & 1;
    const double *gives = numbers(8, strange), *pulls = numbers(16, strange);
    const double *rest = numbers(8, strange), *most = numbers(8, strange);
    const int steps = (int)(byte() % 20);
    one_of(15);

    EACH_ISA(inverse, is, n, geometry, stride, pose, near, about, D(0, n * q));
    EACH_ISA(forward, is, n, geometry, stride, drives, guess, some, D(0, 6 * n), I(1, n), I(2, n),
             D(3, n));
    if (stride) {
        EACH_ISA(forward_machines, is, n, geometry, 2, places, starts, D(0, 12 * n), I(1, 2 * n),
                 I(2, 2 * n), D(3, 2 * n));
    }
    EACH_ISA(forward_loaded, is, n, geometry, drives, guess, some, column, 8, gives, 0, pulls, 0, rest,
             most, steps, D(0, 6 * n), I(1, n), I(2, n), D(3, n));
    EACH_ISA(jacobian, is, n, geometry, stride, pose, D(0, n * q * m));
    EACH_ISA(forward_jacobian, is, n, geometry, stride, pose, drives, twists, D(0, 6 * n * q));
    EACH_ISA(error_jacobian, is, n, geometry, stride, pose, drives, column, 8, twists,
             D(0, 6 * n * 8));
    EACH_ISA(closure, is, n, geometry, stride, pose, drives, D(0, n * rows), D(1, n * rows * m),
             D(2, n * rows * m), D(3, n * rows * q), D(4, 6 * n), D(5, 6 * n * m));
    EACH_ISA(readings, is, n, geometry, stride, pose, drives, column, 8, D(0, n * rows),
             D(1, n * rows * m), D(2, n * rows * 8));
    EACH_ISA(moved, is->map, n, pose, guess, D(0, 6 * n), D(1, 6 * n * m));
    EACH_ISA(spheres, is, n, geometry, drives, D(0, n * limbs * PKM_SPHERE));
    EACH_ISA(limbs, is, n, geometry, stride, pose, D(0, n * limbs), D(1, 3 * n * limbs),
             D(2, 3 * n * limbs));
    EACH_ISA(rates, is, n, geometry, stride, motion, D(0, n * q), D(1, n * q));
    EACH_ISA(motion, is, n, geometry, stride, pose, drives, q1, q2, D(0, 48 * n), D(1, 12 * n));
    EACH_ISA(closure_cost, is, n, geometry, n, pose, drives, D(0, n));
}

static void of_path(ptrdiff_t n, unsigned strange)
{
    pkm_machine machine;
    some_machine(&machine, strange);
    const int limbs = machine.limbs >= 0 && machine.limbs <= PKM_MAX_LIMBS ? machine.limbs : 0;
    if (pkm_prepare(&machine, numbers((ptrdiff_t)limbs * SLOTS, strange), numbers(6, strange)) < 0)
        return;
    n = n % 4;
    const ptrdiff_t spheres = 2 * (ptrdiff_t)limbs * PKM_SPHERE;
    double *state = numbers(2 * n * pkm_state_size(), strange);
    const int isa = 0;
    pkm_paths(&machine, n, numbers(spheres, strange), numbers(spheres, strange), state,
              number(strange), D(0, 24 * n), I(1, n), I(2, n), D(3, n));
    memset(&out, 0, sizeof out);
}

static void of_swarm(ptrdiff_t n, unsigned strange, int isas)
{
    pkm_swarm swarm = {small(40), small(9), number(strange), number(strange), number(strange)};
    const ptrdiff_t size = pkm_swarm_size(&swarm), rows = byte() % 5;
    if (size > 4000) return; /* a caller that cannot have the memory */
    const int dims = size ? swarm.dims : 0, iterations = byte() % 6;
    const double *lower = numbers(dims, strange), *upper = numbers(dims, strange);
    const double *begin = numbers(size, strange), *off = numbers(n * rows * dims, strange);
    const uint64_t seed = bits();
    one_of(4);
#define STATE memcpy(doubles(isa, 0, size), begin, sizeof(double) * (size_t)size)
    EACH_ISA(swarm_start, &swarm, seed, lower, upper, D(0, size));
    if (!size) return; /* refused as a whole: what follows has nothing to begin with */
    EACH_ISA(swarm_update_best, &swarm, STATE);
    EACH_ISA(swarm_move, &swarm, lower, upper, STATE);
    const ptrdiff_t first = (ptrdiff_t)(bits() & 0xffff);
    EACH_ISA(swarm_eq18, &swarm, iterations, seed, first, n, rows, off, lower, upper, D(0, size), D(1, n * dims), D(2, n * (iterations + 1)));
}

static void of_arm(ptrdiff_t n, unsigned strange, int isas)
{
    enum { MOST = 9 };
    const int joints = (int)(byte() % MOST) + 1, by_row = byte() & 1, frame = small(2);
    int32_t prismatic[MOST];
    for (int j = 0; j < joints; j++) prismatic[j] = byte() < 128 ? 0 : small(1);
    const pkm_arm arm = {joints, prismatic, numbers(9 * joints, strange), numbers(3 * joints, strange),
                         numbers(16, strange)};
    const double *error = numbers(n * 6 * joints + 6 * joints, strange);
    const double *theta = numbers(n * joints, strange);
    const pkm_links links = {by_row, numbers((n + 1) * (joints + 1) * 12, strange)};
    one_of(4);
    EACH_ISA(arm_links, &arm, n, error, D(0, n * (joints + 1) * 12));
    EACH_ISA(arm_forward, &arm, &links, n, theta, D(0, 16 * n));
    EACH_ISA(arm_jacobian, &arm, &links, frame, n, theta, D(0, 6 * n * joints));
    EACH_ISA(arm_error_jacobian, &arm, &links, error, frame, n, theta, D(0, 36 * n * joints));
}

/* Equations of poses, any number of each, in any order. */
static void of_poses(ptrdiff_t n, unsigned strange, int isas)
{
    enum { MOST = 9 };
    const int u = (int)(byte() % 7) + 1, columns = (int)(byte() % 4);
    int64_t *first = fresh(sizeof *first * (size_t)(n + 1)), *place = fresh(sizeof *place * (size_t)n);
    int64_t left = 0, total = first[0] = 0;
    for (ptrdiff_t i = 0; i < n; i++) {
        const int64_t count = byte() % (MOST + 1);
        place[i] = left, left += count > u ? count - u : 0;
        first[i + 1] = total += count;
    }
    int64_t *order = fresh(sizeof *order * (size_t)total);
    for (int64_t e = 0; e < total; e++) order[e] = (int64_t)(bits() % (uint64_t)total);
    const double *slopes = numbers(total * u, strange), *residual = numbers(total, strange);
    const double *part = numbers(total * columns, strange), *rest = numbers(left * columns, strange);
    const double *damping = numbers(n, strange);
    double *work = fresh(sizeof *work * PKM_WIDEST * (MOST + (size_t)u + 1) * ((size_t)u + 1));
    one_of(5);
    EACH_ISA(pose_triangle, n, u, first, order, slopes, D(0, n * u * u), work);
    EACH_ISA(pose_normals, n, u, first, order, residual, slopes, D(0, n * u * u), D(1, n * u), D(2, n),
             work);
    EACH_ISA(pose_fit, n, u, first, order, residual, slopes, damping, 1e-12, 1e-12, place, D(0, n * u),
             D(1, n), D(2, n), D(3, left), work);
    EACH_ISA(pose_left, n, u, first, order, slopes, columns, part, place, D(0, left * columns),
             D(1, n * u * columns), work);
    EACH_ISA(pose_spread, n, u, first, order, slopes, columns, place, rest, D(0, total * columns), work);
}

#include "abi_chains.h"

/* Calls that are one formula a row. */
static void of_rows(ptrdiff_t n, unsigned strange, int isas)
{
    const double *a = numbers(6 * n + 6, strange), *b = numbers(6 * n + 6, strange);
    const double *c = numbers(6 * n + 6, strange), *motion = numbers(16 * n + 9, strange);
    const ptrdiff_t six = byte() & 1 ? 6 : 0, three = byte() & 1 ? 3 : 0;
    one_of(31);
    EACH_ISA(slider_work, n, a, motion, 0, b, motion, D(0, n), D(1, 16 * n));
    EACH_ISA(crank_work, n, a, motion, 0, b, motion, D(0, n), D(1, 16 * n));
    EACH_ISA(compose, n, a, six, b, 6 - six, D(0, 6 * n));
    EACH_ISA(invert, n, a, D(0, 6 * n));
    EACH_ISA(compose_rates, n, a, b, c, six, a, D(0, 36 * n));
    EACH_ISA(compose_twists, n, a, b, c, D(0, 36 * n));
    EACH_ISA(points, n, a, b, three, D(0, 3 * n), D(1, 18 * n), D(2, 9 * n));
    EACH_ISA(seen_points, n, a, b, D(0, 3 * n), D(1, 18 * n), D(2, 9 * n));
    EACH_ISA(distances, n, a, b, three, c, 3 - three, b, three / 3, D(0, n), D(1, 6 * n), D(2, 3 * n),
             D(3, 3 * n));
    EACH_ISA(pulley, n, a, three, motion, 0, c, D(0, n), D(1, 3 * n), D(2, 3 * n), D(3, 9 * n), D(4, n),
             D(5, 3 * n), D(6, 3 * n));
    EACH_ISA(between, n, a, b, c, three, D(0, n), D(1, 6 * n), D(2, 6 * n), D(3, 3 * n));
    EACH_ISA(touched_points, n, a, six, b, D(0, 3 * n), D(1, 18 * n), D(2, 9 * n));
    EACH_ISA(tilts, n, a, b, three, c, 3 - three, D(0, 2 * n), D(1, 6 * n), D(2, 6 * n), D(3, 6 * n));
    EACH_ISA(pixels, n, a, b, motion, three * 3, c, three / 3, D(0, 2 * n), D(1, 12 * n), D(2, 18 * n),
             D(3, 2 * n), D(4, n));
    EACH_ISA(law_drive, n, a, D(0, n), D(1, 5 * n), D(2, n));
    EACH_ISA(law_drive_inverse, n, a, D(0, n));
    EACH_ISA(law_harmonic, n, a, D(0, n), D(1, 3 * n), D(2, n));
    EACH_ISA(law_segment, n, a, D(0, n), D(1, 3 * n));
    EACH_ISA(strand, n, c, D(0, n), D(1, 3 * n), D(2, 9 * n));
    EACH_ISA(tpr2tps_lengths, n, a, b, D(0, 4 * n));
    EACH_ISA(tpr2tps_jacobian, n, a, b, D(0, 16 * n));
    EACH_ISA(exp, n, a, D(0, 16 * n));
    EACH_ISA(log, n, motion, D(0, 6 * n));
    EACH_ISA(adjoint, n, motion, D(0, 36 * n));
    EACH_ISA(motion_pose, n, motion, D(0, 6 * n));
    EACH_ISA(exp_jacobian, n, a, D(0, 36 * n));
    EACH_ISA(log_jacobian, n, a, D(0, 36 * n));
    EACH_ISA(joint_motions, n, a, b, D(0, 16 * n));
    EACH_ISA(pose_errors, n, a, b, D(0, 7 * n));
    EACH_ISA(stream, 6, n, a, b, c, 8, memset(output(isa, 0, 192), 0, 192), memset(output(isa, 1, 16), 0, 16),
             memset(output(isa, 2, 480), 0, 480));
    const uint64_t seed[32] = {bits(), bits(), bits(), bits()};
    EACH_ISA(normals, 17 * n, memcpy(output(isa, 1, sizeof seed), seed, sizeof seed), D(0, 17 * n));
    int32_t place[8];
    for (int k = 0; k < 8; k++) place[k] = (int32_t)(byte() < 250 ? byte() % 6 : bits());
    pkm_with_errors(n, 6, a, place, 6, b, memcpy(fresh(48 * (size_t)n), a, 48 * (size_t)n));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    in.at = data, in.end = data + size, in.noise = UINT64_C(88172645463325252);
    memset(&out, 0, sizeof out);
    for (int k = 0; k < 4; k++) in.noise = in.noise << 8 ^ in.noise ^ byte();
    if (!in.noise) in.noise = 1;
    const unsigned what = byte(), strange = byte() % 17, rows = byte();
    const ptrdiff_t n = rows % (rows < 200 ? FEW_ROWS + 1 : MOST_ROWS + 1);
    in.choice = (int)byte();
#ifdef ONE_ISA
    const int isas = 1;
#else
    const int isas = pkm_best_isa() + 1;
#endif
    switch (what % 17) {
    case 0: of_path(n, strange); break;
    case 1: of_swarm(n, strange, isas); break;
    case 2: of_arm(n, strange, isas); break;
    case 3:
    case 4: of_rows(n, strange, isas); break;
    case 5: of_chains(n, strange, isas); break; /* seldom: one takes as long as thirty others */
    case 6: of_poses(n, strange, isas); break;
    default: of_machine(n, strange, isas);
    }
    forget();
    return 0;
}
