/* What needs no lanes: names, the best ISA, checks of what calls are given, and small loops. */
#include "pkmcal.h"

enum { MOST_PARTICLES = 1 << 24 }; /* and dimensions: the size of their state is a number of 64 bits */

const char *pkm_slot_names(void) { return SLOT_NAMES; }
const char *pkm_axis_names(void) { return AXIS_NAMES; }
const char *pkm_driver_names(void) { return DRIVER_NAMES; }
const char *pkm_row_names(void) { return ROW_NAMES; }
const char *pkm_map_names(void) { return MAP_NAMES; }
const char *pkm_map_free(void) { return MAP_FREE; }
const char *pkm_row_calls(void) { return ROW_CALLS; }
int pkm_state_size(void) { return MAX_STATE; }

int pkm_best_isa(void)
{
#ifdef __x86_64__
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq")
        && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512cd")
        && __builtin_cpu_supports("avx512vl"))
        return 2;
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")
        && __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2"))
        return 1;
#endif
    return 0;
}

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

int pkm_count(int k, ptrdiff_t n, const double *value, const double *low, const double *width,
              int bins, int64_t *count)
{
    for (int j = 0; j < k; j++, value += n, count += bins + 2)
        for (ptrdiff_t i = 0; i < n; i++) {
            const double place = (value[i] - low[j]) / width[j] + 1.0;
            const double most = bins + 1.0;
            count[place >= most ? bins + 1 : place >= 0.0 ? (ptrdiff_t)place : 0]++;
        }
    return 0;
}
