/* Generated from derive/elementary.py by `python -m derive`; never edited by hand.
 * derivation b080d1f7a24f7a0e
 * `real` is a number or a lane of numbers, FN(name) the function for that type. */

/* (sin(x)/x - 1)/x²,  |x| <= π/4, as a polynomial in x² */
#define SIN_0 -0x1.5555555555555p-3
#define SIN_1 0x1.1111111110bb2p-7
#define SIN_2 -0x1.a01a019e83aaep-13
#define SIN_3 0x1.71de37968a100p-19
#define SIN_4 -0x1.ae600b02b6262p-26
#define SIN_5 0x1.5e0b19f8b1451p-33

/* ((cos(x) - 1)/x² + 1/2)/x²,  |x| <= π/4, as a polynomial in x² */
#define COS_0 0x1.5555555555555p-5
#define COS_1 -0x1.6c16c16c16967p-10
#define COS_2 0x1.a01a019f4eb01p-16
#define COS_3 -0x1.27e4fa17da09ep-22
#define COS_4 0x1.1eeb68e93b64cp-29
#define COS_5 -0x1.907da367a37cbp-37

/* (atan(x)/x - 1)/x²,  |x| <= tan(π/8), as a polynomial in x² */
#define ATAN_0 -0x1.5555555555555p-2
#define ATAN_1 0x1.999999999934cp-3
#define ATAN_2 -0x1.2492492436201p-3
#define ATAN_3 0x1.c71c71853d7fap-4
#define ATAN_4 -0x1.745d0b28a7e37p-4
#define ATAN_5 0x1.3b1263064f6b9p-4
#define ATAN_6 -0x1.10fa77b1a6d57p-4
#define ATAN_7 0x1.dfe6497e96323p-5
#define ATAN_8 -0x1.a0999c632b6edp-5
#define ATAN_9 0x1.4162c02b1dda3p-5
#define ATAN_10 -0x1.3a31b1c0fd3b7p-6

/* (artanh(x)/x - 1)/x²,  |x| <= tan(π/8)² = 3 - √8, as a polynomial in x² */
#define ATANH_0 0x1.5555555555558p-2
#define ATANH_1 0x1.99999999952e2p-3
#define ATANH_2 0x1.2492492df148dp-3
#define ATANH_3 0x1.c71c62e5800a1p-4
#define ATANH_4 0x1.7462b4ab2ef6bp-4
#define ATANH_5 0x1.39fe606542ddep-4
#define ATANH_6 0x1.2b584aae78a57p-4

#define TWO_OVER_PI 0x1.45f306dc9c883p-1
#define QUARTER_PI 0x1.921fb54442d18p-1
#define HALF_PI 0x1.921fb54442d18p+0
#define PI 0x1.921fb54442d18p+1
#define TWO_PI 0x1.921fb54442d18p+2
#define TAN_PI_8 0x1.a827999fcef32p-2
#define SQRT_HALF 0x1.6a09e667f3bcdp-1
#define LN_2 0x1.62e42fefa39efp-1
/* π/2 in three parts; k times the first two is exact for |k| < 2^20 */
#define HALF_PI_PART0 0x1.921fb54400000p+0
#define HALF_PI_PART1 0x1.0b4611a600000p-34
#define HALF_PI_PART2 0x1.3198a2e037073p-69
