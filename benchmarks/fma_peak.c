/* What one core can do at most: many independent multiply-adds on registers, and nothing else.
 *
 * Compiled once per ISA, with BYTES per vector. Each step is one multiplication and one addition per
 * lane, fused where the ISA has that. Returns a number that depends on all of them. */
#include <stddef.h>

#define CHAINS 16

#define PEAK(name, type)                                                                          \
    double name(ptrdiff_t steps, double start)                                                    \
    {                                                                                             \
        typedef type vector __attribute__((vector_size(BYTES)));                                  \
        enum { N = BYTES / sizeof(type) };                                                        \
        vector sum[CHAINS], factor, more;                                                         \
        double result = 0.0;                                                                      \
        for (int l = 0; l < (int)N; l++) factor[l] = (type)0.999, more[l] = (type)(1e-3 * start); \
        for (int c = 0; c < CHAINS; c++)                                                          \
            for (int l = 0; l < (int)N; l++) sum[c][l] = (type)(start + c);                       \
        for (ptrdiff_t k = 0; k < steps; k++)                                                     \
            for (int c = 0; c < CHAINS; c++) sum[c] = sum[c] * factor + more;                     \
        for (int c = 0; c < CHAINS; c++) result += (double)sum[c][0];                             \
        return result;                                                                            \
    }

PEAK(peak_double, double)
PEAK(peak_float, float)
