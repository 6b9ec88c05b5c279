"""The generated C that the package carries: functions cut out by name, and formulas evaluated.

A header for a controller is made of the same text that the compiled core is made of, so no formula
is written twice and SymPy is not needed. The text is regular, for derive/emit.py writes it: a
comment, ``INLINE void FN(name)(arguments)``, assignments.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from importlib import resources
from typing import Any, Literal, NamedTuple

import numpy as np

Number = Literal["double", "float"]

_HEADERS = (
    "posemaps.h",
    "frames.h",
    "limbs.h",
    "laws.h",
    "pulleys.h",
    "screws.h",
    "chains.h",
)
_FUNCTION = re.compile(
    r"/\*\n(?P<comment>(?: \*[^\n]*\n)+?) \*/\n"
    r"INLINE void FN\((?P<name>\w+)\)\((?P<arguments>[^{]*)\)\n\{\n(?P<body>.*?)\n\}\n",
    re.DOTALL,
)
_OPERATIONS = re.compile(r" \* operations: (\d+) \+, (\d+) \*, (\d+) /, (\d+) sqrt\n")
_CALL = re.compile(r"FN\((\w+)\)\(")
_IN_TEMPLATE = {"sincos", "root", "fill"}  # written for one number in the template


class CFunction(NamedTuple):
    """A generated function as text.

    Attributes
    ----------
    name, comment, arguments, body : str
        Its parts; the comment without its operation counts.
    operations : tuple of int
        Additions, multiplications, divisions and square roots.
    """

    name: str
    comment: str
    arguments: str
    body: str
    operations: tuple[int, int, int, int]


@cache
def _text(header: str) -> str:
    return resources.files("pkmcal.generated").joinpath(header).read_text(encoding="utf-8")


@cache
def functions() -> dict[str, CFunction]:
    """Every function of the generated headers that concerns one pose of one machine, by name."""
    found = {}
    for header in _HEADERS:
        for match in _FUNCTION.finditer(_text(header)):
            counts = _OPERATIONS.search(match["comment"])
            if counts is None:
                raise ValueError(f"{header}: {match['name']} states no operation counts")
            add, times, over, root = map(int, counts.groups())
            found[match["name"]] = CFunction(
                match["name"],
                _OPERATIONS.sub("", match["comment"]),
                match["arguments"],
                match["body"],
                (add, times, over, root),
            )
    return found


def with_callees(names: Iterable[str]) -> list[CFunction]:
    """Functions by name, each behind those that it calls."""
    found: dict[str, CFunction] = {}

    def take(name: str) -> None:
        if name in found or name in _IN_TEMPLATE:
            return
        function = functions()[name]
        for callee in _CALL.findall(function.body):
            take(callee)
        found[name] = function

    for name in names:
        take(name)
    return list(found.values())


@cache
def constants() -> dict[str, float]:
    """Coefficients of sine, cosine and arctangent, and parts of π, by name."""
    defined = re.findall(r"#define (\w+) (-?0x\S+)", _text("elementary.h"))
    return {name: float.fromhex(value) for name, value in defined}


def literal(value: float, number: Number) -> str:
    """A number as C, which reads back as the same double or, rounded, as the nearest float."""
    if number == "double":
        return repr(float(value))
    text = str(np.float32(value))
    return f"{text}f" if re.search(r"[.e]", text) else f"{text}.0f"


def largest(number: Number) -> float:
    """The largest number of a type."""
    return float(np.finfo(np.float64 if number == "double" else np.float32).max)


def writers(
    number: Number,
) -> tuple[Callable[[float], str], Callable[[Any], str], Callable[[Any], str]]:
    """Return functions that write one number of a type, several, and several whole ones."""

    def one(value: float) -> str:
        return literal(value, number)

    def several(values: Any) -> str:
        return ", ".join(one(value) for value in np.ravel(list(values)))

    def whole(values: Any) -> str:
        return ", ".join(str(int(value)) for value in values)

    return one, several, whole


def as_c99(function: CFunction, prefix: str, number: Number, slots: Iterable[str]) -> str:
    """The function for one number of one type; its name and the enumerators get the prefix."""
    unused = [
        name
        for name in re.findall(r"(\w+)(?:\[\d+\])?(?:,|$)", function.arguments)
        if not re.search(rf"\b{name}\b", function.body)
    ]
    ignored = "".join(f"    (void){name};\n" for name in unused)
    code = (
        f"INLINE void FN({function.name})({function.arguments})\n{{\n{ignored}{function.body}\n}}\n"
    )
    code = code.replace("INLINE void", f"{prefix.upper()}_FUNCTION void")
    code = code.replace("FN(root)", "sqrt" if number == "double" else "sqrtf")
    code = re.sub(r"FN\(fill\)\(([^()]*)\)", r"\1", code)
    code = re.sub(r"FN\((\w+)\)", rf"{prefix}_\1", code)
    code = re.sub(r"\barctangent2\b", f"{prefix}_arctangent2", code)
    code = re.sub(rf"\b({'|'.join(slots)})\b", rf"{prefix}_\1", code)
    code = re.sub(r"\breal\b", number, code)
    if number == "double":
        code = re.sub(r"(\d+\.\d*)f\b", r"\1", code)
    return f"/*\n{function.comment} */\n{code}"


def slots_read(texts: Iterable[str], prefix: str, slots: Iterable[str]) -> list[str]:
    """The slots that functions need: points, and what is more than the place of a zero."""
    needed = []
    for slot in slots:
        mentions = [
            line for text in texts for line in text.splitlines() if f"[{prefix}_{slot}]" in line
        ]
        point = slot[-2:] in ("_X", "_Y", "_Z")  # read by its first coordinate
        if point or not all(_zero(prefix, slot).fullmatch(line) for line in mentions):
            needed.append(slot)
    return needed


def of_slots(
    texts: Iterable[str], prefix: str, slots: Sequence[str], needed: Sequence[str]
) -> list[str]:
    """Functions for limbs that have the needed slots alone."""
    made = []
    for text in texts:
        lines = [
            line
            for line in text.splitlines()
            if not any(_zero(prefix, slot).fullmatch(line) for slot in slots if slot not in needed)
        ]
        made.append("\n".join(lines).replace(f"by_g[{len(slots)}]", f"by_g[{len(needed)}]") + "\n")
    return made


def _zero(prefix: str, slot: str) -> re.Pattern[str]:
    """A line that writes nothing but a zero to a slot of derivatives."""
    return re.compile(rf" *by_g\[{prefix}_{slot}\] = 0\.0f?;")


def evaluate(name: str, inputs: Mapping[str, object], outputs: Iterable[str]) -> list[list[float]]:
    """The vectors that a generated function gives, to the bit what the core computes.

    Parameters
    ----------
    name : str
        A function of assignments alone, such as the directions of a driver.
    inputs : mapping
        Its arguments and the enumerators in its body.
    outputs : iterable of str
        Names of the arguments that it writes.
    """
    body = functions()[name].body
    sizes = dict(re.findall(r"real (\w+)\[(\d+)\]", functions()[name].arguments))
    body = re.sub(r"/\*.*?\*/|^\s*real [\w, ]+;$", "", body, flags=re.DOTALL | re.MULTILINE)
    body = re.sub(r"FN\(sincos\)\((.*?), &(\w+), &(\w+)\)", r"\2, \3 = sincos(\1)", body)
    body = re.sub(r"FN\(fill\)\(0\.0f\)", "0.0", body).replace("const real ", "")
    body = re.sub(r"(\d+\.\d*)f\b", r"\1", body)
    written = {each: [0.0] * int(sizes[each]) for each in outputs}
    scope: dict[str, object] = {"__builtins__": {}, "sincos": _sincos, **inputs, **written}
    for statement in body.split(";"):
        exec(" ".join(statement.split()), scope)
    return list(written.values())


def _sincos(x: float) -> tuple[float, float]:
    """Sine and cosine of an angle of a robot file as the core has them (csrc/trigonometry.h)."""
    known = constants()

    def polynomial(function: str, z: float) -> float:
        value = known[f"{function}_5"]
        for k in range(4, -1, -1):
            value = known[f"{function}_{k}"] + z * value
        return value

    shift = 6755399441055744.0
    n = (x * known["TWO_OVER_PI"] + shift) - shift
    r = x
    for k in range(3):
        r -= n * known[f"HALF_PI_PART{k}"]
    z = r * r
    s = r + r * z * polynomial("SIN", z)
    c = 1.0 - (0.5 * z - z * z * polynomial("COS", z))
    return ((s, c), (c, -s), (-s, -c), (-c, s))[int(n) & 3]


@cache
def axes_of_rows() -> dict[str, tuple[int, int]]:
    """Return the places of the axes, on base and platform, of each row beside the sphere."""
    (rows,) = re.findall(r"#define EACH_ROW\(X\) (.*)", _text("names.h"))
    found = re.findall(r"X\(\w+, (\w+), (\d+), (\d+)\)", rows)
    return {name: (int(base), int(platform)) for name, base, platform in found}
