"""Numbers as people read them: only the digits that their uncertainty supports."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from itertools import islice

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
    return f"{fixed(value, places)} ± {fixed(abs(sigma), places)}"


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

    Examples
    --------
    >>> print(Table(["x [mm]", "y [mm]"], [["1.25", "-10.50"]]))
    x [mm]  y [mm]
      1.25  -10.50
    """

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    left: int = 0

    def __str__(self) -> str:
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
        """The same as a table element; what is between ``<`` and ``>`` in a cell is text."""
        body = [self._line("th", self.header), *(self._line("td", row) for row in self.rows)]
        return "<table>\n" + "\n".join(body) + "\n</table>"

    def _line(self, tag: str, cells: Sequence[str]) -> str:
        sides = ["left"] * self.left + ["right"] * (len(cells) - self.left)
        made = (
            f'<{tag} style="text-align:{side}">{escape(cell)}</{tag}>'
            for side, cell in zip(sides, cells, strict=True)
        )
        return f"<tr>{''.join(made)}</tr>"
