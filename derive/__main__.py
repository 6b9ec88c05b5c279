"""``python -m derive`` writes ``generated/``; with ``--check`` it compares and changes nothing."""

from __future__ import annotations

import argparse
import difflib
import hashlib
import sys
from collections.abc import Iterable
from pathlib import Path

from . import (
    calls,
    chains,
    elementary,
    frames,
    laws,
    limb_functions,
    limbs,
    measured,
    posemaps,
    pulleys,
    rates,
    screws,
    tpr2tps,
)
from .emit import Function

HERE = Path(__file__).parent
GENERATED = HERE.parent / "generated"
PROGRAM = "python -m derive"


def headers() -> dict[str, str]:
    """Name and text of every generated header."""
    return {
        "names.h": _header("limbs", _names() + calls.table()),
        "row_calls.h": _header("calls", calls.prototypes()),
        "row_loops.h": _header("calls", calls.loops()),
        "chains.h": _header("chains", _functions(chains.functions())),
        "elementary.h": _header("elementary", elementary.emit()),
        "frames.h": _header("frames", _functions(frames.functions())),
        "laws.h": _header("laws", _functions(laws.functions())),
        "limbs.h": _header("limb_functions", _functions(limb_functions.functions()), "limbs"),
        "measured.h": _header("measured", _functions(measured.functions())),
        "posemaps.h": _header("posemaps", _functions(posemaps.functions())),
        "pulleys.h": _header("pulleys", _functions(pulleys.functions())),
        "rates.h": _header("rates", _functions(rates.functions()), "limbs"),
        "screws.h": _header("screws", screws.constants() + _functions(screws.functions())),
        "tpr2tps.h": _header("tpr2tps", _functions(tpr2tps.functions())),
    }


def _names() -> str:
    """What C and Python call the numbers of a limb, its drivers and rows, and the pose maps."""

    def enum(prefix: str, names: Iterable[str]) -> str:
        return "enum { " + ", ".join(prefix + name.upper() for name in names) + " };"

    maps = posemaps.MAPS
    lines = [
        *limbs.names(),
        "/* pose maps: m free coordinates, how many of them are lengths, iterated on a state */",
        enum("MAP_", [pose_map.name for pose_map in maps]),
        f'#define MAP_NAMES "{" ".join(pose_map.name for pose_map in maps)}"',
        f'#define MAP_FREE "{";".join(" ".join(pose_map.free) for pose_map in maps)}"',
        f"#define MAX_STATE {max(pose_map.state_size for pose_map in maps)}",
        "#define EACH_MAP(X) " + " ".join(
            f"X({pose_map.name.upper()}, {pose_map.name}, {pose_map.m}, {pose_map.lengths})"
            for pose_map in maps),
        "",
    ]  # fmt: skip
    return "\n".join(lines)


def _functions(functions: list[Function]) -> str:
    return "\n".join(map(_emitted, functions))


def _emitted(function: Function) -> str:
    try:
        return function.emit()
    except NotImplementedError as error:
        raise NotImplementedError(f"{function.name}: {error}") from None


def _header(module: str, body: str, *also: str) -> str:
    """The file's first lines: where it comes from, and the hash of the derivation behind it."""
    sources = sorted({HERE / f"{name}.py" for name in ("emit", "rotation", module, *also)})
    text = "".join(path.read_text(encoding="utf-8") for path in sources)
    digest = hashlib.sha256(text.encode()).hexdigest()[:16]
    return (
        f"/* Generated from derive/{module}.py by `{PROGRAM}`; never edited by hand.\n"
        f" * derivation {digest}\n"
        " * `real` is a number or a lane of numbers, FN(name) the function for that type. */\n\n"
        f"{body}"
    )


def differences(folder: Path = GENERATED) -> str:
    """Unified diff between what is checked in and what the derivation gives; empty when equal."""
    lines: list[str] = []
    fresh = headers()
    for name in sorted(set(fresh) | {path.name for path in folder.glob("*.h")}):
        path = folder / name
        old = path.read_text(encoding="utf-8") if path.exists() else ""
        lines += difflib.unified_diff(
            old.splitlines(keepends=True),
            fresh.get(name, "").splitlines(keepends=True),
            f"generated/{name} (checked in)",
            f"generated/{name} (derived)",
        )
    return "".join(lines)


def main() -> int:
    """Write, or compare with ``--check``: exit code 1 and the diff where they differ."""
    parser = argparse.ArgumentParser(prog=PROGRAM, description=__doc__)
    parser.add_argument("--check", action="store_true", help="compare only, change nothing")
    if parser.parse_args().check:
        diff = differences()
        if diff:
            print(f"{diff}\ngenerated/ is out of date: run `{PROGRAM}`", file=sys.stderr)
        return 1 if diff else 0
    GENERATED.mkdir(exist_ok=True)
    for name, text in headers().items():
        (GENERATED / name).write_text(text, encoding="utf-8")
        print(f"generated/{name}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
