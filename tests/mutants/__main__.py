"""Do the tests see a mistake? ``python -m tests.mutants csrc --count 50 --seed 1``.

Mutants are drawn by chance from all of a folder and made one at a time in a copy of the checkout.
First its tests run without a mutant, and what each of them calls is noted (`calls.py`); then each
mutant is shown to those that call its function, first to those that saw others, that are of files
named as its own, and that are quick, until one fails or `--most` seconds of processor time are
spent: in a process forked from one that has collected all tests (`collected.py`), or, where that
would not do, from this one, which has imported the libraries. Of ``csrc`` the 128-bit core alone is
compiled (`core.py`).

Mutants that do not compile do not count, nor those of C that compile to the same. With those of
``derive`` that no test of its own saw all is derived; they do not count where that gives what is
checked in. What they make is compiled and shown to the tests of ``csrc``, if it is said where it
is recorded what these call (`--below`). The test that derives all again and compares is left out:
it sees all that count.
"""

from __future__ import annotations

import argparse
import importlib
import shutil
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from .folder import LEFT_OUT, ROOT, TESTS, Folder

LIBRARIES = (
    *("numpy", "scipy.optimize", "scipy.stats", "scipy.spatial", "scipy.sparse.linalg", "sympy"),
    *("mpmath", "matplotlib.pyplot", "jinja2", "typer.testing", "rich.console"),
    *("tomli_w", "tomlkit", "openpyxl", "cffi"),
)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("folder", choices=TESTS)
    parser.add_argument("--count", type=int, default=50, help="how many mutants that count")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=1e9, help="begin no other after this time")
    parser.add_argument("--most", type=float, default=60.0, help="seconds of tests for a mutant")
    parser.add_argument("--only", help="these of the draw, by their numbers: 3,17")
    parser.add_argument("--tests", nargs="+", help="in place of those of the folder")
    parser.add_argument("--recorded", type=Path, help="what tests call: read, or else written")
    parser.add_argument("--below", type=Path, help="for derive: what tests of csrc call, recorded")
    chosen = parser.parse_args()
    began, ends = time.monotonic(), Counter[str]()
    for library in LIBRARIES:
        importlib.import_module(library)
    with tempfile.TemporaryDirectory() as temporary:
        copy = Path(temporary).resolve() / "checkout"
        shutil.copytree(ROOT, copy, ignore=LEFT_OUT)
        folder = Folder(chosen.folder, copy, chosen.tests or TESTS[chosen.folder], chosen.most)
        folder.record(chosen.recorded)
        if chosen.count:
            folder.collect()
        if chosen.below:
            below = Path(temporary).resolve() / "below" / "checkout"
            shutil.copytree(ROOT, below, ignore=LEFT_OUT)
            folder.below = Folder("csrc", below, TESTS["csrc"], chosen.most)
            folder.below.record(chosen.below)
            folder.below.collect()
        for k, change in enumerate(folder.drawn(chosen.seed)):
            if sum(ends.values()) - ends["not counted"] >= chosen.count:
                break
            if time.monotonic() - began > chosen.seconds:
                break
            if chosen.only and str(k) not in chosen.only.split(","):
                continue
            end, by = folder.end(change)
            ends[end] += 1
            if end != "not counted":
                print(f"{k} {end}{by}: {change.named(folder.text(change))}", flush=True)
        for each in (folder, folder.below):
            if chosen.count and each:
                each.control()
    counted = sum(ends.values()) - ends["not counted"]
    print(
        f"{chosen.folder}, seed {chosen.seed}: {ends['killed']} of {counted} killed"
        f" ({ends['killed'] / max(counted, 1):.0%}), {ends['not counted']} not counted"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
