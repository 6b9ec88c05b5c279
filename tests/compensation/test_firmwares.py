"""Corrected programs lead the machine where the program meant, as each firmware reads them.

The interpreters are of their own (`reads_marlin` and its like), the programs by chance.
"""

from __future__ import annotations

import random
from itertools import product
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import pkmcal as pk

from . import generated_programs, reads_klipper, reads_linuxcnc, reads_marlin, reads_reprap
from .controller import Controller, Odd

DELTA = pk.load("linear-delta")
MACHINE = DELTA.replace({
    "rod1": 215.6,
    "base2.x": DELTA.geometry["base2.x"] + 0.4,
    "offset3": 0.3,
    "slider1.tilt1": 0.003,
})  # fmt: skip
READS: dict[str, ModuleType] = {
    "linuxcnc": reads_linuxcnc,
    "marlin": reads_marlin,
    "reprap": reads_reprap,
    "klipper": reads_klipper,
}
START = {"X": 4.0, "Y": 5.0, "Z": 40.0}
VERSIONS = {"linuxcnc": (0,), "marlin": (1, 2), "reprap": (0, 1), "klipper": (0, 1)}
CHORD = 5e-4  # mm: lines go in parts
ROUNDING = 4e-4  # mm: five decimals of an inch in three axes


def corrected(text: str, firmware: str, folder: Path, **options: Any) -> str:
    path = folder / "part.gcode"
    path.write_bytes(text.encode())
    found = pk.compensate_program(
        DELTA,
        MACHINE,
        path,
        firmware=firmware,
        chord=CHORD,
        **options,  # type: ignore[arg-type]
    )
    return found.text


LINES = {
    "linuxcnc": {"G1"},
    "marlin": {"G0", "G1"},
    "reprap": {"G0", "G1"},
    "klipper": {"G0", "G1"},
}


def reached(told: np.ndarray, joints: bool) -> np.ndarray:
    """Where the machine goes on the coordinates of a controller."""
    if not joints:
        told = DELTA.inverse(np.concatenate([told, np.zeros_like(told)], axis=1))
    guess = np.tile(DELTA.home, (len(told), 1))
    return MACHINE.forward(told, guess=guess).pose[:, :3]


def require_the_same(meant: Controller, did: Controller, joints: bool, lines: set[str]) -> None:
    """Each move ends where it was meant, with its filament and in its time; lines are straight."""
    told = [step for step in did.steps if step.moves]
    ends, begins = (
        np.array([getattr(step, name) for step in told]).reshape(-1, 3) for name in ("at", "begin")
    )
    moved = iter(zip(reached(ends, joints), reached((ends + begins) / 2, joints), strict=True))
    steps = [(step, *(next(moved) if step.moves else (None, None))) for step in did.steps]
    filament, going_on = 0.0, False
    for wanted in meant.steps:
        if not wanted.moves:
            assert steps and steps[0][0].did == wanted.did
            steps.pop(0)
            going_on = False  # it may have moved the machine
            continue
        target, before = np.array(wanted.at), np.array(wanted.begin)
        way, amount = target - before, wanted.extruded - filament
        minutes = 0.0
        while True:
            assert steps and steps[0][0].moves, f"{wanted}: not reached"
            step, at, between = steps.pop(0)
            assert step.did == wanted.did, (step, wanted)
            if going_on and wanted.did in lines:
                aside = between - before - (between - before) @ way / max(way @ way, 1e-12) * way
                assert np.linalg.norm(aside) < CHORD + ROUNDING, (wanted, step, aside)
            minutes += step.minutes
            stays = not going_on and not way.any()  # E alone, where no move has led
            if stays or np.linalg.norm(at - target) < ROUNDING:
                break
            share = np.clip((at - before) @ way / max(way @ way, 1e-12), 0.0, 1.0)
            assert np.linalg.norm(at - before - share * way) < ROUNDING, (wanted, at)
            assert abs(step.extruded - filament - share * amount) < 2e-3 + 1e-3 * abs(amount)
        assert abs(step.extruded - wanted.extruded) < 1e-4, (wanted, step)
        if wanted.did == "G1" and np.linalg.norm(way) > 2.0:
            share = 0.02 if going_on else 0.02 + 2.0 / np.linalg.norm(way)  # not corrected there
            assert abs(minutes - wanted.minutes) <= share * abs(wanted.minutes) + 1e-6, (
                wanted,
                minutes,
            )
        filament, going_on = wanted.extruded, not stays
    assert not steps


def followed(text: str, firmware: str, folder: Path, start: bool, joints: bool) -> bool:
    """Whether a program is corrected; if so, in all versions of the firmware as it was meant."""
    options: dict[str, Any] = {"joints": joints}
    if start:
        options["start"] = [START[axis] for axis in "XYZ"] + [0.0, 0.0, 0.0]
    try:
        new = corrected(text, firmware, folder, **options)
    except pk.FileError:
        return False
    begin = START if start else {"X": 1.0, "Y": 2.0, "Z": 3.0}
    for version in VERSIONS[firmware]:
        run = READS[firmware].run
        meant = run(text, begin, begin, version)
        require_the_same(meant, run(new, begin, begin, version), joints, LINES[firmware])
    return True


PART = 1000  # programs of a slow test: 10 000 in parts that can be run alone
CASES = [
    pytest.param(range(40), id="quick"),
    *(
        pytest.param(range(first, first + PART), id=f"from {first}", marks=pytest.mark.slow)
        for first in range(0, 10_000, PART)
    ),
]


@pytest.mark.parametrize("seeds", CASES)
@pytest.mark.parametrize("firmware", READS)
def test_the_machine_goes_where_the_program_meant(
    firmware: str, seeds: range, tmp_path: Path
) -> None:
    """Usual programs are all taken."""
    for seed in seeds:
        rng = random.Random(f"{firmware} {seed}")
        joints = firmware == "linuxcnc" and seed % 3 == 0
        text = generated_programs.program(firmware, rng, joints=joints)
        assert followed(text, firmware, tmp_path, True, joints), text


@pytest.mark.parametrize("firmware", READS)
def test_each_word_is_corrected_or_refused(firmware: str, tmp_path: Path) -> None:
    """Alone in a program; what may move the machine asks for all axes behind it."""
    texts = (each[firmware] for each in (generated_programs.ODD, generated_programs.ELSEWHERE))
    words = [word for text in texts for word in generated_programs.words(text)]
    for word in words:
        for named in (False, True):
            text = generated_programs.with_word(firmware, word, named)
            for joints in {False, firmware == "linuxcnc"}:
                try:
                    followed(text, firmware, tmp_path, True, joints)
                except (AssertionError, Odd) as wrong:
                    raise AssertionError(f"{word!r}: {wrong!r}") from wrong


@pytest.mark.parametrize("firmware", ["marlin", "reprap"])
def test_filament_that_begins_anew_in_inches_is_in_inches(firmware: str, tmp_path: Path) -> None:
    text = "G28\nG20\nG90\nM82\nG92 E0\nG1 X0 Y0 Z1.5 F60\nG92 E4\nG1 X1 Y0.4 E4.1\nG1 X0 E4.2\n"
    assert followed(text, firmware, tmp_path, True, False)


@pytest.mark.parametrize("firmware", ["marlin", "reprap", "klipper"])
def test_filament_is_as_meant_after_any_order_of_modes(firmware: str, tmp_path: Path) -> None:
    orders = list(product(("G90", "G91", "M82", "M83"), repeat=3))
    taken = [
        followed(generated_programs.with_modes(modes), firmware, tmp_path, True, False)
        for modes in orders
    ]
    assert sum(taken) > 0.2 * len(orders)


@pytest.mark.parametrize("seeds", CASES)
@pytest.mark.parametrize("firmware", READS)
def test_what_means_something_else_is_corrected_or_refused(
    firmware: str, seeds: range, tmp_path: Path
) -> None:
    """With words in any place that move the origin, other axes, otherwise, or nothing."""
    taken = 0
    for seed in seeds:
        rng = random.Random(f"odd {firmware} {seed}")
        joints = firmware == "linuxcnc" and seed % 3 == 0
        text = generated_programs.program(firmware, rng, rng.choice([1, 1, 2, 3]), joints)
        try:
            taken += followed(text, firmware, tmp_path, rng.random() < 0.5, joints)
        except (AssertionError, Odd) as wrong:
            raise AssertionError(f"seed {seed}: {wrong!r}\n{text}") from wrong
    assert taken > 0.05 * len(seeds)
