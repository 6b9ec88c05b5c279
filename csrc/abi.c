/* What needs no lanes: names, the best ISA, checks of what calls are given, and small loops. */
#include "pkmcal.h"
#ifdef __x86_64__
#include <cpuid.h>
#endif

enum { MOST_PARTICLES = 1 << 24 }; /* and dimensions: the size of their state is a number of 64 bits */

const char *pkm_slot_names(void) { return SLOT_NAMES; }
const char *pkm_axis_names(void) { return AXIS_NAMES; }
const char *pkm_driver_names(void) { return DRIVER_NAMES; }
const char *pkm_row_names(void) { return ROW_NAMES; }
const char *pkm_map_names(void) { return MAP_NAMES; }
const char *pkm_map_free(void) { return MAP_FREE; }
const char *pkm_row_calls(void) { return ROW_CALLS; }
int pkm_state_size(void) { return MAX_STATE; }

#ifdef __x86_64__
/* What x86-64-v3 and x86-64-v4 add, as the bits that the instruction cpuid gives: of its leaf 1 (ecx),
 * its leaf 7 (ebx) and its leaf 0x80000001 (ecx). Asked for here and not by __builtin_cpu_supports, for
 * which some toolchains link a table that nobody fills: every processor is then the oldest. */
enum { LEAF_1 = bit_FMA | bit_MOVBE | bit_F16C | bit_OSXSAVE | bit_AVX, LEAF_7 = bit_AVX2 | bit_BMI | bit_BMI2 };
#define LEAF_7_WIDE ((unsigned)(bit_AVX512F | bit_AVX512DQ | bit_AVX512BW | bit_AVX512CD) | bit_AVX512VL)
enum { HALVES = 0x06, WHOLE = 0xe0 }; /* of XCR0: registers of 256 and of 512 bits, which the system saves */

static int has(unsigned word, unsigned bits) { return (word & bits) == bits; }

int pkm_best_isa(void)
{
    unsigned a, b, leaf_1, d, leaf_7, c, more, saved;
    if (!__get_cpuid(1, &a, &b, &leaf_1, &d) || !has(leaf_1, LEAF_1)) return 0;
    if (!__get_cpuid_count(7, 0, &a, &leaf_7, &c, &d) || !has(leaf_7, LEAF_7)) return 0;
    if (!__get_cpuid(0x80000001, &a, &b, &more, &d) || !has(more, bit_LZCNT)) return 0;
    __asm__("xgetbv" : "=a"(saved), "=d"(d) : "c"(0));
    if (!has(saved, HALVES)) return 0;
#ifdef __APPLE__
    saved |= WHOLE; /* from the first use on */
#endif
    return has(leaf_7, LEAF_7_WIDE) && has(saved, WHOLE) ? 2 : 1;
}
#else
int pkm_best_isa(void) { return 0; }
#endif

static int free_coordinates(const pkm_machine *machine)
{
#define CASE(NAME, name, M, ...) if (machine->map == MAP_##NAME) return M;
    EACH_MAP(CASE)
#undef CASE
    return 0;
}

int pkm_closure_count(const pkm_machine *machine)
{
    const int free = free_coordinates(machine);
    int rows = 0;
    if (!free || machine->limbs < 1 || machine->limbs > PKM_MAX_LIMBS || !(machine->length > 0)
        || machine->actuators < 1 || machine->actuators > machine->limbs)
        return 0;
    for (int i = 0; i < machine->limbs; i++) {
        if (machine->driver[i] < 0 || machine->driver[i] >= DRIVERS || machine->actuator[i] < 0
            || machine->actuator[i] >= machine->actuators || machine->rows[i] & ~ALL_ROWS)
            return 0;
        rows += 1 + __builtin_popcount((unsigned)machine->rows[i]);
    }
    return rows >= free && rows <= PKM_MAX_ROWS ? rows : 0;
}

int pkm_prepared(const pkm_machine *machine)
{
    _Static_assert(PKM_MAX_ROWS < 64, "rows are bits of a word");
    const int rows = pkm_closure_count(machine);
    uint64_t seen = 0; /* PKM_MAX_ROWS bits */
    for (int r = 0; r < rows; r++) {
        if (machine->order[r] < 0 || machine->order[r] >= rows) return 0;
        seen |= UINT64_C(1) << machine->order[r];
    }
    return seen == (UINT64_C(1) << rows) - 1 ? rows : 0;
}

/* Which of its kinds a joint of a chain is: of an actuator, passive and shared, passive and its own. */
static int chain_joint_fits(const pkm_chains *machine, int joint)
{
    const int a = machine->actuator[joint], c = machine->coordinate[joint], place = machine->place[joint];
    return a >= -1 && a < machine->actuators && c >= -1 && c < machine->passive && (a < 0) != (c < 0)
           && place >= 0 && place <= machine->numbers - 6;
}

/* The rows that chain l leaves, or -1; counts in `uses` in how many chains each joint is. */
static int chain_rows_left(const pkm_chains *machine, int l, int *uses)
{
    const int ball = machine->ball[l] != 0, group = machine->map == MAP_SPATIAL ? 6 : 3;
    const int first = machine->first[l], end = machine->first[l + 1], of_end = ball ? 3 : 6;
    int rows = ball ? 3 : group;
    uint8_t here[PKM_MAX_JOINTS] = {0};
    if (ball && group != 6) return -1;
    if (machine->end_place[l] < 0 || machine->end_place[l] > machine->numbers - of_end) return -1;
    if (ball && (machine->ball_place[l] < 0 || machine->ball_place[l] > machine->numbers - 3)) return -1;
    for (int j = first; j < end; j++) {
        const int joint = machine->member[j];
        if (joint < 0 || joint >= machine->joints || here[joint]++) return -1;
        uses[joint]++;
        rows -= machine->coordinate[joint] >= machine->shared;
    }
    return rows;
}

int pkm_chain_count(const pkm_chains *machine)
{
    const int free = machine->map == MAP_SPATIAL ? 6 : 3;
    int rows = 0, uses[PKM_MAX_JOINTS] = {0}, moved[PKM_MAX_LIMBS] = {0}, of[PKM_MAX_JOINTS] = {0};
    if ((machine->map != MAP_SPATIAL && machine->map != MAP_PLANAR && machine->map != MAP_SPHERICAL)
        || machine->chains < 1 || machine->chains > PKM_MAX_LIMBS || machine->joints < 1
        || machine->joints > PKM_MAX_JOINTS || machine->actuators < 1
        || machine->actuators > PKM_MAX_LIMBS || machine->tail < 1
        || machine->tail > machine->actuators || machine->passive < 0
        || machine->passive > machine->joints || machine->shared < 0
        || machine->shared > PKM_MAX_SHARED || machine->shared > machine->passive
        || machine->numbers < 1 || machine->numbers > PKM_MAX_NUMBERS || !(machine->length > 0)
        || machine->first[0] != 0)
        return 0;
    for (int l = 0; l < machine->chains; l++) {
        const int64_t k = (int64_t)machine->first[l + 1] - machine->first[l];
        if (k < 1 || k > PKM_MAX_CHAIN) return 0;
    }
    for (int j = 0; j < machine->joints; j++) {
        if (!chain_joint_fits(machine, j)) return 0;
        if (machine->actuator[j] >= 0) moved[machine->actuator[j]]++;
        else if (of[machine->coordinate[j]]++) return 0;
    }
    for (int a = 0; a < machine->actuators; a++)
        if (!moved[a] || machine->drive_place[a] < 0 || machine->drive_place[a] > machine->numbers - 2)
            return 0;
    for (int l = 0; l < machine->chains; l++) {
        const int left = chain_rows_left(machine, l, uses);
        if (left < 0) return 0;
        rows += left;
    }
    for (int j = 0; j < machine->joints; j++)
        if (!uses[j] || (machine->coordinate[j] >= machine->shared && uses[j] > 1)) return 0;
    return rows <= PKM_MAX_CHAIN_ROWS && rows >= free + machine->shared ? rows : 0;
}

ptrdiff_t pkm_swarm_size(const pkm_swarm *swarm)
{
    const ptrdiff_t width = ((ptrdiff_t)swarm->particles + 7) / 8 * 8, dims = swarm->dims;
    if (swarm->particles < 1 || dims < 1) return 0;
    if (swarm->particles > MOST_PARTICLES || dims > MOST_PARTICLES) return 0;
    return (3 * dims + 6) * width + dims + 1;
}

int pkm_with_errors(ptrdiff_t n, int k, const double *error, const int32_t *place, ptrdiff_t size,
                    const double *ideal, double *out)
{
    for (int j = 0; j < k; j++)
        if (place[j] < 0 || place[j] >= size) return PKM_BAD_COLUMN;
    for (ptrdiff_t i = 0; i < n; i++)
        for (int j = 0; j < k; j++) out[i * size + place[j]] = ideal[place[j]] + error[i * k + j];
    return 0;
}
