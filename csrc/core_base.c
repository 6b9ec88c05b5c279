/* The core for any processor: 128-bit lanes; and what is done once for a machine. */
#include "pkmcal.h"
#define LANES 2
#define ISA base
#include "core.h"

/* The closure rows' derivatives at home (rows x m, limb by limb): what pkm_prepare eliminates. */
static int rows_at_home(const pkm_machine *machine, const double *geometry, const double *home,
                        double *jacobian)
{
    limb_numbers limb[PKM_MAX_LIMBS];
    FN(limb_sphere) sphere[PKM_MAX_LIMBS];
    ptrdiff_t zero[LANES] = {0};
    real pose[6], state[MAX_STATE], R[9], p[3], q[PKM_MAX_LIMBS], phi[PKM_MAX_ROWS];
    real A[PKM_MAX_ROWS * 6];
    int rows = 0;
    prepare_limbs(machine, geometry, 0, zero, limb);
    for (int k = 0; k < 6; k++) pose[k] = fill(home[k]);
    switch (machine->map) {
#define CASE(NAME, name, M, ...)                                                                       \
    case MAP_##NAME:                                                                              \
        map_from_pose(MAP_##NAME, pose, state);                                                   \
        FN(map_frame)(MAP_##NAME, state, R, p);                                                   \
        inverse_once(machine, limb, R, p, q);                                                     \
        spheres_at(machine, limb, q, sphere);                                                     \
        rows = scaled_rows(MAP_##NAME, machine, sphere, state, phi, A);                           \
        for (int k = 0; k < rows * M; k++) jacobian[k] = A[k][0];                                 \
        break;
        EACH_MAP(CASE)
#undef CASE
    }
    return rows;
}

int pkm_prepare(pkm_machine *machine, const double *geometry, const double *home)
{
    double A[PKM_MAX_ROWS * 6];
    int row[PKM_MAX_ROWS];
    const int m = map_m(machine->map), rows = pkm_closure_count(machine);
    if (!rows) return PKM_BAD_MACHINE;
    for (int i = 0; i < machine->limbs; i++) machine->sharing[i] = 0.0;
    for (int i = 0; i < machine->limbs; i++) machine->sharing[machine->actuator[i]] += 1.0;
    for (int r = 0; r < rows; r++) machine->order[r] = row[r] = r;
    if (rows > m) return 0; /* the normal equations need no order */
    rows_at_home(machine, geometry, home, A);
    for (int c = 0; c < m; c++) {
        int best = c;
        for (int i = c + 1; i < m; i++)
            if (fabs(A[row[i] * m + c]) > fabs(A[row[best] * m + c])) best = i;
        const int swapped = row[c];
        row[c] = row[best];
        row[best] = swapped;
        for (int i = c + 1; i < m; i++) {
            const double factor = A[row[i] * m + c] / A[row[c] * m + c];
            for (int j = c; j < m; j++) A[row[i] * m + j] -= factor * A[row[c] * m + j];
        }
    }
    for (int c = 0; c < m; c++) machine->order[row[c]] = c;
    return 0;
}
