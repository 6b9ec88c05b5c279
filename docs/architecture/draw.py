"""Draw the floors of the house as the contract in pyproject.toml states them.

python docs/architecture/draw.py
"""

from __future__ import annotations

from pathlib import Path

from pkmcal.files.toml_lines import tomllib

ROOT = Path(__file__).resolve().parents[2]
PICTURE = Path(__file__).parent / "floors.svg"
NOTES = {  # of the floor with this room
    "cli": "a verb a file",
    "app": "the window in the browser",
    "jobs": "what options say; files in and out",
    "live": "machines that are driven, pose by pose",
    "report": "pages; faces of controllers and moves",
    "calibration": "identify; poses to measure; firmware, C",
    "diagnostics": "checks, verdict",
    "fitted": "what a fit says of itself",
    "estimation": "equations, search, covariance",
    "effects": "expansion, sag, loads, gears",
    "measurements": "tables, studies, corrections, pages",
    "readings": "a class a kind of reading",
    "kinematics": "Robot: inverse, forward, limits",
    "modes": "assembly modes; serial arms",
    "geometry": "named numbers, robot files",
    "files": "TOML, CSV; screws; noise",
    "core": "calls of the C library",
    "arrays": "array types",
    "arguments": "one argument; base of results",
    "exceptions": "errors and warnings",
    "display": "numbers as printed",
}
STEP, LEFT, LETTER = 34, 322, 7.6  # from floor to floor; where rooms begin; width of a letter, px
BLUE, SAND, LINE = "#d9e8f6", "#f6e3c5", "#5b7ea3"


def box(x: float, y: float, width: float, fill: str, *lines: str) -> str:
    """Return a box with one line of text, or a title and a grey line."""
    height = 28 if len(lines) == 1 else 48
    out = f'<rect x="{x:g}" y="{y:g}" width="{width:g}" height="{height}" rx="4" '
    out += f'fill="{fill}" stroke="{LINE}"/>\n'
    for k, (line, colour) in enumerate(zip(lines, ("#222", "#666"), strict=False)):
        at = f'x="{x + width / 2:g}" y="{y + 19 + 19 * k:g}"'
        out += f'<text {at} text-anchor="middle" fill="{colour}">{line}</text>\n'
    return out


def note(x: float, y: float, text: str, anchor: str = "start") -> str:
    """Return a grey text."""
    return f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}" fill="#666">{text}</text>\n'


def arrow(path: str) -> str:
    """Return a line with a tip at its end."""
    return f'<path d="{path}" stroke="#444" fill="none" marker-end="url(#tip)"/>\n'


def svg() -> str:
    """Return the picture: on the left from formula to C, on the right floor on floor."""
    contract = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    floors = [
        layer.split(" | ")
        for layer in contract["tool"]["importlinter"]["contracts"][0]["layers"]
        if layer != "__main__"
    ]
    height = 46 + STEP * len(floors) + 10
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1250 {height}" '
        'font-family="sans-serif" font-size="13">\n',
        "<title>Floors and rooms of pkmcal: an import only goes down</title>\n",
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="8" '
        'markerHeight="8" orient="auto"><path d="M0 0L8 4L0 8z" fill="#444"/></marker></defs>\n',
        f'<rect width="1250" height="{height}" fill="#fff"/>\n',
        '<text x="20" y="24" font-weight="bold" fill="#222">from formula to C</text>\n',
        f'<text x="{LEFT}" y="24" font-weight="bold" fill="#222">'
        "pkmcal/: an import only goes down</text>\n",
    ]
    heights = {}
    for k, rooms in enumerate(floors):
        y, x = 40 + STEP * k, float(LEFT)
        parts.append(note(LEFT - 14, y + 19, str(len(floors) - k), "end"))
        for room in rooms:
            heights[room] = y
            width = 16 + LETTER * len(room)
            parts.append(box(x, y, width, SAND if room == "core" else BLUE, room))
            x += width + 6
        parts.append(note(x + 8, y + 19, NOTES[next(each for each in rooms if each in NOTES)]))
    core = heights["core"]
    left = [(60, "derive/", "formulas in SymPy"), (160, "generated/", "C formulas, never edited"),
            (260, "csrc/", "iterations, batches, lanes")]  # fmt: skip
    parts += [box(20, y, 190, SAND, *lines) for y, *lines in left]
    parts.append(box(20, core, 190, SAND, "pkmcal/_core"))
    for y, to, text in ((108, 158, "emits"), (208, 258, "included by"),
                        (308, core - 2, "compiled with cffi")):  # fmt: skip
        parts += [arrow(f"M115 {y}V{to}"), note(124, (y + to) / 2 + 5, text)]
    parts += [arrow(f"M212 {core + 14}H288"), note(20, core + 48, "only core/ imports it")]
    return "".join(parts) + "</svg>\n"


if __name__ == "__main__":
    PICTURE.write_text(svg(), encoding="utf-8")
