/* Small linear systems in lanes, by elimination with row exchanges chosen in each lane. */
#ifndef SOLVE_H
#define SOLVE_H

#include "lanes.h"

/* LU of A (m x m, row by row) in place, and what that makes of B (m x k); the exchanges of each lane
 * land in `swaps` (m x m) unless it is NULL. `pivot` is the smallest pivot's magnitude relative to the
 * largest entry of A, NaN if A has NaN: near zero the matrix is singular. */
INLINE void eliminate(int m, int k, real *A, real *B, mask *swaps, real *pivot)
{
    real largest = fill(0.0), reciprocal = fill(0.0);
    for (int i = 0; i < m * m; i++) largest = larger(largest, absolute(A[i]));
    for (int c = 0; c < m; c++) {
        for (int i = c + 1; i < m; i++) {
            const mask swap = absolute(A[i * m + c]) > absolute(A[c * m + c]);
            if (swaps) swaps[i * m + c] = swap;
            for (int j = c; j < m; j++) {
                const real a = A[c * m + j], b = A[i * m + j];
                A[c * m + j] = select(swap, b, a);
                A[i * m + j] = select(swap, a, b);
            }
            for (int j = 0; j < k; j++) {
                const real a = B[c * k + j], b = B[i * k + j];
                B[c * k + j] = select(swap, b, a);
                B[i * k + j] = select(swap, a, b);
            }
        }
        const real inverse = 1.0 / A[c * m + c];
        reciprocal = larger(reciprocal, absolute(inverse));
        for (int i = c + 1; i < m; i++) {
            const real factor = A[i * m + c] * inverse;
            for (int j = c + 1; j < m; j++) A[i * m + j] -= factor * A[c * m + j];
            for (int j = 0; j < k; j++) B[i * k + j] -= factor * B[c * k + j];
            A[i * m + c] = factor;
        }
        A[c * m + c] = inverse;
    }
    *pivot = 1.0 / (reciprocal * largest);
}

/* With the upper factor, X in place of what elimination made of B. */
INLINE void back_substitute(int m, int k, const real *A, real *B)
{
    for (int c = m - 1; c >= 0; c--)
        for (int j = 0; j < k; j++) {
            real x = B[c * k + j];
            for (int i = c + 1; i < m; i++) x -= A[c * m + i] * B[i * k + j];
            B[c * k + j] = x * A[c * m + c];
        }
}

/* Solve A X = B in place: A is m x m, B is m x k; X lands in B, and means nothing near a `pivot` of 0. */
INLINE void solve(int m, int k, real *A, real *B, real *pivot)
{
    eliminate(m, k, A, B, NULL, pivot);
    back_substitute(m, k, A, B);
}

/* Solve A x = b in place with the factors that elimination left. */
INLINE void solve_again(int m, const real *A, const mask *swaps, real *b)
{
    for (int c = 0; c < m; c++) {
        for (int i = c + 1; i < m; i++) {
            const real above = b[c], below = b[i];
            b[c] = select(swaps[i * m + c], below, above);
            b[i] = select(swaps[i * m + c], above, below);
        }
        for (int i = c + 1; i < m; i++) b[i] -= A[i * m + c] * b[c];
    }
    back_substitute(m, 1, A, b);
}

#endif
