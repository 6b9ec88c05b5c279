/* Numbers too small for full precision count as 0, or not, in this thread: see bench_denormals.py. */
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
