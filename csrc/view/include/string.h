/* What the core needs of string.h where there is no C library: instructions of WebAssembly. */
#include <stddef.h>
void *memcpy(void *, const void *, size_t);
void *memmove(void *, const void *, size_t);
void *memset(void *, int, size_t);
