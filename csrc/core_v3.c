/* The core for x86-64-v3 (AVX2): 256-bit lanes. Empty elsewhere. */
#include "pkmcal.h"
#ifdef __x86_64__
#if defined _WIN32 && !defined __clang__
#error "gcc misaligns vectors on the stack of Windows (GCC bug 54412): use clang, as `make wheels` does"
#endif
#ifdef __clang__
#pragma clang attribute push(__attribute__((target("arch=x86-64-v3"))), apply_to = function)
#else
#pragma GCC target("arch=x86-64-v3")
#endif
#define LANES 4
#define ISA avx2
#include "core.h"
#ifdef __clang__
#pragma clang attribute pop
#endif
#endif
