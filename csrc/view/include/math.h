/* What the core needs of math.h where there is no C library: instructions of WebAssembly. */
#define NAN __builtin_nanf("")
#define INFINITY __builtin_inff()
#define sqrt __builtin_sqrt
#define sqrtf __builtin_sqrtf
#define fabs __builtin_fabs
#define fmax(a, b) ((a) > (b) ? (a) : (b))
#define isnan(x) __builtin_isnan(x)
#define isfinite(x) __builtin_isfinite(x)
