/* Rows of arrays into lanes, one to a lane, and back. */
#ifndef ROWS_H
#define ROWS_H

#include "lanes.h"

/* LANES numbers one after another in memory. */
INLINE real load(const double *from)
{
    real r;
    memcpy(&r, from, sizeof r);
    return r;
}

INLINE void store(real x, double *to) { memcpy(to, &x, sizeof x); }

/* One number of each of the given rows of a row-major array. */
INLINE real gather(const double *column, ptrdiff_t stride, const ptrdiff_t *row)
{
    real r = {0};
    for (int l = 0; l < LANES; l++) r[l] = column[stride * row[l]];
    return r;
}

/* The reverse, for the first `count` lanes. */
INLINE void scatter(real x, double *column, ptrdiff_t stride, const ptrdiff_t *row, int count)
{
    double lane[LANES];
    memcpy(lane, &x, sizeof lane);
    if (count == LANES)
        for (int l = 0; l < LANES; l++) column[stride * row[l]] = lane[l];
    else
        for (int l = 0; l < count; l++) column[stride * row[l]] = lane[l];
}

/* A tile of LANES rows by LANES numbers, where turning it beats gathering number by number. */
#if LANES == 8
#define TILE 8
#define LEAST_PART 3 /* numbers of a row that are worth a tile */
typedef __m512d tile_row;

INLINE tile_row load_part(const double *from, int part)
{
    return _mm512_maskz_loadu_pd((__mmask8)((1 << part) - 1), from);
}

INLINE void store_part(double *to, int part, tile_row x)
{
    _mm512_mask_storeu_pd(to, (__mmask8)((1 << part) - 1), x);
}

/* Rows to columns, or back. */
INLINE void transpose(tile_row tile[8])
{
    tile_row pair[8], four[8];
    for (int k = 0; k < 8; k += 2) {
        pair[k] = _mm512_unpacklo_pd(tile[k], tile[k + 1]);
        pair[k + 1] = _mm512_unpackhi_pd(tile[k], tile[k + 1]);
    }
    for (int k = 0; k < 8; k += 4)
        for (int j = 0; j < 2; j++) {
            four[k + j] = _mm512_shuffle_f64x2(pair[k + j], pair[k + 2 + j], 0x88);
            four[k + 2 + j] = _mm512_shuffle_f64x2(pair[k + j], pair[k + 2 + j], 0xdd);
        }
    for (int j = 0; j < 4; j++) {
        tile[j] = _mm512_shuffle_f64x2(four[j], four[4 + j], 0x88);
        tile[4 + j] = _mm512_shuffle_f64x2(four[j], four[4 + j], 0xdd);
    }
}
#elif LANES == 4
#define TILE 4
#define LEAST_PART 4
typedef __m256d tile_row;

INLINE tile_row load_part(const double *from, int part) { return (void)part, _mm256_loadu_pd(from); }

INLINE void store_part(double *to, int part, tile_row x) { (void)part, _mm256_storeu_pd(to, x); }

INLINE void transpose(tile_row tile[4])
{
    tile_row pair[4];
    for (int k = 0; k < 4; k += 2) {
        pair[k] = _mm256_unpacklo_pd(tile[k], tile[k + 1]);
        pair[k + 1] = _mm256_unpackhi_pd(tile[k], tile[k + 1]);
    }
    for (int j = 0; j < 2; j++) {
        tile[j] = _mm256_permute2f128_pd(pair[j], pair[2 + j], 0x20);
        tile[2 + j] = _mm256_permute2f128_pd(pair[j], pair[2 + j], 0x31);
    }
}
#endif

/* The first `width` numbers of the given rows, `stride` apart: 0 where all rows share them. */
INLINE void gather_row(const double *array, ptrdiff_t stride, int width, const ptrdiff_t *row,
                       real *out)
{
    int k = 0;
#ifdef TILE
    for (; k + LEAST_PART <= width; k += TILE) {
        const int part = width - k < TILE ? width - k : TILE;
        tile_row tile[TILE];
        for (int l = 0; l < TILE; l++) tile[l] = load_part(array + k + stride * row[l], part);
        transpose(tile);
        for (int j = 0; j < TILE; j++)
            if (j < part) out[k + j] = (real)tile[j];
    }
#endif
    for (; k < width; k++) out[k] = gather(array + k, stride, row);
}

/* The reverse, for the first `count` lanes. */
INLINE void scatter_row(const real *values, int width, double *array, ptrdiff_t stride,
                        const ptrdiff_t *row, int count)
{
    int k = 0;
#ifdef TILE
    for (; k + LEAST_PART <= width; k += TILE) {
        const int part = width - k < TILE ? width - k : TILE;
        tile_row tile[TILE];
        for (int j = 0; j < TILE; j++) tile[j] = (tile_row)values[k + (j < part ? j : 0)];
        transpose(tile);
        for (int l = 0; l < TILE; l++)
            if (l < count) store_part(array + k + stride * row[l], part, tile[l]);
    }
#endif
    for (; k < width; k++) scatter(values[k], array + k, stride, row, count);
}

/* Rows start, start + 1, ... of n; lanes past the last repeat it. Returns how many are real. */
INLINE int block_rows(ptrdiff_t start, ptrdiff_t n, ptrdiff_t row[LANES])
{
    for (int l = 0; l < LANES; l++) row[l] = start + l < n ? start + l : n - 1;
    return n - start < LANES ? (int)(n - start) : LANES;
}

/* The loop over n rows, a block at a time: `first` is its first row, `row` those of its lanes, `count` how
 * many of them are real. */
#define EACH_BLOCK(first, n, row, count)                                                            \
    for (ptrdiff_t first = 0, row[LANES], count;                                                    \
         first < (n) && (count = block_rows(first, n, row)) > 0; first += LANES)

#endif
