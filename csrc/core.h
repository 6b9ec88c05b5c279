/* One ISA's core: every function of the flat interface at LANES rows at a time.
 *
 * core_base.c, core_v3.c and core_v4.c each include this with their own LANES and CORE.
 */
#include "core_table.h"
#include "forward.h"
#include "inverse.h"
#include "jacobian.h"
#include "tpr2tps.h"

static void core_inverse(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                  ptrdiff_t geometry_stride, const double *pose, double *q)
{
    inverse_rows(machine, n, geometry, geometry_stride, pose, q);
}

static void core_forward(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                  ptrdiff_t geometry_stride, const double *q, const double *guess,
                  ptrdiff_t guess_stride, double *pose, int32_t *status, int32_t *iterations,
                  double *residual)
{
    switch (machine->map) {
#define CASE(NAME, name, M)                                                                       \
    case MAP_##NAME:                                                                              \
        forward_map(MAP_##NAME, machine, n, geometry, geometry_stride, q, guess, guess_stride,    \
                    pose, status, iterations, residual);                                          \
        break;
        EACH_MAP(CASE)
#undef CASE
    }
}

static void core_jacobian(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                   ptrdiff_t geometry_stride, const double *pose, double *jacobian)
{
    switch (machine->map) {
#define CASE(NAME, name, M)                                                                       \
    case MAP_##NAME:                                                                              \
        jacobian_map(MAP_##NAME, machine, n, geometry, geometry_stride, pose, jacobian);          \
        break;
        EACH_MAP(CASE)
#undef CASE
    }
}

static void core_response(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                   ptrdiff_t geometry_stride, const double *pose, const double *q,
                   const int32_t *column, int columns, double *jacobian)
{
    switch (machine->map) {
#define CASE(NAME, name, M)                                                                       \
    case MAP_##NAME:                                                                              \
        response_map(MAP_##NAME, machine, n, geometry, geometry_stride, pose, q, column, columns, \
                     jacobian);                                                                   \
        break;
        EACH_MAP(CASE)
#undef CASE
    }
}

static void core_tpr2tps(ptrdiff_t n, const double *size, const double *free, double *lengths,
                  double *jacobian)
{
    real lane_size[6];
    for (int k = 0; k < 6; k++) lane_size[k] = FN(fill)(size[k]);
    for (ptrdiff_t row = 0; row < n; row += LANES) {
        const ptrdiff_t rows = n - row;
        real lane_free[4], out[16];
        for (int k = 0; k < 4; k++) lane_free[k] = gather(free + 4 * row + k, 4, rows);
        if (lengths) {
            FN(tpr2tps_lengths)(lane_size, lane_free, out);
            for (int k = 0; k < 4; k++) scatter(out[k], lengths + 4 * row + k, 4, rows);
        } else {
            FN(tpr2tps_jacobian)(lane_size, lane_free, out);
            for (int k = 0; k < 16; k++) scatter(out[k], jacobian + 16 * row + k, 16, rows);
        }
    }
}

const pkm_core CORE = {core_inverse, core_forward, core_jacobian, core_response, core_tpr2tps};
