"""C code compiled for a benchmark: other solvers, and the core at one lane."""

from __future__ import annotations

import os
import re
import subprocess
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from cffi import FFI

from csrc.build import CSRC, GENERATED, declarations
from csrc.build import flags as core_flags
from pkmcal.core import library
from pkmcal.core.library import ISAS

HERE = Path(__file__).parent
COMPILER = os.environ.get("CC", "gcc")
TARGETS = {"base": [], "avx2": ["-march=x86-64-v3"], "avx512": ["-march=x86-64-v4"]}
PEAKS = {"fused": 12 * 2, "apart": 12}  # operations of a lane in a step, see fma_peak.c
BYTES = {"base": 16, "avx2": 32, "avx512": 64}  # of a vector register


class Compiled(NamedTuple):
    """A shared library and what makes its pointers."""

    ffi: Any
    lib: Any


def compiled(
    folder: Path, name: str, declared: str, sources: list[Path], flags: list[str]
) -> Compiled:
    """Compile and load `sources` into ``folder/name.so``."""
    library = folder / f"{name}.so"
    command = [COMPILER, "-shared", "-fPIC", *flags, *map(str, sources), "-o", str(library), "-lm"]
    subprocess.run(command, check=True)
    ffi = FFI()
    ffi.cdef(declared)
    return Compiled(ffi, ffi.dlopen(str(library)))


def scalar_newton(folder: Path) -> Compiled:
    """The textbook's Newton, compiled for this very processor."""
    declared = """
        long scalar_newton(ptrdiff_t n, const double *base, const double *platform,
                           const double *offset, const double *q, const double *guess,
                           double closed, double *poses);
    """
    return compiled(
        folder, "scalar", declared, [HERE / "scalar_newton.c"], ["-O3", "-march=native"]
    )


def fma_peak(folder: Path, isa: str) -> Compiled:
    """Loops of multiplications and additions in registers at the width of an ISA."""
    declared = "".join(
        f"double {how}_{kind}(ptrdiff_t steps, double start);"
        for how in PEAKS
        for kind in ("double", "float")
    )
    flags = ["-O3", f"-DBYTES={BYTES[isa]}", "-ffp-contract=fast", *TARGETS[isa]]
    return compiled(folder, f"peak_{isa}", declared, [HERE / "fma_peak.c"], flags)


def lane_units(folder: Path, isa: str) -> Compiled:
    """Loops of one number at a time and of a register full, unfused as in the core."""
    calls = [f"{what}_{many}" for what in ("multiply_add", "divide") for many in ("one", "all")]
    declared = "".join(f"double {name}(ptrdiff_t steps, double start);" for name in calls)
    flags = ["-O3", "-fno-tree-vectorize", "-ffp-contract=off", f"-DBYTES={BYTES[isa]}"]
    sources = [HERE / "lane_units.c"]
    return compiled(folder, f"units_{isa}", declared, sources, [*flags, *TARGETS[isa]])


class OneLane:
    """The core of csrc/ compiled with LANES 1, whose `forward` replaces the core's while entered.

    The same source, the same flags and the same three ISAs; only the number of lanes differs. In one
    thread only.

    Parameters
    ----------
    folder : Path
        Where it is compiled.
    joined : int
        Blocks of doubles to a block of floats: 1 does one number at a time, floats as well. With
        2, as in the core, a block of floats has two even here, and the compiler does them together:
        SIMD that one lane should not have. To be compared with `flush_denormals` on then;
        bench_denormals says why.
    """

    def __init__(self, folder: Path, joined: int = 1) -> None:
        cores = sorted(CSRC.glob("core_*.c"))
        sources = [source for source in sorted(CSRC.glob("*.c")) if source not in cores]
        for source in cores:
            text, count = re.subn(r"#define LANES \d", "#define LANES 1", source.read_text())
            if count != 1:
                raise ValueError(f"{source}: expected one definition of LANES, found {count}")
            sources.append(folder / source.name)
            sources[-1].write_text(text)
        sources.append(HERE / "flush_denormals.c")
        own = [f"-I{CSRC}", f"-I{GENERATED}", f"-DJOINED={joined}"]
        own += [flag for flag in core_flags() if "visibility" not in flag]
        declared = declarations() + "void flush_denormals(int on);"
        self._here = compiled(folder, f"one_lane_{joined}", declared, sources, own)
        self._replaced = [functions["forward"] for functions in library.FUNCTIONS]

    def __enter__(self) -> OneLane:
        for isa, functions in zip(ISAS, library.FUNCTIONS, strict=False):
            functions["forward"] = partial(self._forward, f"pkm_{isa}_forward")
        return self

    def __exit__(self, *_: object) -> None:
        for functions, forward in zip(library.FUNCTIONS, self._replaced, strict=True):
            functions["forward"] = forward

    def flush_denormals(self, on: bool) -> None:
        """Count numbers too small for full precision as 0 in this thread, or not."""
        self._here.lib.flush_denormals(on)

    def _forward(self, name: str, *arguments: Any) -> int:
        return int(getattr(self._here.lib, name)(*map(self._own, arguments)))

    def _own(self, argument: Any) -> Any:
        if isinstance(argument, np.ndarray):
            argument = library.pointer(argument)
        if isinstance(argument, library.ffi.CData):
            return self._here.ffi.cast("void *", int(library.ffi.cast("intptr_t", argument)))
        return argument


def available() -> list[str]:
    """ISAs of this processor."""
    return list(ISAS[: library.lib.pkm_best_isa() + 1])
