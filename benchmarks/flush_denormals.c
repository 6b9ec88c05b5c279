/* Numbers too small for full precision count as 0, or not, in this thread.
 *
 * Two floats leave half of a register unused, and what is left there may be such a number: harmless,
 * but it costs a processor's assistance at every instruction. */
#ifdef __SSE2__
#include <immintrin.h>

void flush_denormals(int on)
{
    const unsigned flush_and_zero = 0x8040;
    _mm_setcsr(on ? _mm_getcsr() | flush_and_zero : _mm_getcsr() & ~flush_and_zero);
}
#else
void flush_denormals(int on) { (void)on; }
#endif
