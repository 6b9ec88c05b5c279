"""A Maslow's anchors: the firmware's published model holds the belts that the robot does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

import pkmcal as pk

from .. import robots

ANCHORS = np.array([[-27.6, 2064.9], [2924.3, 2066.5], [0.0, 0.0], [2953.2, 0.0]])
YAML = """\
kinematics:
  MaslowKinematics:
    tlX: -6.200000
    tlY: 2188.000000
    tlZ: 100.000000
    trX: 2991.199951  # trY: 5.0
    trY: 2197.399902
    trZ: 56.000000
    blX: 0.000000
    blY: 0.000000
    blZ: 34.000000
    brX: 2989.800049
    brY: 0.000000
    brZ: 78.000000
    beltEndExtension: 30.000000
"""
LOG = """\
[MSG:INFO: Anchor points updated - TL: (1,2)]
$/Maslow_tlX=1.0
CLBM:[{bl:1.00,   br:1.00,   tr:1.00,   tl:1.00},]
$/Maslow_tlX=-6.2
$/Maslow_tlY=2188.0
$/Maslow_trX=2991.2
$/Maslow_trY=2197.4
$/Maslow_brX=2989.8
CLBM:[{bl:1851.5, br:1843.25,   tr:1.8e3,   tl:1820},{bl:1700.0, br:1990.0, tr:1950.5, tl:1680.0},]
ok
"""
RUN = Path(__file__).resolve().parents[3] / "shared" / "data" / "maslow" / "run1.csv"


def machine(order: list[int], **changes: float) -> pk.Robot:
    limbs = [{"kind": "cable", "base": [*ANCHORS[i], 0.0], "platform": [0, 0, 0]} for i in order]
    return robots.made("xy", {"x": 1450.0, "y": 1000.0}, limbs).replace(changes)


def firmware_belts(text: str, x: float, y: float) -> list[float]:
    """computeTL … computeBR of the firmware at z = 0 with all heights 0, less end and arm."""
    number = {}
    for line in text.splitlines()[2:]:
        name, value = line.split(":")
        number[name.strip()] = float(value)
    a = (number["trY"] - number["blY"]) / (number["trX"] - number["blX"])
    b = (number["brY"] - number["tlY"]) / (number["brX"] - number["tlX"])
    centre_x = (number["brY"] - b * number["brX"] + a * number["trX"] - number["trY"]) / (a - b)
    centre_y = a * (centre_x - number["trX"]) + number["trY"]
    x, y = x + centre_x, y + centre_y
    return [
        float(np.hypot(number[f"{corner}X"] - x, number[f"{corner}Y"] - y))
        for corner in ("tl", "tr", "bl", "br")
    ]


def centre() -> np.ndarray:
    """Where the diagonals meet."""
    (tl, tr, bl, br) = ANCHORS
    along = np.linalg.solve(np.column_stack([tr - bl, tl - br]), tl - bl)
    return np.asarray(bl + along[0] * (tr - bl))


@pytest.mark.parametrize("order", [[0, 1, 2, 3], [2, 3, 0, 1], [3, 0, 1, 2]])
def test_firmware_holds_the_belts_of_the_robot_whatever_the_order_of_its_limbs(
    tmp_path: Path, order: list[int]
) -> None:
    robot = machine(order)
    assert pk.export.maslow(robot, tmp_path / "lines.yaml").exact
    text = (tmp_path / "lines.yaml").read_text()
    for x, y in np.random.default_rng(1).uniform(-600, 600, (20, 2)):
        pose = np.array([*(np.array([x, y]) + centre()), 0, 0, 0, 0])
        belts = np.empty(4)
        belts[order] = robot.inverse(pose)
        np.testing.assert_allclose(firmware_belts(text, x, y), belts, atol=1e-5)


def test_users_file_is_kept_but_for_the_anchors(tmp_path: Path) -> None:
    (tmp_path / "maslow.yaml").write_text(YAML)
    pk.export.maslow(machine([0, 1, 2, 3]), tmp_path / "new.yaml", tmp_path / "maslow.yaml")
    new = (tmp_path / "new.yaml").read_text()
    pairs = list(zip(YAML.splitlines(), new.splitlines(), strict=True))
    changed = [after.split("#")[0].strip() for before, after in pairs if before != after]
    assert changed == [
        "tlX: -27.600000", "tlY: 2064.900000", "trX: 2924.300000", "trY: 2066.500000",
        "brX: 2953.200000",
    ]  # fmt: skip
    assert "2924.300000  # trY: 5.0" in new
    again = pk.import_printer(tmp_path / "new.yaml", "maslow")
    assert str(again) == "new: a Maslow, no stored places" and again.measurements is None
    np.testing.assert_allclose(again.robot.slots[:, :2], ANCHORS)


def test_numbers_that_say_the_same_stay_as_they_are_written(tmp_path: Path) -> None:
    own = "\ufefftlX: -27.6\ntlY: +2064.90 # left\r\ntrX: 2924.3\ntrY: 2.0665e3\nblX: 0\nblY: 0\n"
    own += "brX: 2953.2\nbrY: 0.0\n"
    (tmp_path / "m.yaml").write_bytes(own.encode())
    robot = machine([0, 1, 2, 3])
    pk.export.maslow(robot, tmp_path / "n.yaml", tmp_path / "m.yaml")
    assert (tmp_path / "n.yaml").read_bytes().decode() == own
    pk.export.maslow(robot.replace({"base2.x": 2925.0}), tmp_path / "n.yaml", tmp_path / "m.yaml")
    assert (tmp_path / "n.yaml").read_bytes().decode() == own.replace("2924.3", "2925.000000")


def test_a_log_is_its_last_set_and_its_last_anchors(tmp_path: Path) -> None:
    (tmp_path / "m.log").write_text(LOG)
    found = pk.import_printer(tmp_path / "m.log", "maslow")
    assert str(found) == "m: a Maslow, 2 stored places"
    assert found.measurements is not None and found.measurements.kind == "closure"
    np.testing.assert_array_equal(
        found.measurements.actuators, [[1820, 1800, 1851.5, 1843.25], [1680, 1950.5, 1700, 1990]]
    )
    np.testing.assert_array_equal(found.robot.slots[0, :2], [-6.2, 2188.0])


def test_offsets_and_gains_are_refused_or_projected(tmp_path: Path) -> None:
    robot = machine([0, 1, 2, 3], offset1=4.0, gain2=1.002)
    with pytest.raises(pk.ArgumentError, match=r"no offset and no gain of a belt.*off by \d"):
        pk.export.maslow(robot, tmp_path / "x.yaml")
    assert not (tmp_path / "x.yaml").exists()
    loss = pk.export.maslow(robot, tmp_path / "x.yaml", project=True)
    assert 1e-3 < loss.rms < 4.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("tlX: 1\n", r"no number for tlY, trX, trY, brX: anchors of a Maslow"),
        (YAML.replace("-6.200000", "1e308"), r"tlX must be at most 1e\+15 mm, found 1e\+308"),
        (YAML.replace("tlX: ", "tlX: 1,5"), r"no number for tlX"),  # a decimal comma
        (LOG.replace("tl:1680.0", ""), r"place 2 of CLBM must have bl, br, tr and tl"),
        (LOG.replace("tl:1680.0", "tl:nan"), r"place 2 of CLBM must have"),
    ],
)
def test_what_is_no_maslow_is_named(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "x.log").write_text(text)
    with pytest.raises(pk.FileError, match=message):
        pk.import_printer(tmp_path / "x.log", "maslow")


def test_robots_that_are_no_maslow_are_refused(tmp_path: Path) -> None:
    with pytest.raises(pk.ArgumentError, match="no point in the plane"):
        pk.export.maslow(pk.load("linear-delta"), tmp_path / "x.yaml")
    limbs = [
        {"kind": "cable", "base": base, "platform": [0, 0, 0]}
        for base in ([0, 0, 0], [900, 0, 0], [1800, 0, 0], [900, 900, 0])
    ]
    with pytest.raises(pk.ArgumentError, match="an anchor in each corner, found"):
        pk.export.maslow(robots.made("xy", {"x": 900.0, "y": 300.0}, limbs), tmp_path / "x.yaml")
    (tmp_path / "u.yaml").write_text("tlX: 1\n" + YAML)
    with pytest.raises(pk.FileError, match="tlX stands 2 times"):
        pk.export.maslow(machine([0, 1, 2, 3]), tmp_path / "x.yaml", tmp_path / "u.yaml")


@pytest.mark.skipif(not RUN.exists(), reason=f"{RUN} is not here")
def test_a_real_log_leads_to_anchors_of_the_yaml(tmp_path: Path) -> None:
    """The anchors are those of an independent least squares over all places at once."""
    lengths = np.loadtxt(RUN, delimiter=",", skiprows=1)
    places = "".join(f"{{bl:{bl}, br:{br}, tr:{tr}, tl:{tl}}}," for tl, tr, bl, br in lengths)
    head = LOG[: LOG.rindex("CLBM")]
    (tmp_path / "m.log").write_text(f"{head}CLBM:[{places}]\n")
    log = pk.import_printer(tmp_path / "m.log", "maslow")
    assert log.measurements is not None
    found = pk.identify(log.robot, log.measurements)
    pk.export.maslow(found.robot, tmp_path / "new.yaml")

    def misfit(x: np.ndarray) -> np.ndarray:
        anchors = np.array([[x[0], x[1]], [x[2], x[3]], [0.0, 0.0], [x[4], 0.0]])
        places = x[5:].reshape(-1, 1, 2)
        return np.asarray((np.linalg.norm(places - anchors, axis=2) - lengths).ravel())

    start = log.robot.forward(lengths).pose[:, :2]
    theirs = least_squares(misfit, [-6.2, 2188.0, 2991.2, 2197.4, 2989.8, *start.ravel()]).x[:5]
    yaml = (tmp_path / "new.yaml").read_text()
    text = [yaml.split(f"{name}: ")[1].split()[0] for name in ("tlX", "tlY", "trX", "trY", "brX")]
    np.testing.assert_allclose(list(map(float, text)), theirs, atol=1e-3)
