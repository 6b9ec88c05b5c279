"""The compiled core as Python sees it: its names, its ISA, its calls, and rows in threads."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pkmcal._core import ffi, lib
from pkmcal.arguments import whole
from pkmcal.arrays import FloatArray, Unit
from pkmcal.exceptions import ArgumentError


def _text(pointer: Any) -> str:
    return str(ffi.string(pointer).decode())


# One source for these: the derivation, by way of the core.
SLOTS: tuple[str, ...] = tuple(_text(lib.pkm_slot_names()).split())
AXES: dict[str, tuple[str, ...]] = {  # and the slots of their tilts
    name: tuple(tilts) for name, *tilts in map(str.split, _text(lib.pkm_axis_names()).split(";"))
}
DRIVERS: tuple[str, ...] = tuple(_text(lib.pkm_driver_names()).split())
ROWS: dict[str, tuple[str, ...]] = {  # beside the sphere, and the axes that they have
    name: tuple(axes) for name, *axes in map(str.split, _text(lib.pkm_row_names()).split(";"))
}
MAPS: dict[str, tuple[str, ...]] = {
    name: tuple(free.split())
    for name, free in zip(
        _text(lib.pkm_map_names()).split(), _text(lib.pkm_map_free()).split(";"), strict=True
    )
}
POSE = ("x", "y", "z", "alpha", "beta", "gamma")
COORDINATE_UNITS: dict[str, Unit] = {name: "mm" if name in "xyz" else "rad" for name in POSE}
MAX_LIMBS: int = lib.PKM_MAX_LIMBS
ISAS = ("base", "avx2", "avx512")
STATUS = {
    lib.PKM_OK: "ok",
    lib.PKM_NOT_CONVERGED: "not converged",
    lib.PKM_SINGULAR: "singular",
    lib.PKM_INFEASIBLE: "infeasible",
    lib.PKM_INVALID: "invalid input",
    lib.PKM_NOT_CLOSED: "does not close",
    lib.PKM_GIVES_WAY: "gives way",
}
NOT_CONVERGED: int = lib.PKM_NOT_CONVERGED
GIVES_WAY: int = lib.PKM_GIVES_WAY
ROWS_PER_THREAD = 10_000  # fewer do not pay for a thread
MOST_THREADS = 256  # whatever is asked for
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


def _of_arrays(function: Any) -> Callable[..., int]:
    """A function of the core that takes arrays, or None, where C takes pointers to numbers.

    Written out for its arguments: for a call of one row, looking at each costs as much as the call.
    """
    numbers = {ffi.typeof(f"{name} *") for name in ("double", "int32_t", "int64_t", "uint64_t")}
    kinds = [argument if argument in numbers else None for argument in ffi.typeof(function).args]
    names = [f"a{k}" for k in range(len(kinds))]
    types = dict(zip(names, kinds, strict=True))
    passed = [
        f"null if {name} is None else buffer(t{name}, {name})" if types[name] else name
        for name in names
    ]
    known = {"function": function, "buffer": ffi.from_buffer, "null": ffi.NULL}
    known |= {f"t{name}": kind for name, kind in types.items()}
    made: Callable[..., int] = eval(
        f"lambda {', '.join(names)}: function({', '.join(passed)})", known
    )
    return made


def _functions(isa: str) -> dict[str, Callable[..., int]]:
    """The functions compiled for an ISA, by their names in ``csrc/calls.h``."""
    start = f"pkm_{isa}_"
    names = [name for name in dir(lib) if name.startswith(start)]
    return {name[len(start) :]: _of_arrays(getattr(lib, name)) for name in names}


def _row_call(line: str) -> tuple[str, tuple[list[tuple[int, str]], list[tuple[int, ...]]]]:
    """Name, widths and kinds of inputs, and shapes of outputs; see ``derive/calls.py``."""
    before, _, after = line.partition(" -> ")
    name, *inputs = before.split()
    widths = [each.split(":")[1] for each in inputs]
    shapes = [each.split(":")[1].split(",") for each in after.split()]
    return name, (
        [(int(width.rstrip("*!")), width.lstrip("0123456789")) for width in widths],
        [tuple(int(size) for size in shape if size) for shape in shapes],
    )


ISA = _default_isa()
FUNCTIONS = [_functions(isa) for isa in ISAS[: lib.pkm_best_isa() + 1]]
ROW_CALLS = dict(map(_row_call, _text(lib.pkm_row_calls()).splitlines()))


# By the type of its numbers, as `array.dtype.char` has it: "l" has 64 bits here and 32 on Windows.
_POINTERS = {"d": ffi.typeof("double *"), "D": ffi.typeof("double *")}
_POINTERS |= {
    kind: ffi.typeof(f"{np.dtype(kind).name}_t *")
    for kind in "ilqLQ"
    if np.dtype(kind).name in ("int32", "int64", "uint64")
}


def pointer(array: NDArray[Any]) -> Any:
    """C pointer to a contiguous array; it keeps the array alive."""
    return ffi.from_buffer(_POINTERS[array.dtype.char], array)


def ensure(code: int) -> None:
    """Raise ValueError where the core refused a call."""
    if code < 0:
        raise ArgumentError(f"the core refused the call (code {code})")


def call(function: str, *arguments: Any, isa: int | None = None) -> None:
    """Call a function of the core; it takes arrays where C takes pointers to numbers.

    Parameters
    ----------
    function : str
        Its name in ``csrc/calls.h``.
    *arguments : ndarray, int, float or C data
        As declared there; arrays contiguous.
    isa : int, optional
        Index into `ISAS`.

    Raises
    ------
    ValueError
        The core refuses the call, or the processor has no such ISA.
    """
    try:
        chosen = FUNCTIONS[ISA if isa is None else isa][function]
    except IndexError:
        raise ArgumentError(f"this processor has no ISA {isa}") from None
    code = chosen(*arguments)
    if code < 0:
        ensure(code)


def rows(function: str, *arrays: FloatArray, isa: int | None = None) -> list[FloatArray]:
    """Call a function of the core that is one formula a row.

    Parameters
    ----------
    function : str
        Its name in ``generated/row_calls.h``.
    *arrays : ndarray (N, width), or (width,) where declared
        Its inputs.
    isa : int, optional
        Index into `ISAS`.

    Returns
    -------
    list of ndarray (N, ...)
        Its outputs.

    Raises
    ------
    ValueError
        An input of another width or number of rows.
    """
    inputs, outputs = ROW_CALLS[function]
    n = next((len(a) for a in arrays if a.ndim > 1), 1)
    arguments: list[Any] = [n]
    for (width, given), array in zip(inputs, arrays, strict=True):
        each = array.ndim > 1 or given == ""
        if array.size != (n * width if each else width) or (each and given == "!"):
            raise ArgumentError(f"{function}: {array.shape} are not {n} rows of {width} numbers")
        arguments.append(np.ascontiguousarray(array))
        if given == "*":
            arguments.append(width if each else 0)
    made = [np.empty((n, *shape)) for shape in outputs]
    call(function, *arguments, *made, isa=isa)
    return made


def processors() -> int:
    """Return the number of processors this process may use, or has, where that is unknown."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def in_threads(run: Callable[[int, int], None], rows: int, threads: int | None) -> None:
    """Run ``run(start, stop)`` over contiguous parts of the rows, in threads.

    Parameters
    ----------
    run : callable
        May raise, which becomes the call's own error.
    rows : int
        Number of rows.
    threads : int or None
        None takes as many as pay; at most `MOST_THREADS`.
    """
    if threads is None:
        threads = rows // ROWS_PER_THREAD
        threads = min(threads, processors()) if threads > 1 else 1
    else:
        threads = min(whole("threads", threads, 1, note=" or None"), max(rows, 1), MOST_THREADS)
    if threads == 1:
        return run(0, rows)
    count = min(rows, PARTS_PER_THREAD * threads)
    parts = pairwise([rows * k // count for k in range(count + 1)])
    raised: list[Exception] = []

    def work() -> None:
        try:
            for start, stop in parts:  # whoever is free takes the next
                run(start, stop)
        except Exception as error:
            raised.append(error)

    others = [threading.Thread(target=work) for _ in range(threads - 1)]
    for thread in others:
        thread.start()
    work()
    for thread in others:
        thread.join()
    if raised:
        raise raised[0]


def part(array: NDArray[Any], start: int, stop: int) -> NDArray[Any]:
    """Rows of an array; all of them without the price of a slice."""
    return array if stop - start == len(array) else array[start:stop]
