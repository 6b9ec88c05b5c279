"""The core compiles for processors and systems that this machine is not."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FLAGS = ("-std=c11", "-fno-math-errno", "-fno-trapping-math", "-ffp-contract=off", "-Werror")
QUICK = ("-Wno-attributes", "-Dalways_inline=unused", "-Icsrc", "-Igenerated")  # nothing is inlined
GCC = {
    "half precision on x86-64": "gcc -march=sapphirerapids",
    "half precision on aarch64": "aarch64-linux-gnu-gcc -mcpu=cortex-a76",
    "aarch64 with vectors of any length": "aarch64-linux-gnu-gcc -mcpu=neoverse-v1",
    "Windows by gcc": "x86_64-w64-mingw32-gcc",
}
ZIG = (
    *("x86_64-windows-gnu", "aarch64-windows-gnu", "x86_64-macos", "aarch64-macos"),
    *("x86-linux-musl", "riscv64-linux-musl", "s390x-linux-musl"),
)


@pytest.mark.parametrize("compiler", GCC.values(), ids=GCC)
def test_gcc_takes_the_core_for_another_processor(compiler: str) -> None:
    if not shutil.which(compiler.split()[0]):
        pytest.skip(f"needs {compiler.split()[0]}")
    given = [*compiler.split(), *FLAGS, *QUICK, "-fsyntax-only"]
    sources = ("csrc/abi.c", "csrc/paths.c", "csrc/core_base.c")
    done = subprocess.run([*given, *sources], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-3000:]


def test_no_function_of_the_core_is_one_of_a_systems_library(tmp_path: Path) -> None:
    """Names that some math.h declare beside C's own: 4.4BSD's, which Apple kept, and POSIX's."""
    if not shutil.which("gcc"):
        pytest.skip("needs gcc")
    one, two = "finite isinf isnan j0 j1 y0 y1 gamma significand drem", "scalb ldexp10 nextdown"
    (tmp_path / "system.h").write_text(
        "".join(f"double {name}(double);\n" for name in one.split() if not name.startswith("is"))
        + "".join(f"double {name}(double, double);\n" for name in two.split())
    )
    given = ["gcc", *FLAGS, *QUICK, "-fno-builtin", "-include", str(tmp_path / "system.h")]
    done = subprocess.run(
        [*given, "-fsyntax-only", "csrc/core_base.c"], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr[-3000:]


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize(("file", "register"), [("core_v3", "ymm"), ("core_v4", "zmm")])
def test_lanes_are_computed_in_the_registers_of_their_isa(
    file: str, register: str, compiler: str, tmp_path: Path
) -> None:
    """By every compiler; loops for other processors give equal bits at a third of the speed."""
    if not shutil.which(compiler):
        pytest.skip(f"needs {compiler}")
    one = '#include "lanes.h"\nwide used(wide);\nwide used(wide x) { return root_wide(x); }'
    source = (ROOT / "csrc" / f"{file}.c").read_text().replace('#include "core.h"', one)
    (tmp_path / "one.c").write_text(source)
    given = [compiler, *FLAGS, "-Wno-psabi", "-O1", "-Icsrc", "-Igenerated", "-S", "-o", "-"]
    done = subprocess.run(
        [*given, str(tmp_path / "one.c")], cwd=ROOT, capture_output=True, text=True, check=True
    )
    if "used:" in done.stdout:  # empty elsewhere than on x86-64
        assert re.search(rf"\bvsqrtpd\s.*%{register}", done.stdout)


@pytest.mark.slow
@pytest.mark.parametrize("target", ZIG)
def test_zig_takes_the_core_for_another_system(target: str, tmp_path: Path) -> None:
    if find_spec("ziglang") is None:
        pytest.skip("needs the PyPI package ziglang, as make wheels installs it")
    of_wheels = pytest.importorskip("wheels.build", reason="needs the folder of the sources")
    compiler = [sys.executable, "-m", "ziglang", "cc", "-target", target]
    for source in sorted((ROOT / "csrc").glob("*.c")):
        wide = of_wheels.WIDE.get(source.stem, ()) if target.startswith("x86_64") else ()
        given = [*compiler, *FLAGS, *QUICK, "-Wno-macro-redefined", "-Wno-ignored-attributes"]
        given += [*wide, "-c", str(source), "-o", str(tmp_path / f"{source.stem}.o")]
        done = subprocess.run(given, cwd=ROOT, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr[-3000:]
