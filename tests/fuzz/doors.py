"""What comes in from outside, and what must hold for whatever comes.

A door takes bytes, however damaged, and either refuses them with the package's own error, which
names the file and can be printed on one line, or takes them, and then what it gives can be used and
written and is read back the same.
"""

from __future__ import annotations

import io
import json
import os
import warnings
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from typer.testing import CliRunner

import pkmcal as pk
from pkmcal.cli.verbs import app
from pkmcal.display import printable
from pkmcal.measurements.command_csv import read_commands
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.pose_csv import read_poses

ROOT = Path(__file__).resolve().parents[2]
MACHINES = ROOT / "pkmcal" / "builtin" / "machines"
LOGS = ROOT / "tests" / "data"
EXAMPLES = ROOT / "examples"
MACHINE = pk.load("2tpr2tps")
LONGEST = 1000  # letters of a message


@dataclass(frozen=True)
class Door:
    """Seeds, words that mean something there, and what is done with an input."""

    seeds: tuple[bytes, ...]
    tokens: tuple[bytes, ...]
    enter: Callable[[Path, bytes], bool]  # folder, input -> was it taken?


def taken(path: Path, read: Callable[[Path], Any]) -> Any:
    """What `read` gives, or None where it refuses as it should."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return read(path)
        except pk.Error as error:
            message = str(error)
            assert str(path) in message, f"names no file: {message!r}"
            assert len(message) < LONGEST + len(str(path)), f"{len(message)} letters"
            assert message.isprintable() or printable(message) != "", message
            return None


# --- robot files ---------------------------------------------------------------------------------


def robot(folder: Path, content: bytes) -> bool:
    path = folder / "robot.toml"
    path.write_bytes(content)
    found = taken(path, pk.load)
    if found is None:
        return False
    assert repr(found) and str(found)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        if isinstance(found, pk.SerialArm):
            motions = found.forward(np.zeros(found.n_joints))
            assert motions.shape == (4, 4)
            return True
        found.save(folder / "again.toml")
        again = pk.load(folder / "again.toml")
        assert isinstance(again, pk.Robot)
        assert again.geometry.names == found.geometry.names
        np.testing.assert_array_equal(again.geometry.values, found.geometry.values)
        np.testing.assert_array_equal(again.home, found.home)
        q = found.inverse(found.home)
        np.testing.assert_array_equal(again.inverse(found.home), q)
        if np.isfinite(q).all():
            solved = found.forward(q)
            assert np.isfinite(solved.pose).all() == solved.ok.all()
    return True


# --- tables --------------------------------------------------------------------------------------


def same(a: Measurements, b: Measurements) -> None:
    assert (a.kind, a.target_names) == (b.kind, b.target_names)
    for name in ("actuators", "values", "sigma", "group", "target", "target_index"):
        one, other = getattr(a, name, None), getattr(b, name, None)
        assert (one is None) == (other is None), name
        if one is not None:
            np.testing.assert_array_equal(one, other)


def table(folder: Path, content: bytes, name: str = "m.csv") -> bool:
    path = folder / name
    path.write_bytes(content)
    found = taken(path, pk.read_measurements)
    taken(path, lambda each: pk.read_measurements(each, MACHINE))
    taken(path, lambda each: read_poses(each, MACHINE))
    taken(path, lambda each: read_commands(each, ("mm",) * 4))
    if found is None:
        return False
    assert repr(found) and str(found)
    found.write(folder / "again.csv")
    same(pk.read_measurements(folder / "again.csv"), found)
    return True


def workbook(folder: Path, content: bytes) -> bool:
    path = folder / "m.xlsx"
    path.write_bytes(content)
    return taken(path, pk.read_measurements) is not None


def sheet(content: bytes) -> bytes:
    """A workbook whose sheet is this: damage inside what is packed."""
    made = io.BytesIO()
    with zipfile.ZipFile(WORKBOOK) as whole, zipfile.ZipFile(made, "w") as book:
        for part in whole.namelist():
            inside = part == "xl/worksheets/sheet1.xml"
            book.writestr(part, content if inside else whole.read(part))
    return made.getvalue()


# --- arms and printers ---------------------------------------------------------------------------


def arm(folder: Path, content: bytes) -> bool:
    path = folder / "arm.urdf"
    path.write_bytes(content)
    found = taken(path, pk.SerialArm.from_urdf)
    if found is None:
        return False
    assert repr(found) and str(found)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found.save_urdf(folder / "again.urdf", path)
        again = pk.SerialArm.from_urdf(folder / "again.urdf")
        assert again.kinds == found.kinds
        at = np.zeros(found.n_joints)
        one, other = found.forward(at), again.forward(at)
        largest = max(1.0, float(np.abs(found.points).max(initial=0.0)))
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-9 * largest)
    return True


def printer(folder: Path, content: bytes) -> bool:
    path = folder / "printer.cfg"
    path.write_bytes(content)
    some = False
    for firmware in ("klipper", "reprap", "marlin"):
        found = taken(path, lambda each, way=firmware: pk.import_printer(each, way))
        if found is None:
            continue
        some = True
        assert repr(found) and str(found)
        (folder / "robot.toml").write_text(found.text, encoding="utf-8")
        again = pk.load(folder / "robot.toml")
        assert isinstance(again, pk.Robot)
        np.testing.assert_array_equal(again.geometry.values, found.robot.geometry.values)
    return some


# --- command lines -------------------------------------------------------------------------------

FILES = {
    "robot.toml": EXAMPLES / "linear-delta" / "robot.toml",
    "probe.csv": EXAMPLES / "linear-delta" / "probe.csv",
    "printer.cfg": EXAMPLES / "linear-delta" / "printer.cfg",
    "desired.csv": EXAMPLES / "2tpr2tps-compensation" / "desired.csv",
    "measured.csv": EXAMPLES / "2tpr2tps-compensation" / "measured.csv",
}


@contextmanager
def within(folder: Path) -> Iterator[None]:
    """In this folder; `contextlib.chdir` of later Pythons."""
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


def line(folder: Path, content: bytes) -> bool:
    """Words of a command line, one on each line of the input, in a folder with some files."""
    words = content.decode("utf-8", "replace").replace("\0", "").split("\n")
    for name, source in FILES.items():
        (folder / name).write_bytes(source.read_bytes())
    with within(folder), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        ended = CliRunner().invoke(app, words, prog_name="pkmcal")
    assert ended.exit_code in (0, 1, 2), f"exit {ended.exit_code}: {ended.output[-LONGEST:]}"
    assert "Traceback" not in ended.output
    if ended.exit_code == 2:
        *_, last = ended.stderr.splitlines()
        assert last.startswith("pkmcal: "), last
    elif "--json" in words and "--help" not in words and ended.stdout.startswith(("{", "[")):
        json.loads(ended.stdout, parse_constant=_no_json)
    for name, source in FILES.items():
        if "--force" not in words:
            assert (folder / name).read_bytes() == source.read_bytes(), f"{name} was replaced"
    return bool(ended.exit_code < 2)


def _no_json(word: str) -> None:
    raise AssertionError(f"{word} is not JSON")


# --- seeds ---------------------------------------------------------------------------------------

WORKBOOK = LOGS / "same" / "excel.xlsx"
_SHEET = zipfile.ZipFile(WORKBOOK).read("xl/worksheets/sheet1.xml")
_NUMBERS = (
    b"0",
    b"-1",
    b"1e308",
    b"-1e300",
    b"1e-320",
    b"nan",
    b"inf",
    b"1e15",
    b"99999999999",
    b"",
)
_TOML = tuple(sorted(each.read_bytes() for each in MACHINES.glob("*.toml")))
_ARMS = tuple(
    each.read_bytes() for each in sorted((ROOT / "pkmcal" / "builtin" / "arms").glob("*.toml"))
)
_CSV = tuple(
    each.read_bytes()
    for each in sorted(LOGS.glob("*/*"))
    if each.suffix in (".csv", ".tsv", ".txt")
)
_URDF = b"""<?xml version="1.0"?>
<robot name="demo"><link name="base"/><link name="a"/><link name="b"/><link name="tool"/>
<joint name="j1" type="revolute"><parent link="base"/><child link="a"/>
<origin xyz="0 0 0.4" rpy="0 0 0"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
<joint name="j2" type="prismatic"><parent link="a"/><child link="b"/>
<origin xyz="0.1 0 0" rpy="0 1.57 0.3"/><axis xyz="0 1 1"/></joint>
<joint name="t" type="fixed"><parent link="b"/><child link="tool"/></joint></robot>
"""
_GCODE = b"M665 R105.6 L217.5 H240.1 B85 X0.1 Y-0.2 Z0 ; delta\nM666 X-0.1 Y0.2 Z0.0\n"
_LINES = tuple(
    "\n".join(each.split()).encode()
    for each in (
        "demo --seed 3 --json",
        "machines --json",
        "new hexapod mine.toml",
        "check robot.toml --json",
        "check hexapod",
        "sensitivity 2tpr2tps --step 0.1 --json",
        "tolerance 2tpr2tps --sigma 0.1 --samples 100 --json",
        "tolerance hexapod --allowed 0.1",
        "plan robot.toml --count 8 --kind height --prior 0.5 --out plan --json",
        "calibrate robot.toml probe.csv --prior 0.5 --json",
        "calibrate robot.toml probe.csv --prior 0.5 --holdout 0.2 --report out --force",
        "compensate 2tpr2tps desired.csv measured.csv --orientation assumed --json",
        "export robot.toml --as klipper --config printer.cfg --out new.cfg --json",
        "export hexapod --as c --out hexapod.h --number float",
        "import printer.cfg --out imported --json",
        "inverse hexapod 0,0,800,0,0,0 --json",
        "inverse 2tpr2tps desired.csv --match --out . --force",
        "forward hexapod 700,700,700,700,700,700 --json",
    )
)
_WORDS = b"""
--json --force --help --version --rad --match --common --project --seed --samples --out --report
--free --prior --holdout --loss --frame --target --tracker --poses --targets --criterion --kind
--noise --count --accuracy --sigma --allowed --map --step --as --from --number --config --unknown
--method --orientation --bounds robot.toml probe.csv hexapod desired.csv measured.csv 2tpr2tps 3r
linear-delta nothing.toml . .. / unknown measured huber pso exact D A pose height position y,z
base*=0.5 rod* angle1=0.1deg 0.5 12 -1 0 1e308 nan 1,2,3 c klipper reprap marlin mjcf float demo
check plan inverse -- - ' \x1b[31m \xe2\x80\xae
""".split()

_TOML_WORDS = rb"""
[pose] [[limb]] [ties] [[joint]] ''' { [ ] } = . # \u001b true rod kind 'RUS' 'PRS' 'UPR' base
platform units 'deg' 'm' 'planar' 'translation' home match free stroke branch gain name
""".split()
_CSV_WORDS = b"""
, ; " # [ ] [mm] [m] [deg] (in) q1 q5 x z alpha sigma sigma.x cov.x.y target target.x attachment.x
distance group A.x B.z time \xff\xfe \xef\xbb\xbf \x1b \xcf\x83
""".split()
_SHEET_WORDS = b"""
<c </c> <row </row> <v> <f> <is> <t> r="XFD1048576" t="s" t="e" t="b" t="d" s="9" &lt; &x; <!DOCTYPE
""".split()
_URDF_WORDS = b"""
<joint </joint> <link /> <axis <origin <limit <mimic xyz= rpy= " type= fixed floating planar
continuous base tool <!DOCTYPE <!-- --> &amp; &x; \xff
""".split()
_PRINTER_WORDS = b"""
[stepper_a] [printer] kinematics:delta arm_length: angle: : = #*# # ; M665 M666 L R X gear_ratio:0:1
microsteps:0 rotation_distance:0 height0 [delta_calibrate] \xff
""".split()
_ZIP_WORDS = (b"PK\x03\x04", b"PK\x01\x02", b"\0\0", b"\xff\xff\xff\xff", b"\x08\0", b"xl/")
_MARKS = (b"\n", b"\r", b"\t", b" ", b"\0", b'"""')

DOORS = {
    "toml": Door((*_TOML, *_ARMS), (*_NUMBERS, *_MARKS, *_TOML_WORDS), robot),
    "csv": Door(_CSV, (*_NUMBERS, *_MARKS, *_CSV_WORDS), table),
    "xlsx": Door(
        (WORKBOOK.read_bytes(), *(each.read_bytes() for each in LOGS.glob("same/excel-*.xlsx"))),
        _ZIP_WORDS,
        workbook,
    ),
    "sheet": Door(
        (_SHEET,),
        (*_NUMBERS, *_MARKS, *_SHEET_WORDS),
        lambda folder, content: workbook(folder, sheet(content)),
    ),
    "urdf": Door((_URDF,), (*_NUMBERS, *_MARKS, *_URDF_WORDS), arm),
    "printer": Door(
        (FILES["printer.cfg"].read_bytes(), _GCODE), (*_NUMBERS, *_MARKS, *_PRINTER_WORDS), printer
    ),
    "line": Door(_LINES, tuple(each + b"\n" for each in (*_WORDS, *_NUMBERS, b"a b")), line),
}


def emptied(folder: Path) -> None:
    """The folder as before: an input must not see what another one left."""
    for each in sorted(folder.rglob("*"), reverse=True):
        if each.is_dir() and not each.is_symlink():
            os.rmdir(each)
        else:
            each.unlink()
