/* The core for a page: one row at a time, the machine as data, for WebAssembly without a C library.
 *
 * The page writes a machine into `room` as pkmcal/view/memory.py lays it out, and calls `begin`. Then
 * it writes numbers into arrays and calls for others; at(k) says where array k is. The calls return a
 * status of pkmcal.h, or a negative number for a machine that does not fit.
 */
#ifndef VIEW_H
#define VIEW_H

#include "pkmcal.h"
#define LANES 1
#define JOINED 1
#define ISA base

#define EXPORT __attribute__((visibility("default")))

enum { ROOM = 32768 };
static _Alignas(8) unsigned char room[ROOM];
static ptrdiff_t first_row[1] = {0};

EXPORT void *machine_room(void) { return room; }

#endif
