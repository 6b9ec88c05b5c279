"""Common parts of all figures: colours, matplotlib's context, an empty figure, its bytes."""

from __future__ import annotations

import functools
import io
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, ParamSpec, TypeVar

import numpy as np

from pkmcal.arrays import BoolArray, IntArray
from pkmcal.display import printable
from pkmcal.exceptions import ArgumentError
from pkmcal.files.atomic import write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Okabe and Ito's colours, which those who confuse red and green can tell apart.
BLUE, ORANGE, GREEN, PINK = "#0072b2", "#d55e00", "#009e73", "#cc79a7"
INK, GRID, FAINT = "#1b1b1b", "#e0e0e0", "#808080"

_CONTEXT: Any = {
    "svg.fonttype": "none",
    "text.parse_math": False,  # a name may have a $
    "text.color": INK,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "axes.facecolor": "none",
    "figure.facecolor": "none",
    "legend.facecolor": "none",
    "legend.frameon": False,
    "grid.color": GRID,
    "axes.axisbelow": True,
}
KINDS = ("png", "svg")
_METADATA: dict[str, dict[str, None]] = {
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": None},  # the same bytes for the same figure
}
_DPI = 120
MOST_DRAWN = 1000  # rows of a figure: with 1e5 of them a browser shows nothing for minutes
_LONGEST_LINE, _LONGEST_TEXT = 200, 2000  # letters of one text

P = ParamSpec("P")
T = TypeVar("T")


def in_context(draw: Callable[P, T]) -> Callable[P, T]:
    """Decorate a function that draws, so that matplotlib has the settings of all figures."""

    @functools.wraps(draw)
    def drawn(*arguments: P.args, **named: P.kwargs) -> T:
        import matplotlib

        with matplotlib.rc_context(_CONTEXT):
            return draw(*arguments, **named)

    return drawn


def empty_figure(
    width: float, height: float, layout: Literal["constrained"] | None = "constrained"
) -> Figure:
    """Return a figure of this size in inches."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout=layout)


def sample(count: int, first: BoolArray | None = None) -> IntArray:
    """Choose rows for a figure, in order: at most `MOST_DRAWN`, evenly spaced.

    Parameters
    ----------
    count : int
        How many there are.
    first : ndarray of bool (count,), optional
        Rows that the others make room for.

    Examples
    --------
    >>> len(sample(7)), sample(5001)[[0, 1, -1]].tolist()
    (7, [0, 5, 5000])
    """
    if count <= MOST_DRAWN:
        return np.arange(count)
    wanted = np.flatnonzero(np.zeros(count, dtype=bool) if first is None else first)
    wanted = _spaced(wanted, MOST_DRAWN)
    others = np.setdiff1d(np.arange(count), wanted, assume_unique=True)
    return np.sort(np.concatenate([wanted, _spaced(others, MOST_DRAWN - len(wanted))]))


def _spaced(rows: IntArray, most: int) -> IntArray:
    """Choose at most so many entries, the ends included."""
    if len(rows) <= most:
        return rows
    return rows[np.round(np.linspace(0, len(rows) - 1, most)).astype(np.intp)]


def encoded(figure: Figure, kind: str, salt: str = "pkmcal", background: str = "white") -> bytes:
    """Return the bytes of a figure, always the same for the same figure.

    Parameters
    ----------
    figure : Figure
        Drawn `in_context`.
    kind : {"png", "svg"}
        Format.
    salt : str
        From which SVG makes its ids.
    background : str
        Colour, or "none".
    """
    import matplotlib
    from matplotlib.text import Text

    for text in figure.findobj(Text):
        written = text.get_text()
        if (shown := _shown(written)) != written:
            text.set_text(shown)
    content = io.BytesIO()
    settings = {**_CONTEXT, "svg.hashsalt": salt}
    with matplotlib.rc_context(settings), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing", UserWarning)  # the reader has it
        figure.savefig(
            content, format=kind, dpi=_DPI, metadata=_METADATA[kind], facecolor=background
        )
    return content.getvalue()


def _shown(text: str) -> str:
    """A text of a figure, in which there may be names of others: without control characters."""
    lines = (printable(line, _LONGEST_LINE) for line in text[:_LONGEST_TEXT].split("\n"))
    return "\n".join(lines)


def write(figure: Figure, path: Path) -> None:
    """Write a figure as PNG or SVG, by the ending of the path.

    Raises
    ------
    ValueError
        Another ending.
    OSError
        The file cannot be written.
    """
    kind = path.suffix.lower()[1:]
    if kind not in _METADATA:
        raise ArgumentError(f"path must end in .png or .svg, found {str(path)!r}")
    write_whole(path, encoded(figure, kind))


def write_both(figure: Figure, path: Path) -> list[Path]:
    """Write `path`.png and `path`.svg and return these paths."""
    written = []
    for kind in KINDS:
        written.append(path.with_name(f"{path.name}.{kind}"))
        write(figure, written[-1])
        figure.set_layout_engine("none")  # laid out once, so that both are the same picture
    return written
