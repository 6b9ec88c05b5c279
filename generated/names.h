/* Generated from derive/limbs.py by `python -m derive`; never edited by hand.
 * derivation 6673a429961d53fb
 * `real` is a number or a lane of numbers, FN(name) the function for that type. */

/* the numbers of one limb, in the order of the core */
enum { BASE_X, BASE_Y, BASE_Z, PLATFORM_X, PLATFORM_Y, PLATFORM_Z, OFFSET, GAIN, ROD, CRANK, TILT1, TILT2, PLATFORM_TILT1, PLATFORM_TILT2, HINGE_TILT1, HINGE_TILT2, SLOTS };
#define SLOT_NAMES "base.x base.y base.z platform.x platform.y platform.z offset gain rod crank tilt1 tilt2 platform_tilt1 platform_tilt2 hinge_tilt1 hinge_tilt2"
/* axes: name, place, and the rows that have it */
enum { AXES = 3 };
#define AXIS_NAMES "base tilt1 tilt2;platform platform_tilt1 platform_tilt2;hinge hinge_tilt1 hinge_tilt2"
#define EACH_AXIS(X) X(base, 0, ROW_BASE_PLANE | ROW_COUPLE) X(platform, 1, ROW_PLATFORM_PLANE | ROW_COUPLE) X(hinge, 2, ROW_HINGE_PLANE)
/* drivers: does q̃ move the anchor, does it change the length? */
enum { DRIVER_LENGTH, DRIVER_SLIDER, DRIVER_CRANK, DRIVERS };
#define DRIVER_NAMES "length slider crank"
#define EACH_DRIVER(X) X(LENGTH, length, 0, 1) X(SLIDER, slider, 1, 0) X(CRANK, crank, 1, 0)
/* constraint rows beside the sphere, bits of a set: the axes on base and platform */
#define ROW_BASE_PLANE 1
#define ROW_PLATFORM_PLANE 2
#define ROW_COUPLE 4
#define ROW_HINGE_PLANE 8
#define ALL_ROWS 15
#define ROW_NAMES "base_plane base;platform_plane platform;couple base platform;hinge_plane hinge"
#define EACH_ROW(X) X(BASE_PLANE, base_plane, 0, 0) X(PLATFORM_PLANE, platform_plane, 0, 1) X(COUPLE, couple, 0, 1) X(HINGE_PLANE, hinge_plane, 2, 0)
/* pose maps: m free coordinates, how many of them are lengths, iterated on a state */
enum { MAP_SPATIAL, MAP_TRANSLATION, MAP_PLANAR, MAP_2TPR2TPS, MAP_SPHERICAL, MAP_XY };
#define MAP_NAMES "spatial translation planar 2tpr2tps spherical xy"
#define MAP_FREE "x y z alpha beta gamma;x y z;x y gamma;y z alpha beta;alpha beta gamma;x y"
#define MAX_STATE 7
#define EACH_MAP(X) X(SPATIAL, spatial, 6, 3) X(TRANSLATION, translation, 3, 3) X(PLANAR, planar, 3, 2) X(2TPR2TPS, 2tpr2tps, 4, 2) X(SPHERICAL, spherical, 3, 0) X(XY, xy, 2, 2)
#define ROW_CALLS \
    "compose a:6* b:6* -> out:6\n" \
    "invert a:6 -> out:6\n" \
    "compose_rates a:6! pose:6 c:6* composed:6 -> rates:6,6\n" \
    "compose_twists a:6! pose:6 c:6! -> twists:6,6\n" \
    "points pose:6 target:3* -> point:3 by_twist:3,6 by_target:3,3\n" \
    "seen_points frame:6! point:3 -> seen:3 by_frame:3,6 by_point:3,3\n" \
    "distances pose:6 target:3* anchor:3* zero:1* -> distance: by_twist:6 by_target:3 by_anchor:3\n" \
    "between pose:6 other:6 target:3* -> distance: by_twist:6 by_other:6 by_target:3\n" \
    "touched_points artefact:6* point:3 -> inside:3 by_artefact:3,6 by_point:3,3\n" \
    "tilts pose:6 mounting:3* up:3* -> tilt:2 by_turn:2,3 by_mounting:2,3 by_up:2,3\n" \
    "pixels board:6 corner:3 lens:9* size:1* -> seen:2 by_twist:2,6 by_lens:2,9 by_size:2 depth:\n" \
    "law_drive x:5 -> way: by_x:5 bend:\n" \
    "law_drive_inverse x:5 -> q:\n" \
    "law_harmonic x:4 -> error: by_x:3 bend:\n" \
    "law_segment x:5 -> error: by_x:3\n" \
    "pulley own:3* frame:9* joint:3 -> length: by_joint:3 by_own:3 bend:3,3 swivel: swivel_by_joint:3 swivel_by_own:3\n" \
    "strand joint:3 -> length: by_joint:3 bend:3,3\n" \
    "slider_work q:1 numbers:16* force:3 frame:9! -> by_q: by_number:16\n" \
    "crank_work q:1 numbers:16* force:3 frame:9! -> by_q: by_number:16\n" \
    "tpr2tps_lengths size:6! free:4 -> lengths:4\n" \
    "tpr2tps_jacobian size:6! free:4 -> jacobian:4,4\n" \
    "exp twist:6 -> motion:4,4\n" \
    "log motion:16 -> twist:6\n" \
    "adjoint motion:16 -> adjoint:6,6\n" \
    "motion_pose motion:16 -> pose:6\n" \
    "exp_jacobian twist:6 -> jacobian:6,6\n" \
    "log_jacobian twist:6 -> jacobian:6,6\n" \
    "joint_motions error:6 point:3 -> motion:4,4\n"
