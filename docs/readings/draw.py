"""Draw what each kind of measurement reads: ``python docs/readings/draw.py`` writes the pictures.

Grey is the machine, blue what belongs to the instrument, orange what is read.
"""

from __future__ import annotations

import math
from pathlib import Path

WIDTH, HEIGHT = 150, 90
GREY, DARK, BLUE, ORANGE = "#b8b8b8", "#444", "#3b6ea5", "#d9731a"
GROUND = 80


def _line(x1: float, y1: float, x2: float, y2: float, colour: str = DARK, more: str = "") -> str:
    ends = f'x1="{x1:g}" y1="{y1:g}" x2="{x2:g}" y2="{y2:g}"'
    return f'<line {ends} stroke="{colour}" stroke-width="1.6"{more}/>'


def _dashed(x1: float, y1: float, x2: float, y2: float, colour: str) -> str:
    return _line(x1, y1, x2, y2, colour, ' stroke-dasharray="3 2"')


def _arrow(x1: float, y1: float, x2: float, y2: float, colour: str = ORANGE) -> str:
    return _line(x1, y1, x2, y2, colour, ' marker-end="url(#tip)"')


def _both_ways(x1: float, y1: float, x2: float, y2: float) -> str:
    return _line(x1, y1, x2, y2, ORANGE, ' marker-start="url(#tip)" marker-end="url(#tip)"')


def _dot(x: float, y: float, colour: str = DARK, r: float = 3) -> str:
    return f'<circle cx="{x:g}" cy="{y:g}" r="{r:g}" fill="{colour}"/>'


def _words(x: float, y: float, text: str, colour: str = ORANGE) -> str:
    return f'<text x="{x:g}" y="{y:g}" fill="{colour}">{text}</text>'


def _arc(x: float, y: float, r: float, start: float, end: float, colour: str = ORANGE) -> str:
    """From one angle to another, degrees, counted from x, up."""
    a, b = math.radians(start), math.radians(end)
    ends = [(x + r * math.cos(t), y - r * math.sin(t)) for t in (a, b)]
    path = "M{:.1f} {:.1f}A{:g} {:g} 0 0 {} {:.1f} {:.1f}".format(
        *ends[0], r, r, int(end < start), *ends[1]
    )
    return f'<path d="{path}" fill="none" stroke="{colour}" stroke-width="1.6"/>'


def _platform(x: float, y: float, tilt: float = 0, faint: bool = False) -> str:
    """A platform on two legs, about its middle."""
    a, half = math.radians(tilt), 22
    left = (x - half * math.cos(a), y + half * math.sin(a))
    right = (x + half * math.cos(a), y - half * math.sin(a))
    opacity = ' opacity="0.45"' if faint else ""
    parts = [_line(*left, *right, DARK, ' stroke-linecap="round"')]
    parts += [_line(*left, x - 34, GROUND, GREY), _line(*right, x + 34, GROUND, GREY)]
    return f"<g{opacity}>{''.join(parts)}</g>"


def _ground() -> str:
    return _line(6, GROUND, WIDTH - 6, GROUND, GREY)


def _sensor(x: float, y: float, tilt: float) -> str:
    turn = f'transform="rotate({-tilt:g} {x:g} {y:g})"'
    return f'<rect x="{x - 7:g}" y="{y - 4:g}" width="14" height="9" fill="{BLUE}" {turn}/>'


SOCKET = f'<path d="M62 {GROUND}L76 66A8 8 0 0 0 92 66L106 {GROUND}z" fill="{BLUE}" opacity="0.5"/>'
TRACKER = _dot(16, 30, BLUE, 4) + _line(16, 34, 11, GROUND, BLUE) + _line(16, 34, 21, GROUND, BLUE)
PICTURES: dict[str, list[str]] = {
    "pose": [
        *(_platform(85, 46, 12), _arrow(85, 46, 108, 41), _arrow(85, 46, 80, 23)),
        *(_dot(85, 46, ORANGE), _words(112, 36, "x … γ")),
    ],
    "position": [
        *(_platform(95, 50, 12), TRACKER, _dashed(16, 30, 92, 36, BLUE), _dot(95, 36, ORANGE, 4)),
        *(_line(95, 50, 95, 40, GREY), _words(102, 32, "x y z")),
    ],
    "height": [
        *(_platform(60, 40, 8), _line(82, 37, 88, 40, GREY), _dot(88, 40, ORANGE)),
        *(_dashed(88, 40, 104, 40, ORANGE), _both_ways(104, 41, 104, 79), _words(110, 64, "z")),
    ],
    "distance": [
        *(_platform(100, 40, 10), _dot(14, GROUND, BLUE, 4), _dot(78, 44)),
        *(_both_ways(18, 77, 75, 46), _words(36, 54, "ρ")),
    ],
    "closure": [
        *(_platform(75, 42, 10), _words(22, 66, "q1"), _words(114, 62, "q2")),
        *(_line(53.3, 45.8, 41, GROUND, ORANGE), _line(96.7, 38.2, 109, GROUND, ORANGE)),
    ],
    "between": [
        *(_platform(46, 52, 0, faint=True), _platform(104, 52, 8), _dot(46, 44), _dot(104, 44)),
        *(_both_ways(49, 40, 101, 40), _words(72, 34, "d")),
    ],
    "relative-distance": [
        *(_platform(100, 44, 8, faint=True), _platform(108, 36, 8), _dot(14, GROUND, BLUE, 4)),
        *(_dashed(14, GROUND, 78, 50, BLUE), _arrow(78, 50, 88, 42), _words(56, 34, "ρ − zero")),
    ],
    "orientation": [
        *(_platform(80, 50, 14), _sensor(79, 40, 14), _arc(80, 50, 30, 14, 62)),
        _words(112, 30, "α β γ"),
    ],
    "tilt": [
        *(_platform(80, 52, 14), _sensor(79, 42, 14), _dashed(80, 52, 128, 52, GREY)),
        *(_arc(80, 52, 40, 0, 14), _arrow(24, 60, 24, 22), _words(20, 16, "up", GREY)),
        _words(126, 46, "tilt"),
    ],
    "angle": [
        *(_platform(80, 36), _line(58, 36, 46, GROUND), _dot(46, GROUND, BLUE, 4)),
        *(_arc(46, GROUND, 26, 0, 74), _words(74, 62, "angle")),
    ],
    "touch": [
        *(_line(60, 14, 84, 62), _line(104, 12, 84, 62, GREY), SOCKET, _dot(84, 62, ORANGE, 5)),
        _words(98, 58, "same point"),
    ],
    "touch-plane": [
        *(_line(14, 69.8, 136, 43.3, BLUE), _line(40, 14, 50, 62), _line(104, 12, 96, 52, GREY)),
        *(_dot(50, 62, ORANGE), _dot(96, 52, ORANGE), _words(60, 36, "same plane")),
    ],
}

HEAD = (
    f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}"'
    f' height="{HEIGHT}" font-family="sans-serif" font-size="9">'
)
TIP = (
    '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="5" markerHeight="5"'
    f' orient="auto-start-reverse"><path d="M0 0L8 4L0 8z" fill="{ORANGE}"/></marker></defs>'
)


def _picture(name: str) -> str:
    """The SVG of a kind."""
    back = f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>'
    title = f"<title>What is read of kind {name}</title>"
    return "\n".join([HEAD, title, TIP, back, _ground(), *PICTURES[name], "</svg>", ""])


if __name__ == "__main__":
    for name in PICTURES:
        (Path(__file__).parent / f"{name}.svg").write_text(_picture(name), encoding="utf-8")
