"""A long run: ``python -m tests.fuzz csv --count 1000000 --seed 1``.

Number k of a seed is always the same: ``--from k --count 1`` gives it again. What fails is written
to ``fuzz-DOOR-SEED-K.bin`` in the current folder and the run goes on.
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
import time
import traceback
from pathlib import Path
from random import Random

from .damage import damaged
from .doors import DOORS, emptied

SLOW = 30.0  # s of processor time for one input; commands that draw take 6 on a busy machine
MEMORY = Path("/dev/shm")  # files that no disk waits for, where there are such


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
    entered = accepted = 0
    failed: dict[str, tuple[int, int]] = {}
    slowest = (0.0, -1)
    began = time.monotonic()
    with tempfile.TemporaryDirectory(dir=MEMORY if MEMORY.is_dir() else None) as folder:
        for k in range(first, first + count):
            if time.monotonic() - began > seconds:
                break
            content = damaged(door, Random(f"{seed} {k}"))
            before = time.process_time()
            entered += 1
            try:
                accepted += door.enter(Path(folder), content)
            except KeyboardInterrupt:
                raise
            except BaseException as error:
                where = traceback.extract_tb(error.__traceback__)[-1]
                kind = f"{type(error).__name__} {Path(where.filename).name}:{where.lineno}"
                if kind not in failed:
                    Path(f"fuzz-{name}-{seed}-{k}.bin").write_bytes(content)
                    print(f"input {k}: {kind}: {str(error)[:300]!r}", flush=True)
                failed[kind] = (failed.get(kind, (k, 0))[0], failed.get(kind, (k, 0))[1] + 1)
            took = time.process_time() - before
            if took > slowest[0]:
                slowest = (took, k)
            emptied(Path(folder))
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"{name}, seed {seed}, numbers {first} to {first + entered - 1}: {entered} inputs,"
        f" {accepted} taken, {sum(n for _, n in failed.values())} failed in {len(failed)} ways;"
        f" slowest {slowest[0]:.2f} s (input {slowest[1]}), {memory:.0f} MB,"
        f" {time.monotonic() - began:.0f} s"
    )
    for kind, (k, n) in failed.items():
        print(f"  {n} times, first input {k}: {kind}")
    return int(bool(failed) or slowest[0] > SLOW)


if __name__ == "__main__":
    sys.exit(main())
