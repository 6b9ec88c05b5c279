"""A long run: ``python -m tests.fuzz csv --count 1000000 --seed 1``.

Number k of a seed is always the same: ``--from k --count 1`` gives it again. Hypothesis turns
random bytes into inputs, as it does for fuzzers that are guided by coverage; some make none. What
fails is written to ``fuzz-DOOR-SEED-K.bin`` in the current folder and the run goes on.
"""

from __future__ import annotations

import argparse
import random
import resource
import sys
import tempfile
import time
import traceback
from pathlib import Path

from hypothesis import given, settings

from .damage import inputs
from .doors import DOORS, emptied

SLOW = 5.0  # s of processor time for one input
BYTES = 400  # of randomness for one input


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("door", choices=DOORS)
    parser.add_argument("--count", type=int, default=10_000, help="how many inputs")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--from", type=int, default=0, dest="first", help="number of the first")
    parser.add_argument("--seconds", type=float, default=1e9, help="end after this time")
    chosen = parser.parse_args()
    return run(chosen.door, chosen.seed, chosen.first, chosen.count, chosen.seconds)


def run(name: str, seed: int, first: int, count: int, seconds: float) -> int:
    """Feed the inputs, and print what became of them; 1 if a law failed."""
    door = DOORS[name]
    numbers = entered = accepted = 0
    failed: dict[str, tuple[int, int]] = {}
    slowest = (0.0, -1)
    content = b""
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:

        @settings(database=None, deadline=None)
        @given(inputs(door))
        def enter(made: bytes) -> None:
            nonlocal content, entered, accepted
            content = made
            entered += 1
            accepted += door.enter(Path(folder), made)

        for k in range(first, first + count):
            if time.monotonic() - began > seconds:
                break
            before = time.process_time()
            try:
                enter.hypothesis.fuzz_one_input(random.Random(f"{seed} {k}").randbytes(BYTES))
            except BaseException as error:
                if isinstance(error, KeyboardInterrupt):
                    raise
                where = traceback.extract_tb(error.__traceback__)[-1]
                kind = f"{type(error).__name__} {Path(where.filename).name}:{where.lineno}"
                if kind not in failed:
                    Path(f"fuzz-{name}-{seed}-{k}.bin").write_bytes(content)
                    print(f"input {k}: {kind}: {str(error)[:300]!r}", flush=True)
                failed[kind] = (failed.get(kind, (k, 0))[0], failed.get(kind, (k, 0))[1] + 1)
            numbers += 1
            took = time.process_time() - before
            if took > slowest[0]:
                slowest = (took, k)
            emptied(Path(folder))
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"{name}, seed {seed}, numbers {first} to {first + numbers - 1}: {entered} inputs,"
        f" {accepted} taken, {sum(n for _, n in failed.values())} failed in {len(failed)} ways;"
        f" slowest {slowest[0]:.2f} s (input {slowest[1]}), {memory:.0f} MB,"
        f" {time.monotonic() - began:.0f} s"
    )
    for kind, (k, n) in failed.items():
        print(f"  {n} times, first input {k}: {kind}")
    return int(bool(failed) or slowest[0] > SLOW)


if __name__ == "__main__":
    sys.exit(main())
