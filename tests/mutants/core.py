"""The core of a copy of the checkout, compiled in seconds, and exchanged while Python runs.

The 128-bit core alone, with little optimisation and no inlining. What cffi makes of the interface
calls it through pointers, which `pkm_use` sets to those of another shared library: so all tests are
collected once, and each mutant is loaded by a process forked from there.
"""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import sysconfig
from pathlib import Path

from . import calls

UNITS = ("core_base.c", "paths.c", "abi.c")
FLAGS = (
    "-std=c11 -Og -w -fPIC -shared -fvisibility=default -fno-math-errno -fno-trapping-math"
    " -ffp-contract=off -fcx-limited-range -Dalways_inline=unused"
    " -Werror=implicit-function-declaration"
)
POINTERS = r"""
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#define POINTER(name) static __typeof__(name) *name##_used;
EACH_NAME(POINTER)
__attribute__((visibility("default"))) long pkm_core_calls;
__attribute__((visibility("default"))) const char *pkm_use(const char *path)
{
    void *units = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!units) return dlerror();
#define FOUND(name) if (!(name##_used = dlsym(units, #name))) return #name;
    EACH_NAME(FOUND)
    return 0;
}
__attribute__((constructor)) static void at_first(void)
{
    const char *path = getenv("PKMCAL_UNITS"), *missing = pkm_use(path ? path : UNITS);
    if (missing) fprintf(stderr, "%s\n", missing), abort();
}
"""


class Core:
    """The compiled core of a copy, with `units` beside it: the functions of ``csrc``."""

    def __init__(self, copy: Path) -> None:
        self.copy, self.units, self.mutant = copy, copy / "units.so", copy / "mutant.so"
        for path in (copy / "csrc").iterdir():
            if path.suffix in (".c", ".h", ".py") and path.name != "lanes.h":
                text = path.read_text(encoding="utf-8").replace("__x86_64__", "PKMCAL_ALL_ISAS")
                path.write_text(text, encoding="utf-8")
        for unit in UNITS:
            self._compile(f"csrc/{unit}")
        self._link(self.units)
        self.objects = {unit: self._object(unit).read_bytes() for unit in UNITS}
        source = "import csrc.build as b; b.ffibuilder().emit_c_code('_core.c')"
        subprocess.run([sys.executable, "-c", source], cwd=copy, check=True)
        self._point()
        self._compile("_core.c", "-DPy_LIMITED_API=0x030a0000")
        self._link(copy / "pkmcal" / "_core.abi3.so", "_core.c")
        self.reached = {unit: self._included(unit) for unit in UNITS}

    def _point(self) -> None:
        """Let what cffi wrote call through pointers."""
        told = subprocess.run(
            ["nm", "-D", self.units], capture_output=True, text=True, check=True
        ).stdout
        names = [line.split()[2] for line in told.splitlines() if " T pkm_" in line]
        path, include = self.copy / "_core.c", '#include "pkmcal.h"\n'
        before, _, after = path.read_text(encoding="utf-8").partition(include)
        each = " ".join(f"X({name})" for name in names)
        defined = [f'#define UNITS "{self.units}"', f"#define EACH_NAME(X) {each}", POINTERS]
        through = [f"#define {name} (*(pkm_core_calls++, {name}_used))" for name in names]
        text = "\n".join([before + include, *defined, *through, after])
        path.write_text(text, encoding="utf-8")

    def mutated(self, *changed: str) -> str:
        """Compile what includes changed files: that "fails", gives the "same", or is "made"."""
        units = [unit for unit in UNITS if self.reached[unit].intersection(changed)]
        try:
            if not all(self._compile(f"csrc/{unit}") for unit in units):
                return "fails"
            if all(self._object(unit).read_bytes() == self.objects[unit] for unit in units):
                return "same"
            self.mutant.unlink(missing_ok=True)
            self._link(self.mutant)
            return "made"
        finally:
            for unit in units:
                self._object(unit).write_bytes(self.objects[unit])

    def instrumented(self) -> list[tuple[str, int]]:
        """Let `units` note what is called (`calls.py`); file and first line of each function."""
        (self.copy / "hook.c").write_text(calls.HOOK, encoding="utf-8")
        self._compile("hook.c", "-O2", "-g")
        for unit in UNITS:
            self._compile(f"csrc/{unit}", "-g", "-finstrument-functions")
        self._link(self.units, *UNITS, "hook.c")
        return sorted({place for place, _ in calls.c_functions(self.copy, self.units).values()})

    def plain(self) -> None:
        """Let `units` be as compiled first."""
        for unit in UNITS:
            self._object(unit).write_bytes(self.objects[unit])
        self.units.unlink()
        self._link(self.units)

    def _included(self, unit: str) -> set[str]:
        command = [*self._command(), "-MM", f"csrc/{unit}"]
        told = subprocess.run(command, cwd=self.copy, capture_output=True, text=True, check=True)
        return {Path(word).name for word in told.stdout.replace("\\\n", " ").split()}

    def _object(self, unit: str) -> Path:
        return self.copy / f"{Path(unit).stem}.o"

    def _command(self) -> list[str]:
        compiler = shlex.split(os.environ.get("CC", "gcc") + " " + FLAGS)
        return [*compiler, "-Icsrc", "-Igenerated", "-I" + sysconfig.get_path("include")]

    def _compile(self, unit: str, *more: str) -> bool:
        command = [*self._command(), *more, "-c", unit, "-o", str(self._object(unit))]
        return subprocess.run(command, cwd=self.copy, capture_output=True).returncode == 0

    def _link(self, library: Path, *units: str) -> None:
        objects = [str(self._object(unit)) for unit in units or UNITS]
        command = ["gcc", "-shared", "-Wl,-Bsymbolic", *objects, "-lm", "-ldl", "-o", str(library)]
        subprocess.run(command, cwd=self.copy, check=True)
