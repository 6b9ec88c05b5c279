/* Every call that is compiled for each ISA, declared once; pkmcal.h includes this for each of them.
 *
 * A call takes n rows, contiguous, row by row. It returns 0, or a negative number for a bad call, in
 * which case nothing was written. No memory is allocated and no state is kept. `geometry` holds
 * limbs x SLOTS numbers; `geometry_stride` is 0 where all rows share it, else the distance from one
 * row's geometry to the next.
 */

/* pose (n, 6) -> q (n, actuators); a row a limb cannot reach is NaN. Of an angle, the turn nearest to
 * `near` (actuators, or n x actuators by near_stride), or, if that is NULL, to the machine's own. */
int CALL(inverse)(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                  ptrdiff_t geometry_stride, const double *pose, const double *near,
                  ptrdiff_t near_stride, double *q);

/* q (n, actuators), guess (6 or n x 6 by guess_stride) -> pose (n, 6), status, iterations and the
 * closure residual [mm] of each row. */
int CALL(forward)(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                  ptrdiff_t geometry_stride, const double *q, const double *guess,
                  ptrdiff_t guess_stride, double *pose, int32_t *status, int32_t *iterations,
                  double *residual);

/* The same of n machines, geometry (n, limbs, SLOTS), at q (places, actuators) from guess (places, 6):
 * pose (places, n, 6), and so on. */
int CALL(forward_machines)(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                           ptrdiff_t places, const double *q, const double *guess, double *pose,
                           int32_t *status, int32_t *iterations, double *residual);

/* The same of one machine, with as many rows as free coordinates, in which numbers at `column` yield
 * under what pulls at the platform: by compliance (columns, or n x columns by its stride) [mm/N, rad/(N
 * mm)]. pull (16, or n x 16 by its stride) is sum of m r [kg mm], sum of m [kg], gravity [N/kg], a point
 * of the platform [mm], the force there [N], a moment [N mm]. A number rests that changes by less than
 * `settled`, and gives too much beyond `most` (columns each). PKM_NOT_CONVERGED, with the rigid pose
 * or a later one, where that was not so within `steps`. */
int CALL(forward_loaded)(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                         const double *q, const double *guess, ptrdiff_t guess_stride,
                         const int32_t *column, int columns, const double *compliance,
                         ptrdiff_t compliance_stride, const double *pull, ptrdiff_t pull_stride,
                         const double *settled, const double *most, int steps, double *pose,
                         int32_t *status, int32_t *iterations, double *residual);

/* pose (n, 6) -> dq/dfree (n, actuators, m), limb by limb. */
int CALL(jacobian)(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                   ptrdiff_t geometry_stride, const double *pose, double *jacobian);

/* pose (n, 6), q (n, actuators) -> dpose/dq (n, 6, actuators), or with `twists` the twist (omega, v) of
 * the platform's origin in base axes by them. */
int CALL(forward_jacobian)(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                           ptrdiff_t geometry_stride, const double *pose, const double *q,
                           int twists, double *jacobian);

/* pose (n, 6), q (n, actuators) -> dpose/d(numbers) (n, 6, columns) at held actuators, or with
 * `twists` the twist (omega, v) of the platform's origin in base axes by them; columns are indices
 * into limbs x SLOTS. */
int CALL(error_jacobian)(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                         ptrdiff_t geometry_stride, const double *pose, const double *q,
                         const int32_t *column, int columns, int twists, double *jacobian);

/* pose (n, 6), q (n, actuators) -> the closure rows, limb by limb and the sphere first: residual
 * (n, rows) [mm]; their derivatives by a scaled twist (n, rows, m), by the free coordinates
 * (n, rows, m) and by q (n, rows, actuators); and the pose (n, 6) as the map has it, with its
 * derivatives by the free coordinates (n, 6, m). */
int CALL(closure)(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                  ptrdiff_t geometry_stride, const double *pose, const double *q, double *residual,
                  double *by_step, double *by_free, double *by_q, double *on_map,
                  double *pose_by_free);

/* pose (n, 6), q (n, actuators) -> actuators as instruments, limb by limb: of the sphere row the
 * coordinate that the limb needs at the pose less the one read, nearest turn, of the other rows the
 * weighted closure [mm] (n, rows); by the map's step [mm, rad] (n, rows, m) and by the numbers (n, rows,
 * columns; NULL: not wanted); columns are indices into limbs x SLOTS. Of a
 * limb out of reach, the closure at q over its slope there. */
int CALL(readings)(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                   ptrdiff_t geometry_stride, const double *pose, const double *q,
                   const int32_t *column, int columns, double *residual, double *by_step,
                   double *by_number);

/* pose (n, 6), step of a pose map (n, m) [mm, rad] -> the pose moved by it (n, 6), and the twist
 * (omega, v) by a step at the pose (n, 6, m; NULL: not wanted). */
int CALL(moved)(int map, ptrdiff_t n, const double *pose, const double *step, double *moved,
                double *twist);

/* Equations of n poses with as many unknowns each: those of pose i are order[first[i]] to order[first[i
 * + 1] - 1], places in arrays of all equations. `work` is PKM_WIDEST (k + unknowns + 1) (unknowns
 * + 1) numbers, k the most equations of a pose.
 *
 * residual, by_unknown (equations, unknowns) -> JᵀJ (n, unknowns, unknowns), Jᵀr (n, unknowns) and rᵀr
 * (n). */
int CALL(pose_normals)(ptrdiff_t n, int unknowns, const int64_t *first, const int64_t *order,
                       const double *residual, const double *by_unknown, double *matrix,
                       double *pull, double *cost, double *work);

/* by_unknown -> R of its QR factorisation (n, unknowns, unknowns), behind as many rows as a pose has
 * equations zeros. */
int CALL(pose_triangle)(ptrdiff_t n, int unknowns, const int64_t *first, const int64_t *order,
                        const double *by_unknown, double *factor, double *work);

/* residual, by_unknown, and damping (n) of each pose -> the step (n, unknowns), what it should take off
 * rᵀr (n), rᵀr itself (n), and what is left of the residual as of a column of `part` below. A step that
 * gains less than `least` of rᵀr, or no more than errors `rounding` of the unknowns make of it, is 0 and
 * gains 0; of a pose with numbers that are not finite it is 0 and gains NaN. */
int CALL(pose_fit)(ptrdiff_t n, int unknowns, const int64_t *first, const int64_t *order,
                   const double *residual, const double *by_unknown, const double *damping,
                   double least, double rounding, const int64_t *place, double *step, double *gain,
                   double *cost, double *left, double *work);

/* part (equations, columns) -> what is left of it when by_unknown is a triangle: of pose i the rows from
 * place[i] on; and -R⁻¹ times what is not left (n, unknowns, columns), not finite where R is singular. */
int CALL(pose_left)(ptrdiff_t n, int unknowns, const int64_t *first, const int64_t *order,
                    const double *by_unknown, int columns, const double *part, const int64_t *place,
                    double *left, double *following, double *work);

/* The reverse of what is left: part (order, columns), pose by pose. */
int CALL(pose_spread)(ptrdiff_t n, int unknowns, const int64_t *first, const int64_t *order,
                      const double *by_unknown, int columns, const int64_t *place,
                      const double *left, double *part, double *work);

/* q (n, actuators) -> the limbs (n, limbs, PKM_SPHERE); lengths are NaN where one of them is not
 * positive. */
int CALL(spheres)(const pkm_machine *machine, ptrdiff_t n, const double *geometry, const double *q,
                  double *sphere);

/* pose (n, 6) as given -> of each limb its drive coordinate (n, limbs), NaN out of reach, and the
 * unit vector from its anchor to the platform joint in base and platform axes (n, limbs, 3). */
int CALL(limbs)(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                ptrdiff_t geometry_stride, const double *pose, double *drive, double *on_base,
                double *on_platform);

/* motion (n, 3, 4, 4), the platform's homogeneous matrix with its first and second derivative by time
 * -> velocity and acceleration of the actuators, (n, actuators) each; NaN out of reach. */
int CALL(rates)(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                ptrdiff_t geometry_stride, const double *motion, double *q1, double *q2);

/* pose (n, 6), q and its first and second derivative by time (n, actuators) -> motion (n, 3, 4, 4) as
 * above, and the first and second derivative of the pose (n, 2, 6); NaN where singular. */
int CALL(motion)(const pkm_machine *machine, ptrdiff_t n, const double *geometry,
                 ptrdiff_t geometry_stride, const double *pose, const double *q,
                 const double *q1, const double *q2, double *motion, double *pose_rates);

/* Standard normal numbers (n), of one state the same bits with every isa. The state, any bits but
 * zeros alone, is 4 words of each of eight generators (4, 8) and moves on; what is left of the last
 * sixteen numbers is dropped. */
int CALL(normals)(ptrdiff_t n, uint64_t *state, double *out);

/* pose (n, 6), and where it was to be (6) -> how far x … gamma are off, angles the short way round, and
 * the distance of the positions, (7, n). */
int CALL(pose_errors)(ptrdiff_t n, const double *pose, const double *meant, double *off);

/* value (k, n) of which columns of finite numbers are added to what is known of others: mean, sum of
 * squares about it, least and most (4, k), how many were taken and how many left out (2), and how many
 * are in each bin (k, bins + 2), the first and last of which are below and above the others. */
int CALL(stream)(int k, ptrdiff_t n, const double *value, const double *low,
                 const double *width, int bins, double *moments, int64_t *taken, int64_t *count);

/* A swarm step by step: start within the bounds; set the particles' values in the state and
 * update the best (pBest, gBest); move (eq. 19); update again. Of one seed the same bits with
 * every isa. */
int CALL(swarm_start)(const pkm_swarm *swarm, uint64_t seed, const double *lower,
                      const double *upper, double *state);
int CALL(swarm_update_best)(const pkm_swarm *swarm, double *state);
int CALL(swarm_move)(const pkm_swarm *swarm, const double *lower, const double *upper,
                     double *state);

/* Eq. 18 by swarms start, start + 1, ... start + n - 1 of a seed, one for each set of `rows` poses:
 * off (n, rows, dims) = L* - L -> the correction of each set (n, dims) and its best E after each
 * iteration (n, iterations + 1). */
int CALL(swarm_eq18)(const pkm_swarm *swarm, int iterations, uint64_t seed, ptrdiff_t start,
                     ptrdiff_t n, ptrdiff_t rows, const double *off, const double *lower,
                     const double *upper, double *state, double *correction, double *history);

/* geometry (particles, limbs, SLOTS), pose (n, 6), q (n, actuators) -> of each geometry the sum over
 * the poses of its squared closures (particles) [mm²]. */
int CALL(closure_cost)(const pkm_machine *machine, ptrdiff_t particles, const double *geometry,
                       ptrdiff_t n, const double *pose, const double *q, double *cost);

/* Joint errors (n, joints, 6) -> links (n, joints + 1, 12). */
int CALL(arm_links)(const pkm_arm *arm, ptrdiff_t n, const double *error, double *link);

/* theta (n, joints) -> the tool (n, 16); its twist by theta (n, 6, joints); its twist by the joint
 * errors (n, 6, 6 joints), which are those the links were made of. */
int CALL(arm_forward)(const pkm_arm *arm, const pkm_links *links, ptrdiff_t n, const double *theta,
                      double *motion);
int CALL(arm_jacobian)(const pkm_arm *arm, const pkm_links *links, int frame, ptrdiff_t n,
                       const double *theta, double *jacobian);
int CALL(arm_error_jacobian)(const pkm_arm *arm, const pkm_links *links, const double *error,
                             int frame, ptrdiff_t n, const double *theta, double *jacobian);

/* Machines of chains. As forward. */
int CALL(chain_forward)(const pkm_chains *machine, ptrdiff_t n, const double *geometry,
                        ptrdiff_t geometry_stride, const double *q, const double *guess,
                        ptrdiff_t guess_stride, double *pose, int32_t *status, int32_t *iterations,
                        double *residual);

/* pose (n, 6) as given -> q (n, actuators), each chain alone from its home; NaN where one of six free
 * joints or more does not reach. */
int CALL(chain_inverse)(const pkm_chains *machine, ptrdiff_t n, const double *geometry,
                        ptrdiff_t geometry_stride, const double *pose, double *q);

/* pose (n, 6), q (n, actuators) -> the rows that passive joints leave (n, rows) [mm], and their
 * derivatives by a scaled twist and by what chains share (n, rows, m + shared), by the free
 * coordinates (n, rows, m) and by q (n, rows, actuators). */
int CALL(chain_closure)(const pkm_chains *machine, ptrdiff_t n, const double *geometry,
                        ptrdiff_t geometry_stride, const double *pose, const double *q,
                        double *residual, double *by_step, double *by_free, double *by_q,
                        double *on_map, double *pose_by_free);

/* pose (n, 6), q (n, actuators) -> dpose/d(numbers) (n, 6, columns), as error_jacobian; by q where
 * column is NULL. */
int CALL(chain_response)(const pkm_chains *machine, ptrdiff_t n, const double *geometry,
                         ptrdiff_t geometry_stride, const double *pose, const double *q,
                         const int32_t *column, int columns, int twists, double *jacobian);

/* pose (n, 6), q (n, actuators) -> the passive joints there (n, passive), and the frames (R, p) of the
 * joints and of the end of each chain before they move (n, members + chains, 12). */
int CALL(chain_frames)(const pkm_chains *machine, ptrdiff_t n, const double *geometry,
                       ptrdiff_t geometry_stride, const double *pose, const double *q,
                       double *passive, double *frame);

/* Calls that are one formula a row. */
#include "row_calls.h"
