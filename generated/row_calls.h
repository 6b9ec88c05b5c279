/* Generated from derive/calls.py by `python -m derive`; never edited by hand.
 * derivation d865869e1ea08652
 * `real` is a number or a lane of numbers, FN(name) the function for that type. */

/* a (n, 6) or (6), b (n, 6) or (6) -> out (n, 6): A followed by B. */
int CALL(compose)(ptrdiff_t n, const double *a, ptrdiff_t a_stride, const double *b,
                  ptrdiff_t b_stride, double *out);

/* a (n, 6) -> out (n, 6): the inverse of A. */
int CALL(invert)(ptrdiff_t n, const double *a, double *out);

/* a (6), pose (n, 6), c (n, 6) or (6), composed (n, 6) -> rates (n, 6, 6): rates of A T C by
 * those of T. */
int CALL(compose_rates)(ptrdiff_t n, const double *a, const double *pose, const double *c,
                        ptrdiff_t c_stride, const double *composed, double *rates);

/* a (6), pose (n, 6), c (6) -> twists (n, 6, 6): twists of A T C by those of T. */
int CALL(compose_twists)(ptrdiff_t n, const double *a, const double *pose, const double *c,
                         double *twists);

/* pose (n, 6), target (n, 3) or (3) -> point (n, 3), by_twist (n, 3, 6), by_target (n, 3, 3):
 * targets of the platform as points of the base, with their derivatives by the twist and by the
 * target. */
int CALL(points)(ptrdiff_t n, const double *pose, const double *target, ptrdiff_t target_stride,
                 double *point, double *by_twist, double *by_target);

/* frame (6), point (n, 3) -> seen (n, 3), by_frame (n, 3, 6), by_point (n, 3, 3): points of the
 * base in a frame, with their derivatives by the frame and by the point. */
int CALL(seen_points)(ptrdiff_t n, const double *frame, const double *point, double *seen,
                      double *by_frame, double *by_point);

/* pose (n, 6), target (n, 3) or (3), anchor (n, 3) or (3), zero (n, 1) or (1) -> distance (n),
 * by_twist (n, 6), by_target (n, 3), by_anchor (n, 3): distances from anchors of the base to
 * targets of the platform less a zero, with their derivatives by the twist, the target and the
 * anchor. */
int CALL(distances)(ptrdiff_t n, const double *pose, const double *target, ptrdiff_t target_stride,
                    const double *anchor, ptrdiff_t anchor_stride, const double *zero,
                    ptrdiff_t zero_stride, double *distance, double *by_twist, double *by_target,
                    double *by_anchor);

/* pose (n, 6), other (n, 6), target (n, 3) or (3) -> distance (n), by_twist (n, 6), by_other
 * (n, 6), by_target (n, 3): distances between two places of a target of the platform, with
 * their derivatives by both twists and by the target. */
int CALL(between)(ptrdiff_t n, const double *pose, const double *other, const double *target,
                  ptrdiff_t target_stride, double *distance, double *by_twist, double *by_other,
                  double *by_target);

/* artefact (n, 6) or (6), point (n, 3) -> inside (n, 3), by_artefact (n, 3, 6), by_point (n, 3,
 * 3): points of the base in the axes of artefacts, with their derivatives by the artefact and
 * by the point. */
int CALL(touched_points)(ptrdiff_t n, const double *artefact, ptrdiff_t artefact_stride,
                         const double *point, double *inside, double *by_artefact, double *by_point);

/* pose (n, 6), mounting (n, 3) or (3), up (n, 3) or (3) -> tilt (n, 2), by_turn (n, 2, 3),
 * by_mounting (n, 2, 3), by_up (n, 2, 3): how far the axes of sensors point up, with the
 * derivatives by the turning, the mounting and the vertical. */
int CALL(tilts)(ptrdiff_t n, const double *pose, const double *mounting, ptrdiff_t mounting_stride,
                const double *up, ptrdiff_t up_stride, double *tilt, double *by_turn,
                double *by_mounting, double *by_up);

/* board (n, 6), corner (n, 3), lens (n, 9) or (9), size (n, 1) or (1) -> seen (n, 2), by_twist
 * (n, 2, 6), by_lens (n, 2, 9), by_size (n, 2), depth (n): where cameras see corners of boards,
 * with the derivatives by the board's twist at the camera, by the lens and by the size of the
 * board, and how far before the camera they are. */
int CALL(pixels)(ptrdiff_t n, const double *board, const double *corner, const double *lens,
                 ptrdiff_t lens_stride, const double *size, ptrdiff_t size_stride, double *seen,
                 double *by_twist, double *by_lens, double *by_size, double *depth);

/* x (n, 5) -> way (n), by_x (n, 5), bend (n): the way of drives without corrections, with its
 * derivatives by q, gain, quadratic, spool, buildup, and twice by q. */
int CALL(law_drive)(ptrdiff_t n, const double *x, double *way, double *by_x, double *bend);

/* x (n, 5) -> q (n): the reading of drives at a way, without corrections. */
int CALL(law_drive_inverse)(ptrdiff_t n, const double *x, double *q);

/* x (n, 4) -> error (n), by_x (n, 3), bend (n): errors with a period, with their derivatives by
 * q, cos, sin, and twice by q. */
int CALL(law_harmonic)(ptrdiff_t n, const double *x, double *error, double *by_x, double *bend);

/* x (n, 5) -> error (n), by_x (n, 3): corrections of a table, with their derivatives by q and
 * by the two numbers beside. */
int CALL(law_segment)(ptrdiff_t n, const double *x, double *error, double *by_x);

/* own (n, 3) or (3), frame (n, 9) or (9), joint (n, 3) -> length (n), by_joint (n, 3), by_own
 * (n, 3), bend (n, 3, 3), swivel (n), swivel_by_joint (n, 3), swivel_by_own (n, 3): cables over
 * swivelling pulleys: their lengths, by the end and by radius and tilts, twice by the end; and
 * the swivel angles, by the same. */
int CALL(pulley)(ptrdiff_t n, const double *own, ptrdiff_t own_stride, const double *frame,
                 ptrdiff_t frame_stride, const double *joint, double *length, double *by_joint,
                 double *by_own, double *bend, double *swivel, double *swivel_by_joint,
                 double *swivel_by_own);

/* joint (n, 3) -> length (n), by_joint (n, 3), bend (n, 3, 3): straight parts of cables: their
 * lengths, by the end and twice by it. */
int CALL(strand)(ptrdiff_t n, const double *joint, double *length, double *by_joint, double *bend);

/* q (n, 1), numbers (n, 16) or (16), force (n, 3), frame (9) -> by_q (n), by_number (n, 16):
 * work of forces at the anchors of a limb with a slider, by the actuator and by the limb's
 * numbers. */
int CALL(slider_work)(ptrdiff_t n, const double *q, const double *numbers, ptrdiff_t numbers_stride,
                      const double *force, const double *frame, double *by_q, double *by_number);

/* q (n, 1), numbers (n, 16) or (16), force (n, 3), frame (9) -> by_q (n), by_number (n, 16):
 * work of forces at the anchors of a limb with a crank, by the actuator and by the limb's
 * numbers. */
int CALL(crank_work)(ptrdiff_t n, const double *q, const double *numbers, ptrdiff_t numbers_stride,
                     const double *force, const double *frame, double *by_q, double *by_number);

/* size (6), free (n, 4) -> lengths (n, 4): 2TPR&2TPS: eq. 8. */
int CALL(tpr2tps_lengths)(ptrdiff_t n, const double *size, const double *free, double *lengths);

/* size (6), free (n, 4) -> jacobian (n, 4, 4): 2TPR&2TPS: eq. 12. */
int CALL(tpr2tps_jacobian)(ptrdiff_t n, const double *size, const double *free, double *jacobian);

/* twist (n, 6) -> motion (n, 4, 4): the motion by a twist (omega, v). */
int CALL(exp)(ptrdiff_t n, const double *twist, double *motion);

/* motion (n, 16) -> twist (n, 6): the twist of a motion. */
int CALL(log)(ptrdiff_t n, const double *motion, double *twist);

/* motion (n, 16) -> adjoint (n, 6, 6): how twists move along. */
int CALL(adjoint)(ptrdiff_t n, const double *motion, double *adjoint);

/* motion (n, 16) -> pose (n, 6): x y z alpha beta gamma of a motion. */
int CALL(motion_pose)(ptrdiff_t n, const double *motion, double *pose);

/* twist (n, 6) -> jacobian (n, 6, 6): dT T^-1 by dtwist, at the twist. */
int CALL(exp_jacobian)(ptrdiff_t n, const double *twist, double *jacobian);

/* twist (n, 6) -> jacobian (n, 6, 6): dtwist by dT T^-1, at the twist. */
int CALL(log_jacobian)(ptrdiff_t n, const double *twist, double *jacobian);

/* error (n, 6), point (n, 3) -> motion (n, 4, 4): the motion by joint errors dx dy dz dphi
 * dtheta dpsi at a point. */
int CALL(joint_motions)(ptrdiff_t n, const double *error, const double *point, double *motion);
