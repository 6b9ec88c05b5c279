"""The table of column names: those of instruments and controllers, and ours.

A heading is compared in small letters, with every run of blanks, ``_``, ``-``, ``.``, ``:`` and
``/`` as one blank. What makers mean different things by (``Rx``, ``A``, ``W``) has a name of its
own here, and is read where the order of the angles is stated.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence

from pkmcal.core.library import POSE

BESIDE = ("index", "time", "date", "comment", "name", "collection")  # not looked at by themselves
OF_A_USER = "beside"  # columns with names behind it that the user chose
RESERVED = (
    "sigma",
    "cov",
    "target",
    "attachment",
    "actuator_sigma",
    "approach",
    "tension",
    "tension_sigma",
    "to",
    "touch",
    "temperature",
    "payload",
    "force",
    "moment",
    OF_A_USER,
)
EULER = (("rx", "ry", "rz"), ("a", "b", "c"), ("w", "p", "r"))  # in the order of their letters
VECTOR = ("rvx", "rvy", "rvz")
QUATERNION = ("qw", "qx", "qy", "qz")
NUMBERED = ("quat1", "quat2", "quat3", "quat4")  # which of them is the scalar is not known
MATRIX = tuple(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))
ANGLES = ("alpha", "beta", "gamma")
ORIENTATIONS = (ANGLES, *EULER, VECTOR, QUATERNION, NUMBERED, MATRIX)

# Each name here, and what else it is called.
_SYNONYMS: dict[str, str] = {
    **{
        axis: f"{axis} coordinate|{axis} coord|coord {axis}|pos {axis}|{axis} pos|position {axis}"
        f"|{axis} position|t{axis}|p{axis}|translation {axis}|measured {axis}|{axis} measured"
        f"|meas {axis}|{axis} meas|actual {axis}|{axis} actual|act {axis}|{axis} act|{axis} value"
        f"|pose position {axis}|pose pose position {axis}|tcp {axis}|center {axis}"
        + "|height|probed height|measured height|elevation" * (axis == "z")
        for axis in "xyz"
    },
    "alpha": "roll|roll angle|rot x fixed",
    "beta": "pitch|pitch angle",
    "gamma": "yaw|yaw angle",
    "distance": "dist|length measured|measured length|measured distance|ball bar length",
    "sigma": "std|stdev|stddev|std dev|standard deviation|sigma xyz",
    "group": "pose|pose id|pose no|pose nr|pose number|pose name|configuration|config|pos|pos id"
    "|pos no|pos nr|pos number|position id|position no|position nr|position number|position name"
    "|image|image name|picture",
    "run": "run id|run no|run number|run name",
    "tilt1": "tilt 1|inclination 1|inclinometer 1",
    "tilt2": "tilt 2|inclination 2|inclinometer 2",
    "touch": "touched|socket",
    "session": "session id|session name|session no|session number|sitting",
    "target": "reflector|smr|target name|reflector name|marker|prism",
    "name": "point id|point|point name|pointname|point no|pt|pt id|pt name|id|label|object name"
    "|measurement|measurement name|feature|feature name|element|step|step no|punkt|messpunkt"
    "|satz|prog line|program line",
    "collection": "collection name",
    "comment": "comments|note|notes|remark|remarks|description",
    "index": "idx|no|nr|frame|sub frame|sample|number|#|line|row|count|item",
    "time": "timestamp|time stamp|datetime|date time|time seconds|time s|time utc|utc|date and time"
    "|measurement time|meas time|clock|uhrzeit|zeit|heure|datum zeit|datum uhrzeit"
    "|datum und uhrzeit",
    "date": "day|measurement date|datum",
    "temperature": "temp|temp c|t c|temperature c|machine temperature|machine temp"
    "|temperatur|température|temperature machine",
    "temperature.base": "temp base|base temp|base temperature|temperature base",
    "temperature.platform": "temp platform|platform temp|platform temperature|temperature platform",
    "air temperature": "air temp|temperature air|ambient temperature|ambient temp|room temperature",
    "payload": "load|load mass|payload mass|mass|carried",
    "probe": "probed|probed z|z probed|probe z|z probe|trigger z|z trigger|triggered|mesh|mesh z"
    "|bed mesh|bed z",
    "rx": "rot x|rotx|x rotation|euler x|angle x|actual rx",
    "ry": "rot y|roty|y rotation|euler y|angle y|actual ry",
    "rz": "rot z|rotz|z rotation|euler z|angle z|actual rz",
    **{
        axis: f"rotvec {axis[-1]}|rot vec {axis[-1]}|rotation vector {axis[-1]}|rv {axis[-1]}"
        f"|rvec {axis[-1]}"
        for axis in VECTOR
    },
    **{
        part: f"q {part[1]}|quat {part[1]}|quaternion {part[1]}|quat{part[1]}|rotation {part[1]}"
        f"|orientation {part[1]}|pose orientation {part[1]}|pose pose orientation {part[1]}"
        for part in QUATERNION
    },
    **{
        f"r{row}{column}": f"rot {row} {column}|m{row}{column}|{noa}{axis}"
        for row, axis in enumerate("xyz", 1)
        for column, noa in enumerate("noa", 1)
    },
}  # fmt: skip
_OF_PICTURES = ("camera", "board", "corner")
_NAMES = {letter: letter for angles in EULER[1:] for letter in angles} | {
    other: name for name, others in _SYNONYMS.items() for other in (name, *others.split("|"))
}
SYNONYMS = tuple(_NAMES)
KNOWN_NAMES = tuple(_SYNONYMS)
_PARTING = re.compile(r"[\s_\-.:/]+")
_DRIVEN = re.compile(
    r"(?P<stem>(?:(?:actual|measured|commanded|command|cmd|target|nominal|set|desired|feedback|fbk)"
    r" )?(?:q|j|a|joint|axis|leg|limb|strut|actuator|act|motor|drive|slider|carriage|tower|encoder"
    r"|length|l|leg length|strut length|joint angle|joint position|joint pos|axis pos|theta"
    r"|joint states position|joint state position|joint positions|jointpos"
    r"|cable|winch|belt|rope|wire|tendon|spool|line|tackle"
    r"|bein|achse|gelenk|strebe|antrieb|seil|winde|kabel|riemen|axe|jambe|câble|treuil))"
    r" ?(?P<number>[0-9]{1,2})"
    r"(?P<end>(?: (?:pos|position|length|angle|actual|act|value|fbk|feedback|cmd))*)"
)
_QUATERNION = re.compile(r"(?:q|quat|quaternion) ?([0-4])")
_OF_A_TARGET = re.compile(r"(?P<target>.*[^\s_\-.:/])[\s_\-.:/]+(?P<axis>[xyz])", re.IGNORECASE)
_OF_A_KIND = re.compile(r"(?:angle|touch):.+", re.IGNORECASE)
_TEMPERATURE = re.compile(  # of what an actuator drives
    r"(?:temp|temperature) (?:q|joint|axis|leg|limb|strut|actuator|motor|drive|slider|tower) ?"
    r"(?P<after>[1-9][0-9]?)"
    r"|(?:q|joint|axis|leg|limb|strut|actuator|motor|drive|slider|tower) ?(?P<before>[1-9][0-9]?)"
    r" (?:temp|temperature)(?: c)?"
)
_SIGMA = re.compile(
    r"(?:sigma|std|stdev|stddev|std dev|s) (?P<one>x|y|z|alpha|beta|gamma)"
    r"|(?P<other>x|y|z) (?:sigma|std|stdev|stddev|std dev)"
)


def is_known(name: str) -> bool:
    """Return whether a heading, without its unit, is one that is known by itself."""
    plain = _plain(name)
    return (
        bool(
            plain in _NAMES
            or _DRIVEN.fullmatch(plain)
            or _SIGMA.fullmatch(plain)
            or _TEMPERATURE.fullmatch(plain)
            or _OF_A_KIND.fullmatch(name)
            or _dotted(name)
        )
        or known_as(name).partition(".")[0] in RESERVED
    )


def known_as(name: str) -> str:
    """The name of a column here, for one as it is written.

    Examples
    --------
    >>> known_as("Joint 1"), known_as("X"), known_as("SMR 2.Z"), known_as("Furlongs")
    ('q1', 'x', 'SMR 2.z', 'Furlongs')
    """
    return canonical([name])[name]


def orientation_in(names: Collection[str]) -> tuple[str, ...]:
    """The columns that state an orientation; none where there are none, or not all of them."""
    return next((form for form in ORIENTATIONS if all(name in names for name in form)), ())


def is_turned(names: Collection[str]) -> bool:
    """Return whether columns state an orientation, or a part of one."""
    return bool(orientation_in(names)) or any(angle in names for angle in ANGLES)


def canonical(
    headings: Sequence[str], joints: Sequence[str] = (), elsewhere: bool = False
) -> dict[str, str]:
    """The names here of the columns of one file, by heading.

    Parameters
    ----------
    headings : sequence of str
        As written, without units.
    joints : sequence of str
        Names of the machine's actuators, where it has any.
    elsewhere : bool
        Whether another file has the actuators: four numbered Q are then a quaternion.

    Returns
    -------
    dict of str to str
        What is not known keeps its heading. Actuators that are counted from 0 count from 1.

    Examples
    --------
    >>> list(canonical(["actual_q_0", "actual_q_1", "Qx", "Point ID"]).values())
    ['q1', 'q2', 'qx', 'name']
    >>> list(canonical(["A1", "Q1", "Q2", "Q3", "Q4"]).values())
    ['q1', 'quat1', 'quat2', 'quat3', 'quat4']
    """
    found = {heading: _alone(heading) for heading in headings}
    by_joint = {_plain(joint): i + 1 for i, joint in enumerate(joints)}
    for heading in headings:
        plain = _plain(heading)
        for before in ("", "position ", "joint position ", "actual ", "pos "):
            if plain.startswith(before) and (i := by_joint.get(plain.removeprefix(before))):
                found[heading] = f"q{i}"
    families = _actuators(headings)
    numbered = _numbered_quaternion(headings, families, elsewhere)
    for heading, part in numbered.items():
        found[heading] = NUMBERED[part]
    for members in families.values():
        members = {n: h for n, h in members.items() if h not in numbered}
        first = 1 if 0 in members else 0
        found |= {heading: f"q{number + first}" for number, heading in members.items()}
    if "qw" not in found.values():  # Rotation X, Y, Z without W are angles
        angles = dict(zip(QUATERNION[1:], EULER[0], strict=True))
        found |= {h: angles.get(found[h], found[h]) for h in headings if "rot" in h.lower()}
    if not {"x", "y", "z"} & set(found.values()):  # else Nominal X, Dev X are not of a target
        found |= _targets([heading for heading in headings if found[heading] == heading])
    return found


def _plain(name: str) -> str:
    return _PARTING.sub(" ", name.replace("(", " ").replace(")", " ").lower()).strip()


def _alone(name: str) -> str:
    """The name of a column by its heading alone."""
    plain = _plain(name)
    if plain in _NAMES:
        return _NAMES[plain]
    if match := _SIGMA.fullmatch(plain):
        return f"sigma.{match['one'] or match['other']}"
    if match := _TEMPERATURE.fullmatch(plain):
        return f"temperature.q{match['after'] or match['before']}"
    if dotted := _dotted(name):
        return dotted
    small, (head, dot, own) = name.lower(), name.partition(".")
    if head.lower() == OF_A_USER:
        return f"{OF_A_USER}{dot}{own}"
    return small if small.partition(".")[0] in RESERVED or small in _OF_PICTURES else name


def _dotted(name: str) -> str | None:
    target, dot, axis = name.rpartition(".")
    if dot and axis.lower() in POSE[:3] and target.lower() not in RESERVED:
        return f"{target}.{axis.lower()}"
    return None


def _actuators(headings: Sequence[str]) -> dict[tuple[str, str], dict[int, str]]:
    """Headings of actuators by their number, for each way in which they are named."""
    families: dict[tuple[str, str], dict[int, str]] = {}
    for heading in headings:
        match = _DRIVEN.fullmatch(_plain(heading))
        if match and not (match["stem"] == "a" and heading[:1] == "a"):
            stem = "Q" if heading.startswith("Q") else match["stem"]
            families.setdefault((stem, match["end"]), {})[int(match["number"])] = heading
    return families


def _numbered_quaternion(
    headings: Sequence[str],
    families: dict[tuple[str, str], dict[int, str]],
    elsewhere: bool,
) -> dict[str, int]:
    """Four headings such as Q1 to Q4, beside actuators of another name: their places."""
    others = [key for key in families if key[0] not in ("q", "Q")]
    for stem, other in (("Q", "q"), ("q", "Q")):
        members = families.get((stem, ""), {})
        four = sorted(members) in ([0, 1, 2, 3], [1, 2, 3, 4])
        if four and (elsewhere or others or (other, "") in families):
            return {heading: number - min(members) for number, heading in members.items()}
    spelled = {}
    for heading in headings:
        match = _QUATERNION.fullmatch(_plain(heading))
        if match and _plain(heading).startswith("quat"):
            spelled[heading] = int(match[1])
    if len(spelled) == 4:
        return {heading: number - min(spelled.values()) for heading, number in spelled.items()}
    return {}


def _targets(headings: Sequence[str]) -> dict[str, str]:
    """Three columns such as SMR1_X, SMR1_Y, SMR1_Z that have a target's name in common."""
    triples: dict[str, dict[str, str]] = {}
    for heading in headings:
        match = _OF_A_TARGET.fullmatch(heading)
        if match and _plain(match["target"]) not in RESERVED:
            triples.setdefault(match["target"], {})[match["axis"].lower()] = heading
    return {
        heading: f"{target}.{axis}"
        for target, axes in triples.items()
        if len(axes) == 3
        for axis, heading in axes.items()
    }
