/* The flat C interface of the core: what `pkmcal._core` offers to Python.
 *
 * The calls are in calls.h. They are compiled once for each ISA, and their names say for which:
 * pkm_base_forward, pkm_avx2_forward, pkm_avx512_forward. Only what needs no lanes is declared here.
 */
#ifndef PKMCAL_H
#define PKMCAL_H

#include <stddef.h>
#include <stdint.h>

#include "names.h"

/* cffi begin */
enum { PKM_MAX_LIMBS = 24, PKM_MAX_ROWS = 48 };
enum { PKM_OK, PKM_NOT_CONVERGED, PKM_SINGULAR, PKM_INFEASIBLE, PKM_INVALID,
       PKM_NOT_CLOSED, PKM_GIVES_WAY };
enum { PKM_BAD_MACHINE = -1, PKM_BAD_COLUMN = -2, PKM_BAD_SWARM = -3 };

/* A machine: its pose map and its limbs, without the numbers that calibration changes. */
typedef struct {
    int map;                        /* MAP_... */
    int limbs;                      /* how many, at most PKM_MAX_LIMBS */
    int actuators;
    double size;                    /* [mm] what rounding is measured against */
    double length;                  /* characteristic length [mm]: rotations times it are mm */
    double closure_tolerance;       /* [mm]: what more rows than coordinates may miss */
    int driver[24];                 /* DRIVER_... of each limb */
    int rows[24];                   /* set of ROW_... beside the sphere */
    int actuator[24];               /* which actuator drives the limb */
    double branch[24];              /* +1 or -1 for slider and crank */
    int angle[24];                  /* is q̃ an angle, the same after a whole turn? */
    double near[24];                /* q̃ an angle is given nearest to: see pkm_prepare */
    double frame[24 * AXES * 9];    /* of each axis of each limb, 3 x 3 row by row */
    double lever[24];               /* of the couple row [mm] */
    double weight[48];              /* of each row, limb by limb, the sphere first */
    int order[48];                  /* place of each row in the elimination: see pkm_prepare */
    double sharing[24];             /* how many limbs each actuator drives: see pkm_prepare */
} pkm_machine;

/* A swarm in `dims` dimensions and the factors of eq. 19. Its state, pkm_swarm_size numbers, begins
 * with x (dims, width), width = the particles rounded up to eights, and ends with the value of each
 * particle (width), gBest (dims) and the value there. */
typedef struct {
    int particles, dims;
    double inertia, cognitive, social;
} pkm_swarm;

/* A serial arm at zero: of each joint its kind, its frame's axes (joints, 9) with the joint's own as
 * the third column, and its point (joints, 3); and the tool. */
typedef struct {
    int joints;
    const int32_t *prismatic;
    const double *axes, *point, *home;
} pkm_arm;

/* What is between the joints: (joints + 1, 12), or (n, joints + 1, 12) by row. See pkm_arm_links. */
typedef struct {
    int by_row;
    const double *link;
} pkm_links;

/* A machine of limbs that are chains of joints: see chains.h. Joints are counted once where chains
 * share them; a joint is turned or slid by an actuator, or passive. What chains share comes first among
 * the passive ones. Places are those of numbers in the geometry. */
enum { PKM_MAX_CHAIN = 10, PKM_MAX_JOINTS = 72, PKM_MAX_SHARED = 6, PKM_MAX_CHAIN_ROWS = 36,
       PKM_MAX_NUMBERS = 1024 };
typedef struct {
    int map, chains, joints, actuators, passive, shared, numbers;
    int tail;                       /* the first actuator of joints behind the platform, in all chains */
    double size, length, closure_tolerance; /* [mm], as of pkm_machine */
    int over;                       /* more rows than unknowns: weigh them by compliance */
    double home[12];                /* the platform's frame at home, the first rows of its matrix */
    const int32_t *first;           /* (chains + 1) where the joints of each begin in `member` */
    const int32_t *member;          /* joints from base to platform, chain after chain */
    const int32_t *ball;            /* (chains) does the chain end in a ball, after its joints? */
    const int32_t *end_place;       /* (chains) of the six errors on the platform's side */
    const int32_t *ball_place;      /* (chains) of the three errors of the ball */
    const double *end;              /* (chains, 3) the point on the platform, at home */
    const int32_t *prismatic;       /* (joints) */
    const int32_t *actuator;        /* (joints) or -1 */
    const int32_t *coordinate;      /* (joints) which of the passive ones, or -1 */
    const int32_t *place;           /* (joints) of the six errors */
    const double *axes;             /* (joints, 9), the joint's own the third column, at home */
    const double *point;            /* (joints, 3), at home */
    const double *soft;             /* (joints) compliance [mm per unit force], others relative */
    const int32_t *drive_place;     /* (actuators) of the offset; the gain follows */
    const double *zero;             /* (actuators) the reading at home */
} pkm_chains;

enum { PKM_SPACE, PKM_BODY, PKM_TIP }; /* tip: velocity of the tool's origin, in base axes */

const char *pkm_slot_names(void);
const char *pkm_axis_names(void);
const char *pkm_driver_names(void);
const char *pkm_row_names(void);
const char *pkm_map_names(void);
const char *pkm_map_free(void);
const char *pkm_row_calls(void); /* see derive/calls.py, `table` */

/* The best ISA of this processor: 0 base, 1 AVX2, 2 AVX-512. */
int pkm_best_isa(void);

/* The number of closure rows, or 0 for a machine the core cannot take. */
int pkm_closure_count(const pkm_machine *machine);

/* The same number, or 0 also where `order` is not one that pkm_prepare sets: what every call asks. */
int pkm_prepared(const pkm_machine *machine);

/* The rows that chains leave when each has eliminated the passive joints of its own, or 0 for a
 * machine of chains the core cannot take: every call asks. The arrays are as long as the counts say. */
int pkm_chain_count(const pkm_chains *machine);

/* Before every other call of a machine: count how many limbs are `sharing` an actuator, and set
 * `order` from an elimination with exchanges at the home pose: later ones run in that order.
 * `near` holds the middle of each limb's stroke, or NaN where it states none; what is NaN becomes the
 * drive where the actuator's first stroke has its middle, or else where the actuator is at home. */
int pkm_prepare(pkm_machine *machine, const double *geometry, const double *home);

/* How many numbers the state of a swarm has, 0 for a swarm the core cannot take. */
ptrdiff_t pkm_swarm_size(const pkm_swarm *swarm);

/* What a limb is at given actuators, for homotopies: its joint b, its anchor c, its length and its
 * axes, in that order. Zero where it has no axis. */
enum { PKM_SPHERE = 7 + 3 * AXES };

/* Numbers that the widest lanes hold: memory that is lent to a call is a multiple of that. */
enum { PKM_WIDEST = 8 };

/* What became of a path. */
enum { PKM_ARRIVED, PKM_LOST, PKM_FAR };

/* Solutions of closures at `start`, as many as there are free coordinates, followed to `target`, while
 * the limbs go there in a straight line. Complex numbers are pairs: limbs (limbs, PKM_SPHERE), states
 * of the pose map at the start (n, pkm_state_size), which become those at the end. Steps are so small
 * that predictions are within `accuracy`. -> the frames (n, 12), R row by row and p, how each path
 * ended, after how many steps, and where on the line (1: target). */
int pkm_state_size(void);
int pkm_paths(const pkm_machine *machine, ptrdiff_t n, const double *start, const double *target,
              double *state, double accuracy, double *frame, int32_t *status, int32_t *steps,
              double *reached);

/* Geometries that differ: of each row of out (n, size) the numbers at `place` (k) become those of
 * `ideal` (size) plus the row's errors (n, k); the others are left. */
int pkm_with_errors(ptrdiff_t n, int k, const double *error, const int32_t *place, ptrdiff_t size,
                    const double *ideal, double *out);
/* cffi end */

/* What calls.h declares, of each ISA. */
#define PKM_NAME(isa, name) pkm_##isa##_##name
#define PKM_CALL(isa, name) PKM_NAME(isa, name)
#define CALL(name) PKM_CALL(ISA, name)
#define ISA base
#include "calls.h"
#undef ISA
#ifdef __x86_64__
#define ISA avx2
#include "calls.h"
#undef ISA
#define ISA avx512
#include "calls.h"
#undef ISA
#endif

#endif
