/* The core for x86-64-v4 (AVX-512): 512-bit lanes. Empty elsewhere. */
#include "pkmcal.h"
#ifdef __x86_64__
#if defined _WIN32 && !defined __clang__
#error "gcc misaligns vectors on the stack of Windows (GCC bug 54412): use clang, as `make wheels` does"
#endif
#ifdef __clang__
#pragma clang attribute push(__attribute__((target("arch=x86-64-v4"))), apply_to = function)
#else
#pragma GCC target("arch=x86-64-v4")
#endif
#define LANES 8
#define ISA avx512
#include "core.h"
#ifdef __clang__
#pragma clang attribute pop
#endif
#endif
