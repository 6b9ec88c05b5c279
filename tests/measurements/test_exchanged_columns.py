"""Two columns of a file that are called by each other's name are read the other way round."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk


@pytest.mark.parametrize("machine", ["hexapod", "linear-delta", "3rps"])
def test_what_the_hint_on_exchanged_columns_says_to_type_reads_them_as_they_were(
    machine: str, tmp_path: Path
) -> None:
    robot = pk.load(machine)
    q = robot.inverse(pk.sample_poses(robot, 8, seed=1), match=True)
    measured = pk.VirtualMachine(robot, seed=0).measure(q)
    measured.write(tmp_path / "sound.csv")
    sound = pk.read_measurements(tmp_path / "sound.csv", robot)
    text = (tmp_path / "sound.csv").read_text().replace("q1 [", "q? [").replace("q3 [", "q1 [")
    (tmp_path / "wrong.csv").write_text(text.replace("q? [", "q3 ["))
    wrong = pk.read_measurements(tmp_path / "wrong.csv", robot)
    assert not np.array_equal(wrong.actuators, sound.actuators)
    mended = pk.read_measurements(tmp_path / "wrong.csv", robot, rename={"q1": "q3", "q3": "q1"})
    np.testing.assert_array_equal(mended.actuators, sound.actuators)
    with pytest.raises(ValueError, match="it is another"):
        pk.read_measurements(tmp_path / "wrong.csv", robot, rename={"q1": "q3"})
