"""Compile the core for pages: ``pkmcal/view/wasm/*.wasm``, which are checked in.

Who installs the package needs no compiler for them. Clang and its linker of one version give the
same bytes on every machine; another version gives others, and is refused.

    python csrc/view/build.py          # writes the files
    python csrc/view/build.py --check  # fails if that would change any
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
MODULES = ("limbs", "chains", "arms")
BUILT = ROOT / "pkmcal" / "view" / "wasm"
CLANG = "14.0.6"  # Debian 12: apt-get install clang-14 lld-14
FLAGS = [
    *("--target=wasm32", "-std=c11", "-Oz", "-ffp-contract=off", "-fno-math-errno"),
    *("-fno-trapping-math", "-fno-strict-aliasing", "-mbulk-memory", "-nostdlib"),
    *("-ffunction-sections", "-fdata-sections", "-fvisibility=hidden", "-Werror"),
    # One lane at a time the core is called seldom: each function once, and no loop unrolled, which
    # lanes.h and kernel.h ask of a compiler for speed.
    *("-Dalways_inline=unused", "-DUNROLL=", "-Wno-macro-redefined"),
    *("-isystem", "csrc/view/include", "-Icsrc", "-Igenerated"),
    "-Wl,--no-entry,--strip-all,--gc-sections,--export-dynamic,-z,stack-size=262144",
]


def compiler() -> str | None:
    """The clang of the pinned version, or None."""
    for name in (f"clang-{CLANG.split('.')[0]}", "clang"):
        found = shutil.which(name)
        if found:
            said = subprocess.run([found, "--version"], capture_output=True, text=True).stdout
            if re.search(rf"version {re.escape(CLANG)}\b", said) and shutil.which("wasm-ld"):
                return found
    return None


def build(folder: Path, clang: str) -> None:
    """Write every module into a folder."""
    for name in MODULES:
        out = folder / f"{name}.wasm"
        sources = [f"csrc/view/{name}.c", "csrc/abi.c"]
        subprocess.run([clang, *FLAGS, *sources, "-o", str(out)], cwd=ROOT, check=True)
        out.chmod(0o644)


def changed(clang: str) -> list[str]:
    """Names of modules that are not what the sources give."""
    with tempfile.TemporaryDirectory() as made:
        build(Path(made), clang)
        files = (f"{name}.wasm" for name in MODULES)
        return [f for f in files if (Path(made) / f).read_bytes() != (BUILT / f).read_bytes()]


def main() -> str | None:
    """Build or compare; what went wrong."""
    clang = compiler()
    if clang is None:
        return f"clang {CLANG} with wasm-ld is needed (Debian 12: apt-get install clang-14 lld-14)"
    if "--check" not in sys.argv:
        BUILT.mkdir(exist_ok=True)
        build(BUILT, clang)
        return None
    old = changed(clang)
    return f"{', '.join(old)}: not what csrc/ gives; run 'make wasm'" if old else None


if __name__ == "__main__":
    sys.exit(main())
