"""Classes of the package that one call of `identify` goes through: what a reader has to follow.

``python -m benchmarks.trace_identify`` prints their number and names for a hexapod, for sessions
and for a machine with surplus actuators. A class counts if an instance of it is made or one of its
own functions runs, whether for an instance of it or of a class derived from it.
"""

from __future__ import annotations

import gc
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from types import CodeType, FrameType

import numpy as np

import pkmcal as pk

SEED, ROWS, NOISE = 1, 60, 0.01
ANCHORS = np.array([[0, -1597, -120.0], [1550, 900, -120], [-1370, 790, -120], [0, 0, 2355.0]])


def classes() -> list[type]:
    """The classes of the package that there are."""
    return [
        c
        for c in gc.get_objects()
        if isinstance(c, type) and str(c.__module__).startswith("pkmcal")
    ]


def codes(cls: type) -> Iterator[CodeType]:
    """The code of its own functions, properties among them."""
    for value in vars(cls).values():
        for name in ("fget", "__func__", "func", "__wrapped__"):
            value = getattr(value, name, None) or value
        code = getattr(value, "__code__", None)
        if isinstance(code, CodeType):
            yield code


def passed(call: Callable[[], object]) -> list[str]:
    """The names of the classes that a call goes through."""
    known = classes()
    of_code = {code: cls for cls in known for code in codes(cls)}
    tuples = {cls for cls in known if issubclass(cls, tuple)}
    found: set[type] = set()

    def note(frame: FrameType, event: str, argument: object) -> None:
        if event == "call" and frame.f_code in of_code:
            found.add(of_code[frame.f_code])
            first = next(iter(frame.f_locals.values()), None)
            if type(first) in known_set:
                found.add(type(first))
        elif event == "return" and type(argument) in tuples:
            found.add(type(argument))
        if event == "call" and frame.f_code.co_name == "__new__":  # of a named tuple
            found.update({frame.f_locals.get("_cls")} & tuples)

    known_set = set(known)
    sys.setprofile(note)
    try:
        call()
    finally:
        sys.setprofile(None)
    return sorted(f"{c.__module__.removeprefix('pkmcal.')}.{c.__qualname__}" for c in found)


def cases() -> Iterator[tuple[str, Callable[[], object]]]:
    """Each machine and its call."""
    robot = pk.load("hexapod")
    random = np.random.default_rng(SEED)
    off = {name: robot.geometry[name] + 0.2 * random.normal() for name in _offsets(robot)}
    machine = pk.VirtualMachine(robot.replace(off), noise=NOISE, seed=SEED)
    poses = pk.sample_poses(robot, ROWS, seed=SEED)
    read = machine.measure(robot.inverse(poses), "pose")
    yield f"hexapod, {ROWS} poses", lambda: pk.identify(robot, read)
    half = np.where(np.arange(ROWS) < ROWS // 2, "one", "two")
    sessions = pk.Measurements(read.actuators, read.values, "pose", sigma=NOISE, session=half)
    yield "with sessions", lambda: pk.identify(robot, sessions, per_session="offset*")
    point = _hung()
    at = random.uniform([-500.0, -500.0, 0.0], [500.0, 500.0, 1200.0], (ROWS, 3))
    lengths = np.linalg.norm(at[:, None] - ANCHORS, axis=2)
    surplus = pk.Measurements(lengths + random.normal(0.0, NOISE, lengths.shape), at, sigma=NOISE)
    yield "with surplus actuators", lambda: pk.identify(point, surplus, "offset*")


def _hung() -> pk.Robot:
    """A point on four cables: one more than it has coordinates."""
    limbs = "".join(
        f'[[limb]]\nkind = "UPS"\nbase = {anchor.tolist()}\nplatform = [0.0, 0.0, 0.0]\n'
        for anchor in ANCHORS
    )
    head = 'units = { length = "mm", angle = "deg" }\n[pose]\nmap = "translation"\n'
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hung.toml"
        path.write_text(f'name = "hung"\n{head}home = {{ z = 600.0 }}\n{limbs}', "utf-8")
        return pk.load(path)


def _offsets(robot: pk.Robot) -> tuple[str, ...]:
    return tuple(robot.geometry.match("offset*"))


def main() -> None:
    """Print them."""
    warnings.simplefilter("ignore")
    for name, call in cases():
        call()  # imports and tables are made once
        found = passed(call)
        print(f"{name}: {len(found)} classes")
        print("  " + ", ".join(found))


if __name__ == "__main__":
    main()
