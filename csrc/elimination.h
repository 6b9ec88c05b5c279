/* Poses are nuisance parameters (pkmcal/estimation/elimination.py): their steps and normal equations,
 * and what is left of other columns of their equations when each pose has taken its own part. */
#ifndef ELIMINATION_H
#define ELIMINATION_H

#include <float.h>

#include "rows.h"

#define RIDGE 1e-13 /* of the normal matrix, for unknowns that no equation has */

/* The equations of LANES poses: of each as many as it has, behind them rows of zeros. */
typedef struct {
    const int64_t *own[LANES];
    ptrdiff_t count[LANES], least, most;
} pose_equations;

INLINE pose_equations equations_of(const ptrdiff_t row[LANES], const int64_t *first,
                                   const int64_t *order)
{
    pose_equations of = {.least = PTRDIFF_MAX, .most = 0};
    for (int l = 0; l < LANES; l++) {
        of.own[l] = order + first[row[l]];
        of.count[l] = first[row[l] + 1] - first[row[l]];
        if (of.count[l] < of.least) of.least = of.count[l];
        if (of.count[l] > of.most) of.most = of.count[l];
    }
    return of;
}

/* One number of equation j of each pose. */
INLINE real equation(const pose_equations *of, ptrdiff_t j, const double *column, ptrdiff_t stride)
{
    real r = {0};
    for (int l = 0; l < LANES; l++)
        if (j < of->count[l]) r[l] = column[stride * of->own[l][j]];
    return r;
}

/* A number for equation j of each pose that has so many: rows behind a pose's own stay zeros, also
 * where its own numbers are not finite. */
INLINE real owned(const pose_equations *of, ptrdiff_t j, real x)
{
    if (j >= of->least)
        for (int l = 0; l < LANES; l++)
            if (j >= of->count[l]) x[l] = 0.0;
    return x;
}

/* Numbers in lanes, in memory that the caller lends. */
INLINE real at(const double *work, ptrdiff_t i) { return load(work + LANES * i); }
INLINE void put(real x, double *work, ptrdiff_t i) { store(x, work + LANES * i); }

int CALL(pose_normals)(ptrdiff_t n, int unknowns, const int64_t *first, const int64_t *order,
                       const double *residual, const double *by_unknown, double *matrix,
                       double *pull, double *cost, double *work)
{
    const ptrdiff_t u = unknowns, width = u + 1;
    EACH_BLOCK(start, n, row, count) {
        const pose_equations of = equations_of(row, first, order);
        for (ptrdiff_t j = 0; j < of.most; j++) {
            for (ptrdiff_t a = 0; a < u; a++)
                put(equation(&of, j, by_unknown + a, u), work, j * width + a);
            put(equation(&of, j, residual, 1), work, j * width + u);
        }
        for (ptrdiff_t a = 0; a <= u; a++)
            for (ptrdiff_t b = 0; b <= a; b++) {
                real sum = fill(0.0);
                for (ptrdiff_t j = 0; j < of.most; j++)
                    sum += at(work, j * width + a) * at(work, j * width + b);
                if (a == u && b == u) {
                    scatter(sum, cost, 1, row, count);
                } else if (a == u) {
                    scatter(sum, pull + b, u, row, count);
                } else {
                    scatter(sum, matrix + a * u + b, u * u, row, count);
                    scatter(sum, matrix + b * u + a, u * u, row, count);
                }
            }
    }
    return 0;
}

/* x of (L D Lᵀ) x = b in place, with the factors of a positive matrix (u x u) in its place. */
INLINE void solve_positive(ptrdiff_t u, double *A, double *b)
{
    for (ptrdiff_t c = 0; c < u; c++) {
        for (ptrdiff_t i = c; i < u; i++) {
            real sum = at(A, i * u + c);
            for (ptrdiff_t k = 0; k < c; k++)
                sum -= at(A, i * u + k) * at(A, c * u + k) * at(A, k * u + k);
            put(i == c ? sum : sum / at(A, c * u + c), A, i * u + c);
        }
        real sum = at(b, c);
        for (ptrdiff_t k = 0; k < c; k++) sum -= at(A, c * u + k) * at(b, k);
        put(sum, b, c);
    }
    for (ptrdiff_t c = u - 1; c >= 0; c--) {
        real sum = at(b, c) / at(A, c * u + c);
        for (ptrdiff_t i = c + 1; i < u; i++) sum -= at(A, i * u + c) * at(b, i);
        put(sum, b, c);
    }
}

/* A column of `most` numbers, `stride` apart, in mirror a. */
INLINE void reflect(const pose_equations *of, ptrdiff_t u, ptrdiff_t a, const double *vectors,
                    double *column, ptrdiff_t stride)
{
    real along = fill(0.0);
    for (ptrdiff_t j = a; j < of->most; j++)
        along += at(vectors, j * u + a) * at(column, j * stride);
    for (ptrdiff_t j = a; j < of->most; j++) {
        const real x = at(column, j * stride) - along * at(vectors, j * u + a);
        put(owned(of, j, x), column, j * stride);
    }
}

/* Householder's mirrors, one a column and as many as unknowns, each normal to a vector of length √2
 * that stands in that column from its first row on: one after another they take the derivatives by
 * the unknowns (most x u) to a triangle. Above the vectors is what is above its diagonal. */
INLINE void mirrors(const pose_equations *of, ptrdiff_t u, const double *by_unknown, double *vectors,
                    double *diagonal)
{
    for (ptrdiff_t j = 0; j < of->most; j++)
        for (ptrdiff_t a = 0; a < u; a++)
            put(equation(of, j, by_unknown + a, u), vectors, j * u + a);
    for (ptrdiff_t a = 0; a < u && a < of->most; a++) {
        real square = fill(0.0);
        for (ptrdiff_t j = a; j < of->most; j++) square += at(vectors, j * u + a) * at(vectors, j * u + a);
        const real top = at(vectors, a * u + a), length = FN(root)(square);
        const real away = select(top < fill(0.0), -length, length);
        const mask none = square == fill(0.0);
        const real half = square + length * absolute(top); /* of the squared length of the vector */
        const real scale = FN(root)(select(none, fill(0.0), 1.0 / half));
        put(-away, diagonal, a);
        put(top + away, vectors, a * u + a);
        for (ptrdiff_t j = a; j < of->most; j++)
            put(owned(of, j, scale * at(vectors, j * u + a)), vectors, j * u + a);
        for (ptrdiff_t b = a + 1; b < u; b++) reflect(of, u, a, vectors, vectors + LANES * b, u);
    }
}

/* The triangle that mirrors leave: its number in row a and column b, a <= b. */
INLINE real triangle(ptrdiff_t u, const double *vectors, const double *diagonal, ptrdiff_t a,
                     ptrdiff_t b)
{
    return a == b ? at(diagonal, a) : at(vectors, a * u + b);
}

int CALL(pose_triangle)(ptrdiff_t n, int unknowns, const int64_t *first, const int64_t *order,
                        const double *by_unknown, double *factor, double *work)
{
    const ptrdiff_t u = unknowns;
    double *diagonal = work, *vectors = work + LANES * u;
    EACH_BLOCK(start, n, row, count) {
        const pose_equations of = equations_of(row, first, order);
        mirrors(&of, u, by_unknown, vectors, diagonal);
        for (ptrdiff_t a = 0; a < u; a++)
            for (ptrdiff_t b = 0; b < u; b++) {
                const int there = a <= b && a < of.most;
                const real x = there ? triangle(u, vectors, diagonal, a, b) : fill(0.0);
                scatter(owned(&of, a, x), factor + a * u + b, u * u, row, count);
            }
    }
    return 0;
}

int CALL(pose_fit)(ptrdiff_t n, int unknowns, const int64_t *first, const int64_t *order,
                   const double *residual, const double *by_unknown, const double *damping,
                   double least, double rounding, const int64_t *place, double *step, double *gain,
                   double *cost, double *left, double *work)
{
    const ptrdiff_t u = unknowns;
    double *diagonal = work, *A = diagonal + LANES * u, *x = A + LANES * u * u;
    double *vectors = x + LANES * u;
    EACH_BLOCK(start, n, row, count) {
        const pose_equations of = equations_of(row, first, order);
        const ptrdiff_t rank = u < of.most ? u : of.most;
        const real damp = gather(damping, 1, row);
        double *column = vectors + LANES * of.most * u;
        real squares = fill(0.0), trace = fill(0.0), gained = fill(0.0);
        mask known = fill_mask(-1);
        mirrors(&of, u, by_unknown, vectors, diagonal);
        for (ptrdiff_t j = 0; j < of.most; j++) {
            const real r = equation(&of, j, residual, 1);
            squares += r * r;
            put(r, column, j);
        }
        for (ptrdiff_t a = 0; a < rank; a++) reflect(&of, u, a, vectors, column, 1);
        for (int l = 0; l < count; l++)
            for (ptrdiff_t j = u; j < of.count[l]; j++) left[place[row[l]] + j - u] = at(column, j)[l];
        for (ptrdiff_t a = 0; a < u; a++) {
            real pull = fill(0.0);
            for (ptrdiff_t b = 0; b <= a; b++) {
                real sum = fill(0.0);
                for (ptrdiff_t k = 0; k <= b && k < rank; k++)
                    sum += triangle(u, vectors, diagonal, k, a) * triangle(u, vectors, diagonal, k, b);
                known &= is_finite(sum);
                put(sum, A, a * u + b);
            }
            for (ptrdiff_t k = 0; k <= a && k < rank; k++)
                pull += triangle(u, vectors, diagonal, k, a) * at(column, k);
            known &= is_finite(pull);
            trace += at(A, a * (u + 1));
            put(-pull, x, a);
        }
        for (ptrdiff_t a = 0; a < u; a++) {
            const real size = at(A, a * (u + 1));
            put(size + (damp * size + (RIDGE * trace + DBL_MIN)), A, a * (u + 1));
        }
        solve_positive(u, A, x);
        for (ptrdiff_t k = 0; k < rank; k++) {
            real along = fill(0.0);
            for (ptrdiff_t b = k; b < u; b++) along += triangle(u, vectors, diagonal, k, b) * at(x, b);
            gained -= along * (2.0 * at(column, k) + along);
        }
        const real rounded = rounding * FN(root)(trace);
        const real floor = rounded * (rounded + FN(root)(squares));
        const mask gains = known & (gained > least * squares + floor);
        for (ptrdiff_t a = 0; a < u; a++)
            scatter(select(gains, at(x, a), fill(0.0)), step + a, u, row, count);
        scatter(select(known, select(gains, gained, fill(0.0)), fill(NAN)), gain, 1, row, count);
        scatter(squares, cost, 1, row, count);
    }
    return 0;
}

int CALL(pose_left)(ptrdiff_t n, int unknowns, const int64_t *first, const int64_t *order,
                    const double *by_unknown, int columns, const double *part, const int64_t *place,
                    double *left, double *following, double *work)
{
    const ptrdiff_t u = unknowns;
    double *diagonal = work, *vectors = work + LANES * u;
    EACH_BLOCK(start, n, row, count) {
        const pose_equations of = equations_of(row, first, order);
        double *column = vectors + LANES * of.most * u;
        mirrors(&of, u, by_unknown, vectors, diagonal);
        for (ptrdiff_t c = 0; c < columns; c++) {
            for (ptrdiff_t j = 0; j < of.most; j++)
                put(equation(&of, j, part + c, columns), column, j);
            for (ptrdiff_t a = 0; a < u && a < of.most; a++) reflect(&of, u, a, vectors, column, 1);
            for (int l = 0; l < count; l++)
                for (ptrdiff_t j = u; j < of.count[l]; j++)
                    left[(place[row[l]] + j - u) * columns + c] = at(column, j)[l];
            for (ptrdiff_t a = u - 1; a >= 0; a--) {
                real sum = fill(NAN); /* fewer equations than unknowns: nothing follows */
                if (u <= of.most) {
                    sum = -at(column, a);
                    for (ptrdiff_t b = a + 1; b < u; b++)
                        sum -= at(vectors, a * u + b) * at(column, b);
                    sum /= at(diagonal, a); /* 0 of poses with fewer */
                    put(sum, column, a);
                }
                scatter(sum, following + a * columns + c, u * columns, row, count);
            }
        }
    }
    return 0;
}

int CALL(pose_spread)(ptrdiff_t n, int unknowns, const int64_t *first, const int64_t *order,
                      const double *by_unknown, int columns, const int64_t *place,
                      const double *left, double *part, double *work)
{
    const ptrdiff_t u = unknowns;
    double *diagonal = work, *vectors = work + LANES * u;
    EACH_BLOCK(start, n, row, count) {
        const pose_equations of = equations_of(row, first, order);
        double *column = vectors + LANES * of.most * u;
        mirrors(&of, u, by_unknown, vectors, diagonal);
        for (ptrdiff_t c = 0; c < columns; c++) {
            for (ptrdiff_t j = 0; j < of.most; j++) {
                real x = fill(0.0);
                for (int l = 0; l < LANES; l++)
                    if (j >= u && j < of.count[l]) x[l] = left[(place[row[l]] + j - u) * columns + c];
                put(x, column, j);
            }
            for (ptrdiff_t a = (u < of.most ? u : of.most) - 1; a >= 0; a--)
                reflect(&of, u, a, vectors, column, 1);
            for (int l = 0; l < count; l++)
                for (ptrdiff_t j = 0; j < of.count[l]; j++)
                    part[(first[row[l]] + j) * columns + c] = at(column, j)[l];
        }
    }
    return 0;
}

#endif
