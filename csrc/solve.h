/* Small linear systems in lanes, by elimination with row exchanges chosen in each lane. */
#ifndef SOLVE_H
#define SOLVE_H

#include "lanes.h"

/* Solve A X = B in place: A is m x m, B is m x k, both row by row; X lands in B.
 * `pivot` is the smallest pivot's magnitude relative to the largest entry of A, NaN if A has NaN:
 * near zero the matrix is singular and X means nothing. */
INLINE void solve(int m, int k, real *A, real *B, real *pivot)
{
    real largest = fill(0.0), reciprocal = fill(0.0);
    for (int i = 0; i < m * m; i++) largest = larger(largest, absolute(A[i]));
    for (int c = 0; c < m; c++) {
        for (int i = c + 1; i < m; i++) {
            const mask swap = absolute(A[i * m + c]) > absolute(A[c * m + c]);
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
        }
        A[c * m + c] = inverse;
    }
    for (int c = m - 1; c >= 0; c--)
        for (int j = 0; j < k; j++) {
            real x = B[c * k + j];
            for (int i = c + 1; i < m; i++) x -= A[c * m + i] * B[i * k + j];
            B[c * k + j] = x * A[c * m + c];
        }
    *pivot = 1.0 / (reciprocal * largest);
}

#endif
