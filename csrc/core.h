/* One ISA's core: every call of calls.h at LANES rows at a time.
 *
 * core_base.c, core_v3.c and core_v4.c each include this with their own LANES and ISA.
 */
#include "elimination.h"
#include "forward.h"
#include "inspect.h"
#include "loaded.h"
#include "motion.h"
#include "frames.h"
#include "pso.h"
#include "readings.h"
#include "serial.h"
#include "chain_response.h"
#include "laws.h"
#include "measured.h"
#include "pulleys.h"
#include "tpr2tps.h"
#include "stream.h"
#include "row_loops.h"
