/* The core for any processor: 128-bit lanes; and what is done once for a machine. */
#include "pkmcal.h"
#define LANES 2
#define ISA base
#include "core.h"

#define BESIDE_HALF_TURN 0.1 /* rad: angles at home are from this less half a turn to this plus half */

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

/* The machine's own references of its angles. A home that is not reached says nothing: 0. */
static void set_near(pkm_machine *machine, const double *geometry, const double *home)
{
    limb_numbers limb[PKM_MAX_LIMBS];
    ptrdiff_t zero[LANES] = {0};
    real pose[6], R[9], p[3], h[3], q, qt, at_home[PKM_MAX_LIMBS];
    int seen = 0;
    prepare_limbs(machine, geometry, 0, zero, limb);
    for (int k = 0; k < 6; k++) pose[k] = fill(home[k]);
    FN(pose_frame)(pose, R, p);
    for (int f = 0; f < machine->limbs; f++) {
        const int a = machine->actuator[f];
        if (!machine->angle[f] || seen >> a & 1) continue;
        seen |= 1 << a;
        int s = f; /* the first limb of the actuator with a stroke, or else the first */
        while (s < machine->limbs && (machine->actuator[s] != a || isnan(machine->near[s]))) s++;
        const int unstated = s == machine->limbs;
        if (unstated) {
            s = f;
            FN(limb_joint)(R, p, limb[s].g + PLATFORM_X, limb[s].g + BASE_X, h);
            qt = limb_drive_at(machine, s, &limb[s], h);
            /* half a turn is where homes are found: the cut is elsewhere */
            const double at = nearest_turn(qt, fill(BESIDE_HALF_TURN), fill(TWO_PI))[0];
            machine->near[s] = isfinite(at) ? at : 0.0;
        }
        FN(limb_command)(fill(machine->near[s]), limb[s].per_gain, limb[s].g, &q);
        for (int i = f; i < machine->limbs; i++)
            if (machine->actuator[i] == a && isnan(machine->near[i])) {
                FN(limb_drive)(q, limb[i].g, &qt);
                machine->near[i] = qt[0];
            }
        if (!unstated || !geared(machine, limb, f)) continue;
        inverse_once(machine, limb, R, p, at_home); /* the turn at home where all its limbs agree */
        for (int i = f; i < machine->limbs; i++)
            if (machine->actuator[i] == a && isfinite(at_home[a][0])) {
                FN(limb_drive)(at_home[a], limb[i].g, &qt);
                machine->near[i] = qt[0];
            }
    }
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
    set_near(machine, geometry, home);
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
