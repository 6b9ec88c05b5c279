"""What comes in from outside, and what must hold for whatever comes.

A door takes bytes, however damaged, and either refuses them with the package's own error, which
names the file and can be printed on one line, or takes them, and then what it gives can be used and
written and is read back the same. What takes longer than reading is done with a share of the
inputs, drawn by the input's own chance.
"""

from __future__ import annotations

import io
import re
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

import pkmcal as pk
from pkmcal.display import visible
from pkmcal.measurements.command_csv import read_commands
from pkmcal.measurements.measurements import Measurements
from pkmcal.measurements.pose_csv import read_poses

from .command_lines import LINE
from .damage import Door

ROOT = Path(__file__).resolve().parents[2]
LOGS = ROOT / "tests" / "data"
EXAMPLES = ROOT / "examples"
MACHINE = pk.load("2tpr2tps")
LONGEST = 1000  # letters of a message
USED = 0.25  # of what is taken is written, read again and used


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
            assert visible(message) == message, f"steers a terminal: {message!r}"
            return None


# --- robot files ---------------------------------------------------------------------------------


def robot(folder: Path, content: bytes, chance: Random) -> bool:
    path = folder / "robot.toml"
    path.write_bytes(content)
    found = taken(path, pk.load)
    if found is None or chance.random() > USED:
        return found is not None
    assert repr(found) and visible(str(found)) == str(found)
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


OTHER_TABLES: tuple[Callable[[Path], Any], ...] = (
    lambda path: pk.read_measurements(path, MACHINE),
    lambda path: read_poses(path, MACHINE),
    lambda path: read_commands(path, ("mm",) * 4),
)


def table(folder: Path, content: bytes, chance: Random) -> bool:
    """Measurements, or for a third of the inputs one of the other tables."""
    path = folder / "m.csv"
    path.write_bytes(content)
    if chance.random() < 1 / 3:
        return taken(path, chance.choice(OTHER_TABLES)) is not None
    found = taken(path, pk.read_measurements)
    if found is None or chance.random() > USED:
        return found is not None
    assert repr(found) and visible(str(found)) == str(found)
    found.write(folder / "again.csv")
    same(pk.read_measurements(folder / "again.csv"), found)
    return True


def workbook(folder: Path, content: bytes, chance: Random) -> bool:
    path = folder / "m.xlsx"
    path.write_bytes(content)
    return taken(path, pk.read_measurements) is not None


def part(content: bytes) -> bytes:
    """A workbook with this part, named in the first line: damage inside what is packed."""
    line, _, inside = content.partition(b"\n")
    name = line.decode("latin-1").replace("\0", "") or _SHEET
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as book:
        for each, known in {**PARTS, name: inside}.items():
            book.writestr(each, known)
    return made.getvalue()


# --- arms and printers ---------------------------------------------------------------------------


def arm(folder: Path, content: bytes, chance: Random) -> bool:
    path = folder / "arm.urdf"
    path.write_bytes(content)
    found = taken(path, pk.SerialArm.from_urdf)
    if found is None or chance.random() > USED:
        return found is not None
    assert repr(found) and visible(str(found)) == str(found)
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


def printer(folder: Path, content: bytes, chance: Random) -> bool:
    """The first line says whose file it is, or, where damage took it, chance does."""
    line, _, inside = content.partition(b"\n")
    firmware = line.decode("latin-1")
    if firmware not in PRINTERS:
        firmware, inside = chance.choice(tuple(PRINTERS)), content
    path = folder / "printer.cfg"
    path.write_bytes(inside)
    found = taken(path, lambda each: pk.import_printer(each, firmware))  # type: ignore[arg-type]
    if found is None or chance.random() > USED:
        return found is not None
    assert repr(found) and visible(str(found)) == str(found)
    (folder / "robot.toml").write_text(found.text, encoding="utf-8")
    again = pk.load(folder / "robot.toml")
    assert isinstance(again, pk.Robot)
    np.testing.assert_array_equal(again.geometry.values, found.robot.geometry.values)
    return True


# --- seeds ---------------------------------------------------------------------------------------

WORKBOOK = LOGS / "same" / "excel.xlsx"
with zipfile.ZipFile(WORKBOOK) as _book:
    PARTS = {each: _book.read(each) for each in _book.namelist()}
_SHEET = "xl/worksheets/sheet1.xml"
_TOML = tuple(
    each.read_bytes()
    for folder in ("machines", "arms")
    for each in sorted((ROOT / "pkmcal" / "builtin" / folder).glob("*.toml"))
)
_BARE = tuple(re.sub(rb"(?m)^#.*\n|\s+#.*$", b"", each) for each in _TOML)  # without remarks
_CSV = tuple(
    each.read_bytes()
    for each in sorted(LOGS.glob("*/*"))
    if each.suffix in (".csv", ".tsv", ".txt")
) + tuple(
    b"".join((EXAMPLES / each).read_bytes().splitlines(keepends=True)[:12])
    for each in (
        "linear-delta/probe.csv",
        "2tpr2tps-compensation/desired.csv",
        "2tpr2tps-compensation/measured.csv",
    )
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
PRINTERS = {
    "klipper": ((EXAMPLES / "linear-delta" / "printer.cfg").read_bytes(),),
    "reprap": (
        b"M665 R105.6 L217.5 H240.1 B85 X0.1 Y-0.2 Z0 ; delta\nM666 X-0.1 Y0.2 Z0.0\n",
        b"M669 K10 U170:170.5:169.5 L400:401:400 H300:301:302 R100 A-90:60 X0.5 Y0 Z0 B120\n"
        b"M666 X0.1 Y-0.3 Z0.2\n",
    ),
    "marlin": (
        b"M665 R105.6 L217.5 H240.1 S80 X0.1 Y-0.2 Z0\nM666 X-0.1 Y-0.2 Z0.0\nM851 X0 Y1 Z-1.5\n",
    ),
    "hangprinter": (
        b"M669 K6 N4 P1800 ; mine\nM669 A16.4:-1610.9:-131.5 B1314.2:1268.1:-121.3\n"
        b"m669 C-1415.7:707.6:-121.8 D1.5:-2.5:2299.8\nM666 A1 Q0.06875 R75.1:75.2:74.9:75.0 W0\n"
        b"M666 U2:2:2:4 O1:1:1:1 L20:20:20:20 H255:250:255:255 J25:25:25:25 (full steps)\n",
    ),
    "maslow": (
        b"kinematics:\n  MaslowKinematics:\n    tlX: -6.2\n    tlY: 2188.0\n    trX: 2991.2 # old\n"
        b"    trY: 2197.4\n    blX: 0.0\n    blY: 0.0\n    brX: 2989.8\n    brY: 0.0\n",
        b"$/Maslow_tlX=-6.2\n$/Maslow_tlY=2188.0\n$/Maslow_trX=2991.2\n$/Maslow_trY=2197.4\n"
        b"$/Maslow_brX=2989.8\nCLBM:[{bl:1851.5, br:1843.25, tr:1.8e3, tl:1820},\n"
        b"{bl:1700.0, br:1990.0, tr:1950.5, tl:1680.0},]\nok\n",
    ),
}
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
[stepper_a] [printer] kinematics:delta arm_length: angle: : = #*# # ; M665 M666 M669 L R X U Q B G20
gear_ratio:0:1 1:2:3 CLBM: bl: tlX: { }, hangprinter
microsteps:0 rotation_distance:0 height0 [delta_calibrate] \xff
""".split()
_ZIP_WORDS = (b"PK\x03\x04", b"PK\x01\x02", b"\0\0", b"\xff\xff\xff\xff", b"\x08\0", b"xl/")

DOORS = {
    "toml": Door((*_TOML, *_BARE * 3), _TOML_WORDS, robot),
    "csv": Door(_CSV, _CSV_WORDS, table),
    "xlsx": Door(
        (WORKBOOK.read_bytes(), *(each.read_bytes() for each in LOGS.glob("same/excel-*.xlsx"))),
        _ZIP_WORDS,
        workbook,
    ),
    "sheet": Door(
        tuple(
            each.encode() + b"\n" + inside
            for each, inside in PARTS.items()
            for _ in range(10 if each == _SHEET else 1)
        ),
        _SHEET_WORDS,
        lambda folder, content, chance: workbook(folder, part(content), chance),
    ),
    "urdf": Door((_URDF,), _URDF_WORDS, arm),
    "printer": Door(
        tuple(
            f"{firmware}\n".encode() + each
            for firmware, seeds in PRINTERS.items()
            for each in seeds
        ),
        _PRINTER_WORDS,
        printer,
    ),
    "line": LINE,
}
