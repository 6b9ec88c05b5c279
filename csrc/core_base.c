/* The core for any processor: 128-bit lanes. */
#define LANES 2
#define CORE pkm_base
#include "core.h"
