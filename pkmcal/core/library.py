"""The compiled core as Python sees it: its names, its ISA, and rows in threads."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import Any

from pkmcal._core import ffi, lib
from pkmcal.arguments import whole
from pkmcal.arrays import FloatArray, Int32Array
from pkmcal.exceptions import ArgumentError


def _text(pointer: Any) -> str:
    return str(ffi.string(pointer).decode())


# One source for these: the derivation, by way of the core.
SLOTS: tuple[str, ...] = tuple(_text(lib.pkm_slot_names()).split())
DRIVERS: tuple[str, ...] = tuple(_text(lib.pkm_driver_names()).split())
ROWS: tuple[str, ...] = tuple(_text(lib.pkm_row_names()).split())
MAPS: dict[str, tuple[str, ...]] = {
    name: tuple(free.split())
    for name, free in zip(
        _text(lib.pkm_map_names()).split(), _text(lib.pkm_map_free()).split(";"), strict=True
    )
}
POSE = ("x", "y", "z", "alpha", "beta", "gamma")
MAX_LIMBS: int = lib.PKM_MAX_LIMBS
ISAS = ("base", "avx2", "avx512")
STATUS = {
    lib.PKM_OK: "ok",
    lib.PKM_NOT_CONVERGED: "not converged",
    lib.PKM_SINGULAR: "singular",
    lib.PKM_INFEASIBLE: "infeasible",
    lib.PKM_INVALID: "invalid input",
}
ROWS_PER_THREAD = 10_000  # fewer do not pay for a thread
PARTS_PER_THREAD = 4  # one that another program keeps waiting leaves parts to the others


def _default_isa() -> int:
    wanted = os.environ.get("PKMCAL_ISA")
    if not wanted:
        return int(lib.pkm_best_isa())
    if wanted not in ISAS:
        raise ArgumentError(f"PKMCAL_ISA must be one of {', '.join(ISAS)}, found {wanted!r}")
    if ISAS.index(wanted) > lib.pkm_best_isa():
        raise ArgumentError(f"PKMCAL_ISA={wanted}: this processor has no {wanted}")
    return ISAS.index(wanted)


ISA = _default_isa()


# C pointer to a contiguous array of float64, or int32; it keeps the array alive.
pointer: Callable[[FloatArray], Any] = partial(ffi.from_buffer, "double *")
int_pointer: Callable[[Int32Array], Any] = partial(ffi.from_buffer, "int32_t *")


def ensure(code: int) -> None:
    """Raise ValueError where the core refused a call."""
    if code < 0:
        raise ArgumentError(f"the core refused the call (code {code})")


def in_threads(call: Callable[[int, int], int], rows: int, threads: int | None) -> None:
    """Run ``call(start, stop)`` over contiguous parts of the rows, in threads.

    Parameters
    ----------
    call : callable
        Returns the core's code: 0, or negative for a bad call.
    rows : int
        Number of rows.
    threads : int or None
        None takes as many as pay.
    """
    if threads is None:
        threads = rows // ROWS_PER_THREAD
        threads = min(threads, len(os.sched_getaffinity(0))) if threads > 1 else 1
    else:
        threads = min(whole("threads", threads, 1, note=" or None"), max(rows, 1))
    if threads == 1:
        return ensure(call(0, rows))
    count = min(rows, PARTS_PER_THREAD * threads)
    parts = pairwise([rows * k // count for k in range(count + 1)])
    codes: list[int] = []

    def work() -> None:
        for start, stop in parts:  # whoever is free takes the next
            codes.append(call(start, stop))

    others = [threading.Thread(target=work) for _ in range(threads - 1)]
    for thread in others:
        thread.start()
    work()
    for thread in others:
        thread.join()
    ensure(min(codes))
