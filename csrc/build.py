"""Describe the extension ``pkmcal._core`` to setuptools: cffi in API mode, CPython's stable ABI.

setup.py names this file; it is run from the project's root, and its paths are relative to that.
"""

import os
import re
import shlex
import subprocess
import sysconfig
import tempfile
from pathlib import Path

from cffi import FFI

CSRC = Path(__file__).parent
GENERATED = CSRC.parent / "generated"
HEADER = CSRC / "pkmcal.h"
CALLS = (CSRC / "calls.h", GENERATED / "row_calls.h")  # declared once, compiled for each ISA
BEGIN, END = "/* cffi begin */", "/* cffi end */"

# Contraction off: every ISA gives the same bits.
FLAGS = [
    "-std=c11",
    "-O3",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-ffp-contract=off",
    "-fvisibility=hidden",
    "-Werror=implicit-function-declaration",
]
# For speed, and not known to every compiler. Complex products and quotients are written out:
# without limited range each is a library call. So are loops that clear a few lanes, which gcc
# otherwise takes for work for memset.
FASTER = ["-fcx-limited-range", "-fno-tree-loop-distribute-patterns"]


def flags() -> list[str]:
    """Return what the C compiler is called with: `FLAGS`, and what it knows of `FASTER`.

    Without line numbers for debuggers, which Python's own flags ask for and which make up nine
    tenths of the extension, unless ``CFLAGS`` asks for them too.
    """
    debugging = any(flag.startswith("-g") for flag in shlex.split(os.environ.get("CFLAGS", "")))
    found = [*FLAGS, *(flag for flag in FASTER if _known(flag))]
    return found if debugging else [*found, "-g0"]


def _known(flag: str) -> bool:
    return _compiles("", flag)


def _compiles(text: str, *given: str) -> bool:
    """Whether the C compiler takes this text: a file that is compiled, which every compiler can."""
    compiler = shlex.split(os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc")
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder, "trial.c")
        source.write_text(text, encoding="utf-8")
        trial = [*compiler, "-Werror", *given, "-c", str(source), "-o", f"{folder}/trial.o"]
        try:
            return subprocess.run(trial, capture_output=True).returncode == 0
        except OSError:
            return False  # no compiler: the build itself says so


def isas() -> tuple[str, ...]:
    """Return the ISAs that the calls are compiled for, as their names in C have them."""
    wide = _compiles("#ifndef __x86_64__\n#error\n#endif\n")
    return ("base", "avx2", "avx512") if wide else ("base",)


def declarations() -> str:
    """Return all that the core offers: what pkmcal.h marks, and the calls for each ISA."""
    lines = HEADER.read_text(encoding="utf-8").splitlines()
    if lines.count(BEGIN) != 1 or lines.count(END) != 1:
        raise ValueError(f"{HEADER}: expected one line {BEGIN!r} and one line {END!r}")
    names = (GENERATED / "names.h").read_text(encoding="utf-8")
    parts = re.findall(r"^enum { AXES = \d+ };$", names, re.MULTILINE)  # of the arrays below
    parts += ["\n".join(lines[lines.index(BEGIN) + 1 : lines.index(END)])]
    calls = "".join(path.read_text(encoding="utf-8") for path in CALLS)
    parts += [re.sub(r"CALL\((\w+)\)", rf"pkm_{isa}_\1", calls) for isa in isas()]
    return re.sub("^ *#.*$", "", "\n".join(parts), flags=re.MULTILINE)


def ffibuilder() -> FFI:
    """Return the builder of ``pkmcal._core``: every C file of this folder in one extension."""
    builder = FFI()
    builder.cdef(declarations())
    builder.set_source(
        "pkmcal._core",
        f'#include "{HEADER.name}"',
        sources=sorted(str(path) for path in CSRC.glob("*.c")),
        include_dirs=[str(CSRC), str(GENERATED)],
        depends=[
            str(Path(__file__)),
            *sorted(str(path) for folder in (CSRC, GENERATED) for path in folder.glob("*.h")),
        ],
        extra_compile_args=flags(),
    )
    return builder
