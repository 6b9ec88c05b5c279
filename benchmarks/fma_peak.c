/* What one core can do at most: multiplications and additions on registers, and nothing else.
 *
 * Compiled once per ISA, with BYTES per vector. `fused` does one multiply-add per lane and step on
 * each of twelve chains, in one instruction where the ISA has that. `apart` does a multiplication on
 * half of them and an addition on the others: processors with adders beside their multipliers do as
 * many of those as fused ones. The chains are variables, for gcc keeps an array in memory, and with
 * the two constants fit into sixteen registers. Both return a number that depends on all of them. */
#include <stddef.h>

#define HALF(X) X(a) X(b) X(c) X(d) X(e) X(f)
#define OTHER(X) X(g) X(h) X(i) X(j) X(k) X(l)

#define PEAK(name, type, DO, DO_OTHER)                                                                \
    double name(ptrdiff_t steps, double start)                                                    \
    {                                                                                             \
        typedef type vector __attribute__((vector_size(BYTES)));                                  \
        const vector none = {0}, more = none + (type)start;                                       \
        vector factor = none + 1; /* so that nothing becomes denormal */                          \
        KEEP(factor)                                                                              \
        HALF(BEGIN) OTHER(BEGIN)                                                                  \
        for (ptrdiff_t step = 0; step < steps; step++) { HALF(DO) OTHER(DO_OTHER) }               \
        return 0.0 HALF(SUM) OTHER(SUM);                                                          \
    }

#ifdef __x86_64__
#define KEEP(x) __asm__ volatile("" : "+x"(x)); /* in a register, and not worked out beforehand */
#else
#define KEEP(x) __asm__ volatile("" : "+w"(x));
#endif
#define BEGIN(x) vector x = more; KEEP(x)
#define MULTIPLY_ADD(x) x = x * factor + more; KEEP(x)
#define MULTIPLY(x) x = x * factor; KEEP(x)
#define ADD(x) x = x + more; KEEP(x)
#define SUM(x) + x[0]

PEAK(fused_double, double, MULTIPLY_ADD, MULTIPLY_ADD)
PEAK(fused_float, float, MULTIPLY_ADD, MULTIPLY_ADD)
PEAK(apart_double, double, MULTIPLY, ADD)
PEAK(apart_float, float, MULTIPLY, ADD)
