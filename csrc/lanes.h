/* Lanes: `real` is LANES doubles, one row of a batch each, at the processor's native width.
 *
 * Masks are lanes of 64-bit integers, all ones or zero. Conditions are written so that NaN fails.
 */
#ifndef LANES_H
#define LANES_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#ifdef __x86_64__
#include <immintrin.h>
#endif

#define INLINE static inline __attribute__((always_inline, unused))
#define FN(name) name##_lanes

typedef double real __attribute__((vector_size(8 * LANES)));
typedef int64_t mask __attribute__((vector_size(8 * LANES)));

INLINE real FN(fill)(double x)
{
    real r;
    for (int l = 0; l < LANES; l++) r[l] = x;
    return r;
}

INLINE mask fill_mask(int64_t x)
{
    mask r;
    for (int l = 0; l < LANES; l++) r[l] = x;
    return r;
}

INLINE real select(mask m, real yes, real no)
{
    return (real)((m & (mask)yes) | (~m & (mask)no));
}

INLINE mask select_mask(mask m, mask yes, mask no) { return (m & yes) | (~m & no); }

INLINE int any(mask m)
{
#if LANES == 8 && defined(__AVX512DQ__)
    return _mm512_movepi64_mask((__m512i)m) != 0;
#elif LANES == 4 && defined(__AVX2__)
    return _mm256_movemask_pd((__m256d)m) != 0;
#else
    int64_t r = 0;
    for (int l = 0; l < LANES; l++) r |= m[l];
    return r != 0;
#endif
}

INLINE real FN(root)(real x)
{
#if LANES == 8 && defined(__AVX512F__)
    return (real)_mm512_sqrt_pd((__m512d)x);
#elif LANES == 4 && defined(__AVX__)
    return (real)_mm256_sqrt_pd((__m256d)x);
#elif LANES == 2 && defined(__SSE2__)
    return (real)_mm_sqrt_pd((__m128d)x);
#else
    real r;
    for (int l = 0; l < LANES; l++) r[l] = sqrt(x[l]);
    return r;
#endif
}

INLINE real absolute(real x) { return (real)((mask)x & fill_mask(INT64_MAX)); }

/* NaN in either wins: a maximum that dropped it would call a failed row good. */
INLINE real maximum(real a, real b) { return select((a > b) | (a != a), a, b); }

INLINE real minimum(real a, real b) { return select((a < b) | (a != a), a, b); }

INLINE mask finite(real x) { return absolute(x) <= FN(fill)(1.7976931348623157e308); }

/* Column k of LANES rows of a row-major array. Lanes past the last row repeat it. */
INLINE real gather(const double *column, ptrdiff_t stride, ptrdiff_t rows)
{
    real r;
    for (int l = 0; l < LANES; l++) r[l] = column[stride * (l < rows ? l : rows - 1)];
    return r;
}

/* The reverse, without the lanes past the last row. */
INLINE void scatter(real x, double *column, ptrdiff_t stride, ptrdiff_t rows)
{
    double lane[LANES];
    memcpy(lane, &x, sizeof lane);
    for (int l = 0; l < LANES && l < rows; l++) column[stride * l] = lane[l];
}

#endif
