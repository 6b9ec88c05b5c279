"""A long run: ``python -m tests.fuzz csv --count 1000000 --seed 1``.

Number k of a seed is always the same: ``--from k --count 1`` gives it again. What fails is written
to ``fuzz-DOOR-SEED-K.bin`` in the current folder and the run goes on.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from pathlib import Path
from random import Random

from .damage import Door, damaged
from .doors import DOORS

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
    door: Door = DOORS[name]
    entered = accepted = 0
    failed: dict[str, tuple[int, int]] = {}
    slowest = (0.0, -1)
    began, worked = time.monotonic(), time.process_time()
    signal.signal(signal.SIGPROF, _stopped)
    with tempfile.TemporaryDirectory(dir=MEMORY if MEMORY.is_dir() else None) as folder:
        for k in range(first, first + count):
            if time.monotonic() - began > seconds:
                break
            before = time.monotonic()
            chance = Random(f"{seed} {k}")  # by which the door chooses, too
            content = damaged(door, chance)
            entered += 1
            try:
                signal.setitimer(signal.ITIMER_PROF, SLOW)
                accepted += door.enter(Path(folder), content, chance)
            except KeyboardInterrupt:
                raise
            except BaseException as error:
                *_, within, where = traceback.extract_tb(error.__traceback__)
                where = within if isinstance(error, TooLong) else where
                kind = f"{type(error).__name__} {Path(where.filename).name}:{where.lineno}"
                if kind not in failed:
                    Path(f"fuzz-{name}-{seed}-{k}.bin").write_bytes(content)
                    print(f"input {k}: {kind}: {str(error)[:300]!r}", flush=True)
                failed[kind] = (failed.get(kind, (k, 0))[0], failed.get(kind, (k, 0))[1] + 1)
            finally:
                signal.setitimer(signal.ITIMER_PROF, 0.0)
            slowest = max(slowest, (time.monotonic() - before, k))
            emptied(folder)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"{name}, seed {seed}, numbers {first} to {first + entered - 1}: {entered} inputs,"
        f" {accepted} taken, {sum(n for _, n in failed.values())} failed in {len(failed)} ways;"
        f" slowest {slowest[0]:.2f} s (input {slowest[1]}), {memory:.0f} MB,"
        f" {time.process_time() - worked:.0f} s of processor time"
    )
    for kind, (k, n) in failed.items():
        print(f"  {n} times, first input {k}: {kind}")
    return int(bool(failed))


class TooLong(BaseException):
    """An input has taken too much of the processor's time; nothing catches that by mistake."""


def _stopped(*_: object) -> None:
    raise TooLong


def emptied(folder: str) -> None:
    """The folder as before: an input must not see what another one left."""
    with os.scandir(folder) as found:
        for each in found:
            if each.is_dir(follow_symlinks=False):
                shutil.rmtree(each.path)
            else:
                os.unlink(each.path)


if __name__ == "__main__":
    sys.exit(main())
