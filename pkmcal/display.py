"""Numbers as people read them: only the digits that their uncertainty supports."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from html import escape
from itertools import islice, zip_longest

_LEAST_CHANCE = 1e-16  # below, digits are rounding's
_MOST_ROWS = 20  # of a table with a row for each pose
LONGEST = 1000  # letters of a sentence: names that a user gave may be in it
_LONGEST_NAME = 120  # letters that are shown of one
_MOST_DECIMALS = 15  # a double has no digits beyond; also what an exact number is given


def decimals(sigma: float, significant: int = 2) -> int:
    """Decimals that show `significant` digits of `sigma`; negative for tens and hundreds.

    A sigma that says nothing (zero, infinite, NaN) is worth six decimals.

    Examples
    --------
    >>> decimals(0.021), decimals(0.0996), decimals(130.0)
    (3, 2, -1)
    """
    if not math.isfinite(sigma) or sigma == 0:
        return 6
    exponent = int(f"{abs(sigma):.{significant - 1}e}".partition("e")[2])  # after rounding
    return min(significant - 1 - exponent, _MOST_DECIMALS)


def fixed(value: float, places: int) -> str:
    """`value` with `places` decimals; negative places round to tens, hundreds…; never "-0".

    Examples
    --------
    >>> fixed(-0.0004, 3), fixed(1234.0, -1), fixed(float("nan"), 3)
    ('0.000', '1230', 'nan')
    """
    if places < 0 and math.isfinite(value):
        value = round(value, places)
    text = f"{value:.{max(places, 0)}f}"
    return text.lstrip("-") if float(text) == 0 else text


def rounded(value: float, places: int) -> str:
    """Print as `fixed`, but a value that rounds to 0 in tens has two significant digits.

    Examples
    --------
    >>> rounded(12.345, 1), rounded(12.345, -2), rounded(0.0, -2)
    ('12.3', '12', '0')
    """
    lost = places < 0 and math.isfinite(value) and value != 0 and float(fixed(value, places)) == 0
    return fixed(value, decimals(value) if lost else places)


def with_uncertainty(value: float, sigma: float) -> str:
    """A value with its standard deviation, the latter to two significant digits.

    Parameters
    ----------
    value, sigma : float
        In the same unit; `sigma` is one standard deviation.

    Returns
    -------
    str
        Both to the same decimal. Without a usable sigma (zero, infinite, NaN) the value has six
        significant digits and the sigma is named as it is.

    Examples
    --------
    >>> with_uncertainty(160.01312, 0.02134)
    '160.013 ± 0.021'
    >>> with_uncertainty(340.0, float("inf"))
    '340 ± inf'
    """
    if not math.isfinite(sigma) or sigma == 0:
        return f"{value:.6g} ± {abs(sigma):.6g}"
    places = decimals(sigma)
    return f"{rounded(value, places)} ± {fixed(abs(sigma), places)}"


def changed(value: float, start: float, unit: str) -> float:
    """Return how far a number is from where it was; of an angle the shorter way round.

    Examples
    --------
    >>> round(changed(-3.1, 3.1, "rad"), 3)  # through 180 deg
    0.083
    """
    return math.remainder(value - start, math.tau) if unit == "rad" else value - start


def displayed(value: float, unit: str) -> tuple[float, str]:
    """A number in the unit people read: rad in degrees, everything else as it is.

    Examples
    --------
    >>> displayed(math.pi, "rad")
    (180.0, 'deg')
    """
    return (math.degrees(value), "deg") if unit == "rad" else (value, unit)


def first_rows(rows: Iterable[int], most: int = 5) -> str:
    """Number of the first `most` rows, and whether there are more.

    Examples
    --------
    >>> first_rows([3, 14, 15]), first_rows(range(100))
    ('3, 14, 15', '0, 1, 2, 3, 4, …')
    """
    shown = [str(row) for row in islice(rows, most + 1)]
    return ", ".join(shown[:most]) + (", …" if len(shown) > most else "")


def chance_text(chance: float) -> str:
    """A p-value in words.

    Examples
    --------
    >>> chance_text(0.0312), chance_text(0.0)
    ('p 0.031', 'p < 1e-16')
    """
    return f"p {chance:.2g}" if chance >= _LEAST_CHANCE else "p < 1e-16"


def visible(text: str) -> str:
    r"""A text whose control characters are replaced: it is shown, and steers no terminal.

    Examples
    --------
    >>> visible("rod\x1b[31m\nleg")
    'rod�[31m\nleg'
    """
    if all(map(str.isprintable, text.split("\n"))):
        return text
    return "".join(c if c.isprintable() or c == "\n" else "\N{REPLACEMENT CHARACTER}" for c in text)


def printable(text: str, longest: int = _LONGEST_NAME) -> str:
    r"""A name on one line: control characters replaced, a long one cut.

    Examples
    --------
    >>> printable("rod\n1")
    'rod�1'
    """
    shown = visible(text[: longest + 1]).replace("\n", "\N{REPLACEMENT CHARACTER}")
    return shown if len(shown) <= longest else shown[: longest - 1] + "…"


@dataclass(frozen=True)
class Table:
    """Columns of text under their headings: as lines for a terminal, or as HTML.

    Attributes
    ----------
    header : sequence of str
        Headings, each with its unit.
    rows : sequence of sequences of str
        Cells.
    left : int
        So many of the first columns are text and flush left; numbers are flush right.
    columns : int
        On a terminal the rows are set in so many columns side by side.

    Examples
    --------
    >>> print(Table(["x [mm]", "y [mm]"], [["1.25", "-10.50"]]))
    x [mm]  y [mm]
      1.25  -10.50
    """

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    left: int = 0
    columns: int = 1

    def __str__(self) -> str:
        count = -(-len(self.rows) // self.columns)
        if self.columns > 1 and count:
            parts = [self.rows[k : k + count] for k in range(0, len(self.rows), count)]
            blocks = [str(Table(self.header, part, self.left)).splitlines() for part in parts]
            widths = [max(map(len, block)) for block in blocks]
            lined = (
                "   ".join(line.ljust(width) for line, width in zip(lines, widths, strict=True))
                for lines in zip_longest(*blocks, fillvalue="")
            )
            return "\n".join(map(str.rstrip, lined))
        lines = [list(self.header), *map(list, self.rows)]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        flush = [str.ljust] * self.left + [str.rjust] * (len(widths) - self.left)
        return "\n".join(
            "  ".join(
                pad(cell, width) for pad, cell, width in zip(flush, line, widths, strict=True)
            ).rstrip()
            for line in lines
        )

    def html(self) -> str:
        """Return a table as an HTML element; ``<`` and ``>`` in a cell are text."""
        body = [self._line("th", self.header), *(self._line("td", row) for row in self.rows)]
        return "<table>\n" + "\n".join(body) + "\n</table>"

    def _line(self, tag: str, cells: Sequence[str]) -> str:
        sides = ["left"] * self.left + ["right"] * (len(cells) - self.left)
        made = (
            f'<{tag} style="text-align:{side}">{escape(cell)}</{tag}>'
            for side, cell in zip(sides, cells, strict=True)
        )
        return f"<tr>{''.join(made)}</tr>"


POSE_HEADER = ("x [mm]", "y [mm]", "z [mm]", "α [deg]", "β [deg]", "γ [deg]")


def pose_cells(pose: Iterable[float]) -> list[str]:
    """Cells of a table under `POSE_HEADER`, of x y z in mm and α β γ in rad.

    Examples
    --------
    >>> pose_cells([0, -10, 850.25, 0, 0, math.pi])
    ['0.0000', '-10.0000', '850.2500', '0.0000', '0.0000', '180.0000']
    """
    units = ("mm", "mm", "mm", "rad", "rad", "rad")
    return [fixed(displayed(float(v), u)[0], 4) for v, u in zip(pose, units, strict=True)]


def long_table(
    header: Sequence[str], rows: Iterable[Sequence[str]], count: int
) -> Iterator[str | Table]:
    """A table of the first of `count` rows, and how many more there are."""
    yield Table(header, list(islice(rows, _MOST_ROWS)))
    if count > _MOST_ROWS:
        yield f"... {count - _MOST_ROWS} more rows"
