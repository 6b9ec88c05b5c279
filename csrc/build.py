"""Describe the extension ``pkmcal._core`` to setuptools: cffi in API mode, CPython's stable ABI.

setup.py names this file; it is run from the project's root, and its paths are relative to that.
"""

from pathlib import Path

from cffi import FFI

CSRC = Path(__file__).parent
GENERATED = CSRC.parent / "generated"
HEADER = CSRC / "pkmcal.h"
BEGIN, END = "/* cffi begin */", "/* cffi end */"

# Contraction off: every ISA gives the same bits. Complex products and quotients are written out:
# without limited range each is a library call; so are loops that clear a few lanes, which the
# compiler otherwise takes for work for memset.
FLAGS = [
    "-std=c11",
    "-O3",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-ffp-contract=off",
    "-fcx-limited-range",
    "-fno-tree-loop-distribute-patterns",
    "-fvisibility=hidden",
    "-Werror=implicit-function-declaration",
]


def declarations(header: Path) -> str:
    """Return what `header` declares between its two marker lines, without preprocessor lines."""
    lines = header.read_text(encoding="utf-8").splitlines()
    if lines.count(BEGIN) != 1 or lines.count(END) != 1:
        raise ValueError(f"{header}: expected one line {BEGIN!r} and one line {END!r}")
    declared = lines[lines.index(BEGIN) + 1 : lines.index(END)]
    return "\n".join(line for line in declared if not line.lstrip().startswith("#"))


def ffibuilder() -> FFI:
    """Return the builder of ``pkmcal._core``: every C file of this folder in one extension."""
    builder = FFI()
    builder.cdef(declarations(HEADER))
    builder.set_source(
        "pkmcal._core",
        f'#include "{HEADER.name}"',
        sources=sorted(str(path) for path in CSRC.glob("*.c")),
        include_dirs=[str(CSRC), str(GENERATED)],
        depends=[
            str(Path(__file__)),
            *sorted(str(path) for folder in (CSRC, GENERATED) for path in folder.glob("*.h")),
        ],
        extra_compile_args=FLAGS,
    )
    return builder
