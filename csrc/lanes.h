/* Lanes: one row of a batch each, at the processor's native width.
 *
 * `wide` is LANES doubles, `narrow` as many bytes of floats; `real`, `mask` and FN(name) stand for
 * either where code is written once and included for both (kernel.h), and for `wide` elsewhere.
 * Masks are lanes of integers, all ones or zero. Conditions are written so that NaN fails.
 */
#ifndef LANES_H
#define LANES_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "pkmcal.h"
#ifdef __SSE2__
#include <immintrin.h>
#endif

#define INLINE static inline __attribute__((always_inline, unused))
/* What is not in the innermost loops is compiled once and called: smaller code is faster, and builds
 * in a third of the time. RARE code is made small as well. */
#define SHARED static __attribute__((noinline, unused))
#define RARE static __attribute__((noinline, cold, unused))

#ifndef JOINED
#define JOINED 2 /* wide blocks that make a narrow one; with 1, floats too go LANES at a time */
#endif

typedef double wide __attribute__((vector_size(8 * LANES)));
typedef int64_t wide_mask __attribute__((vector_size(8 * LANES)));
typedef float narrow __attribute__((vector_size(4 * JOINED * LANES)));
typedef int32_t narrow_mask __attribute__((vector_size(4 * JOINED * LANES)));

INLINE wide root_wide(wide x)
{
#if LANES == 8
    return (wide)_mm512_sqrt_pd((__m512d)x);
#elif LANES == 4
    return (wide)_mm256_sqrt_pd((__m256d)x);
#elif LANES == 2 && defined(__SSE2__)
    return (wide)_mm_sqrt_pd((__m128d)x);
#else
    for (int l = 0; l < LANES; l++) x[l] = sqrt(x[l]);
    return x;
#endif
}

INLINE narrow root_narrow(narrow x)
{
#if LANES == 8
    return (narrow)_mm512_sqrt_ps((__m512)x);
#elif LANES == 4
    return (narrow)_mm256_sqrt_ps((__m256)x);
#elif LANES == 2 && defined(__SSE2__)
    return (narrow)_mm_sqrt_ps((__m128)x);
#else
    for (int l = 0; l < JOINED * LANES; l++) x[l] = sqrtf(x[l]);
    return x;
#endif
}

INLINE wide select_wide(wide_mask m, wide yes, wide no)
{
#if LANES == 8
    return (wide)_mm512_mask_blend_pd(_mm512_movepi64_mask((__m512i)m), (__m512d)no, (__m512d)yes);
#elif LANES == 4
    return (wide)_mm256_blendv_pd((__m256d)no, (__m256d)yes, (__m256d)m);
#else
    return (wide)((m & (wide_mask)yes) | (~m & (wide_mask)no));
#endif
}

INLINE narrow select_narrow(narrow_mask m, narrow yes, narrow no)
{
    return (narrow)((m & (narrow_mask)yes) | (~m & (narrow_mask)no));
}

/* The larger of two numbers that are not negative. NaN wins, for its bits are larger than those of
 * any number: a maximum that dropped it would call a failed row good. */
INLINE wide larger_wide(wide a, wide b)
{
#if LANES == 8
    return (wide)_mm512_max_epi64((__m512i)a, (__m512i)b);
#else
    return select_wide((wide_mask)a > (wide_mask)b, a, b);
#endif
}

INLINE narrow larger_narrow(narrow a, narrow b)
{
#if LANES == 8
    return (narrow)_mm512_max_epi32((__m512i)a, (__m512i)b);
#else
    return select_narrow((narrow_mask)a > (narrow_mask)b, a, b);
#endif
}

/* JOINED wide blocks, the first and the last, rounded to one narrow block. */
INLINE narrow join(wide first, wide last)
{
#if LANES == 8
    const __m512 low = _mm512_castps256_ps512(_mm512_cvtpd_ps((__m512d)first));
    return (narrow)_mm512_insertf32x8(low, _mm512_cvtpd_ps((__m512d)last), 1);
#elif LANES == 4
    const __m256 low = _mm256_castps128_ps256(_mm256_cvtpd_ps((__m256d)first));
    return (narrow)_mm256_insertf128_ps(low, _mm256_cvtpd_ps((__m256d)last), 1);
#elif LANES == 2 && defined(__SSE2__)
    return (narrow)_mm_movelh_ps(_mm_cvtpd_ps((__m128d)first), _mm_cvtpd_ps((__m128d)last));
#else
    narrow r;
    for (int l = 0; l < LANES; l++) {
        r[l] = (float)first[l];
        r[(JOINED - 1) * LANES + l] = (float)last[l];
    }
    return r;
#endif
}

/* Wide block 0 or 1 of a narrow one, exactly. */
INLINE wide part(narrow x, int which)
{
#if LANES == 8
    return (wide)_mm512_cvtps_pd(which ? _mm512_extractf32x8_ps((__m512)x, 1)
                                       : _mm512_castps512_ps256((__m512)x));
#elif LANES == 4
    return (wide)_mm256_cvtps_pd(which ? _mm256_extractf128_ps((__m256)x, 1)
                                       : _mm256_castps256_ps128((__m256)x));
#elif LANES == 2 && defined(__SSE2__)
    return (wide)_mm_cvtps_pd(which ? _mm_movehl_ps((__m128)x, (__m128)x) : (__m128)x);
#else
    wide r;
    for (int l = 0; l < LANES; l++) r[l] = (double)x[which * LANES + l];
    return r;
#endif
}

enum { PLAIN, SCALED }; /* systems of closure rows: see kernel.h */

/* The kernel, first for floats, then for doubles, which `real` means from here on. */
#define NARROW
#define real narrow
#define mask narrow_mask
#define NUMBER float
#define FN(name) name##_narrow
#include "kernel.h"
#undef NARROW
#undef real
#undef mask
#undef NUMBER
#undef FN
#define real wide
#define mask wide_mask
#define NUMBER double
#define FN(name) name##_wide
#include "kernel.h"

#define select(m, yes, no) select_wide(m, yes, no)
#define absolute(x) absolute_wide(x)
#define larger(a, b) larger_wide(a, b)
#define fill(x) fill_wide(x)

INLINE mask fill_mask(int64_t x) { return (mask){0} + x; }

INLINE mask select_mask(mask m, mask yes, mask no) { return (m & yes) | (~m & no); }

INLINE int any(mask m)
{
#if LANES == 8
    return _mm512_movepi64_mask((__m512i)m) != 0;
#elif LANES == 4
    return _mm256_movemask_pd((__m256d)m) != 0;
#elif LANES == 2 && defined(__SSE2__)
    return _mm_movemask_pd((__m128d)m) != 0;
#else
    int64_t r = 0;
    for (int l = 0; l < LANES; l++) r |= m[l];
    return r != 0;
#endif
}

INLINE mask is_finite(real x) { return absolute(x) <= fill(1.7976931348623157e308); }

/* What is known of a row in part is not known: all its numbers become NaN. */
INLINE void whole_or_nan(real *numbers, int count)
{
    mask known = fill_mask(-1);
    for (int k = 0; k < count; k++) known &= is_finite(numbers[k]);
    for (int k = 0; k < count; k++) numbers[k] = select(known, numbers[k], fill(NAN));
}

#endif
