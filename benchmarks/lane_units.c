/* How fast one core does multiplications with additions, and divisions, of numbers that do not
 * depend on each other: one number at a time, or BYTES at a time. Contraction is off. */
#include <stddef.h>

#define CHAINS 14
typedef double lanes __attribute__((vector_size(BYTES)));

#define LOOP(name, type, step)                                                                    \
    double name(ptrdiff_t steps, double start)                                                    \
    {                                                                                             \
        type x[CHAINS], factor, more;                                                             \
        double first[BYTES / 8] = {0}, sum = 0.0;                                                 \
        factor = (type){0} + 0.999, more = (type){0} + 1e-3 * start;                              \
        for (int c = 0; c < CHAINS; c++) x[c] = (type){0} + start + c;                            \
        for (ptrdiff_t k = 0; k < steps; k++)                                                     \
            for (int c = 0; c < CHAINS; c++) x[c] = step;                                         \
        for (int c = 0; c < CHAINS; c++) {                                                        \
            __builtin_memcpy(first, &x[c], sizeof x[c]);                                          \
            sum += first[0];                                                                      \
        }                                                                                         \
        return sum;                                                                               \
    }

LOOP(multiply_add_one, double, x[c] * factor + more)
LOOP(multiply_add_all, lanes, x[c] * factor + more)
LOOP(divide_one, double, factor / x[c] + more)
LOOP(divide_all, lanes, factor / x[c] + more)
