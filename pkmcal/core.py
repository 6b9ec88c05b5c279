"""The compiled core as Python sees it: its names, its ISA, rows in threads, and frames."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pkmcal._core import ffi, lib
from pkmcal.arguments import shown, whole

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]


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
        raise ValueError(f"PKMCAL_ISA must be one of {', '.join(ISAS)}, found {wanted!r}")
    if ISAS.index(wanted) > lib.pkm_best_isa():
        raise ValueError(f"PKMCAL_ISA={wanted}: this processor has no {wanted}")
    return ISAS.index(wanted)


ISA = _default_isa()


def as_numbers(name: str, array: ArrayLike, last: str | int) -> NDArray[Any]:
    """Numbers of any kind as an array; `last` axes are for the message of a ragged list.

    Raises
    ------
    TypeError
        Not numbers.
    ValueError
        A ragged list.
    """
    try:
        given = np.asarray(array)
    except ValueError:
        raise ValueError(f"{name} must have shape (..., {last}), found a ragged list") from None
    if given.dtype.kind not in "iuf":
        alone = not isinstance(array, np.ndarray | list | tuple)
        found = shown(array) if alone else f"dtype {given.dtype}"
        raise TypeError(f"{name} must be an array of numbers, found {found}")
    return given


def as_rows(name: str, array: ArrayLike, width: int) -> tuple[FloatArray, tuple[int, ...]]:
    """Numbers (..., width) as contiguous float64 rows (N, width), and the leading shape.

    Raises
    ------
    TypeError
        Not numbers.
    ValueError
        Another last axis.
    """
    given = as_numbers(name, array, width)
    if given.ndim == 0 or given.shape[-1] != width:
        raise ValueError(f"{name} must have shape (..., {width}), found {given.shape}")
    return as_doubles(given).reshape(-1, width), given.shape[:-1]


def as_doubles(given: NDArray[Any]) -> FloatArray:
    """The same numbers as the core reads them: float64, one behind the other, aligned."""
    doubles = np.ascontiguousarray(given, dtype=np.float64)
    return doubles if doubles.flags.aligned else doubles.copy()


# C pointer to a contiguous array of float64, or int32; it keeps the array alive.
pointer: Callable[[FloatArray], Any] = partial(ffi.from_buffer, "double *")
int_pointer: Callable[[IntArray], Any] = partial(ffi.from_buffer, "int32_t *")


def ensure(code: int) -> None:
    """Raise ValueError where the core refused a call."""
    if code < 0:
        raise ValueError(f"the core refused the call (code {code})")


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


def tpr2tps_lengths(size: FloatArray, free: FloatArray, out: FloatArray) -> None:
    """Eq. 8 in closed form: `free` (N, 4) to lengths `out` (N, 4)."""
    lib.pkm_tpr2tps_lengths(ISA, len(free), pointer(size), pointer(free), pointer(out))


def tpr2tps_jacobian(size: FloatArray, free: FloatArray, out: FloatArray) -> None:
    """Eq. 12 in closed form: `free` (N, 4) to derivatives `out` (N, 4, 4)."""
    lib.pkm_tpr2tps_jacobian(ISA, len(free), pointer(size), pointer(free), pointer(out))


def compose(a: FloatArray, b: FloatArray) -> FloatArray:
    """Pose A followed by pose B: (6,) and (N, 6), or (N, 6) and (6,), to (N, 6)."""
    n = len(b) if b.ndim == 2 else len(a)
    out = np.empty((n, 6))
    if n:
        strides = (6 if a.ndim == 2 else 0, 6 if b.ndim == 2 else 0)
        lib.pkm_compose(ISA, n, pointer(a), strides[0], pointer(b), strides[1], pointer(out))
    return out


def invert(a: FloatArray) -> FloatArray:
    """The inverse of a pose (6,)."""
    out = np.empty(6)
    lib.pkm_invert(ISA, 1, pointer(a), pointer(out))
    return out


def compose_rates(
    a: FloatArray, pose: FloatArray, c: FloatArray, composed: FloatArray
) -> FloatArray:
    """Rates (N, 6, 6) of A T C by those of T, for T = `pose` and A T C = `composed`, (N, 6).

    A is (6,); C is (6,) or (N, 6).
    """
    n, out = len(pose), np.empty((len(pose), 6, 6))
    if n:
        lib.pkm_compose_rates(
            ISA,
            n,
            pointer(a),
            pointer(pose),
            pointer(c),
            6 if c.ndim == 2 else 0,
            pointer(composed),
            pointer(out),
        )
    return out


def compose_twists(a: FloatArray, pose: FloatArray, c: FloatArray) -> FloatArray:
    """Twists (N, 6, 6) of A T C by those of T, for T = `pose` (N, 6); A and C are (6,)."""
    n, out = len(pose), np.empty((len(pose), 6, 6))
    if n:
        lib.pkm_compose_twists(ISA, n, pointer(a), pointer(pose), pointer(c), pointer(out))
    return out
