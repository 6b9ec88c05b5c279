/* Generated from derive/limbs.py by `python -m derive`; never edited by hand.
 * derivation fb7930544e8ece11
 * `real` is a number or a lane of numbers, FN(name) the function for that type. */

/* the numbers of one limb, in the order of the core */
enum { BASE_X, BASE_Y, BASE_Z, PLATFORM_X, PLATFORM_Y, PLATFORM_Z, OFFSET, GAIN, ROD, CRANK, TILT1, TILT2, PLATFORM_TILT1, PLATFORM_TILT2, SLOTS };
#define SLOT_NAMES "base.x base.y base.z platform.x platform.y platform.z offset gain rod crank tilt1 tilt2 platform_tilt1 platform_tilt2"
enum { DRIVER_LENGTH, DRIVER_SLIDER, DRIVER_CRANK };
#define DRIVER_NAMES "length slider crank"
/* constraint rows beside the sphere: bits of a set */
#define ROW_BASE_PLANE 1
#define ROW_PLATFORM_PLANE 2
#define ROW_COUPLE 4
#define ROW_NAMES "base_plane platform_plane couple"
/* pose maps: m free coordinates, iterated on a state */
enum { MAP_SPATIAL, MAP_TRANSLATION, MAP_PLANAR, MAP_2TPR2TPS };
#define MAP_NAMES "spatial translation planar 2tpr2tps"
#define MAP_FREE "x y z alpha beta gamma;x y z;x y gamma;y z alpha beta"
#define MAX_STATE 7
#define EACH_MAP(X) X(SPATIAL, spatial, 6) X(TRANSLATION, translation, 3) X(PLANAR, planar, 3) X(2TPR2TPS, 2tpr2tps, 4)
