"""Numbers as people and programs write them: decimal commas, thousands apart, a true minus."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

_THOUSANDS = re.compile(  # told from decimals by the other sign, or by a blank
    r"[+-]?[0-9]{1,3}(?:(?P<point>(?:\.[0-9]{3})+,[0-9]+)|(?P<comma>(?:,[0-9]{3})+\.[0-9]+)"
    r"|(?:(?P<blank>[ '\u2019\u00a0\u202f])[0-9]{3})+(?:(?P<decimal>[.,])[0-9]*)?)"
)
_ALONE = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_EITHER = re.compile(r"[+-]?[1-9][0-9]{0,2}[.,][0-9]{3}")  # a thousand and more, or less than that
_DECIMALS = re.compile(r"[+-]?[0-9]*[.,][0-9]*(?:[eE][+-]?[0-9]+)?")
_NO_NUMBER = "no number"
_MARKS = ",."  # that numbers may have before their decimals
Signs = tuple[str, str]  # of thousands and of decimals


def thousands(cells: Iterable[str]) -> tuple[Signs, str] | None:
    """Return separators of thousands and decimals in a column, and a cell that shows it, or None.

    Examples
    --------
    >>> thousands(["1.234,5", "2.000"])
    (('.', ','), '1.234,5')
    >>> thousands(["1.234", "2.5"])
    """
    for cell in cells:
        match = _THOUSANDS.fullmatch(cell)
        if match and match["blank"]:
            return (match["blank"], match["decimal"] or "."), cell
        if match:
            return ((".", ",") if match["point"] else (",", ".")), cell
    return None


def numbers_alone(cells: Sequence[str]) -> list[float] | None:
    """The numbers of cells that have nothing but digits, a point and an exponent, or None.

    Examples
    --------
    >>> numbers_alone(["1.5", "-2e3"]), numbers_alone(["1.5", "2,5"])
    ([1.5, -2000.0], None)
    """
    return list(map(float, cells)) if all(map(_ALONE.fullmatch, cells)) else None


def is_either(cell: str) -> bool:
    """Return whether a cell may be a thousand and more, or a number with decimals.

    Examples
    --------
    >>> is_either("12,345"), is_either("12.345"), is_either("0,345"), is_either("12,34")
    (True, True, False, False)
    """
    return _EITHER.fullmatch(_straight(cell)) is not None


def decimals(rows: Iterable[Sequence[str]]) -> dict[str, str]:
    """The marks before decimals, comma or point, each with a cell that shows it.

    Examples
    --------
    >>> decimals([["12,345", "1.234,5"], ["0.5", "2"]])
    {',': '1.234,5', '.': '0.5'}
    """
    cells = [cell for row in rows for cell in row]
    shown = {mark: next((c for c in cells if mark in c and _shows(c, mark)), "") for mark in _MARKS}
    return {mark: cell for mark, cell in shown.items() if cell}


def undecided(cells: Sequence[str]) -> list[tuple[int, str]]:
    """The first cell for each mark that may part thousands or decimals, if no other cell decides.

    Examples
    --------
    >>> undecided(["7", "1,234", "5,678"]), undecided(["1,234", "0,5"])
    ([(1, ',')], [])
    """
    found = []
    for mark in _MARKS:
        row = next((i for i, c in enumerate(cells) if mark in c and is_either(c)), None)
        if row is not None and mark not in decimals([cells]):
            found.append((row, mark))
    return found


def _shows(cell: str, mark: str) -> bool:
    """Return whether a mark of a cell is that of decimals and can be nothing else."""
    text = _straight(cell)
    signs = thousands([text])
    return (signs is not None and signs[0][1] == mark) or (
        _DECIMALS.fullmatch(text) is not None and not is_either(text)
    )


def typed(text: str) -> float:
    """A number as it is typed on a command line.

    Raises
    ------
    ValueError
        It is none: 1_0, which Python takes for 10, is more likely meant as 1.0.
    """
    return float(plain(text, None, False))


def plain(cell: str, signs: Signs | None, decimal_comma: bool) -> str:
    """A cell as `float` reads it; what is none there is no number.

    Examples
    --------
    >>> plain("1.234,5", (".", ","), True), plain("12.34", (".", ","), True)
    ('1234.5', 'no number')
    """
    text = _straight(cell).replace("_", _NO_NUMBER)  # float() takes 1_000
    if signs is None:
        return text.replace(",", ".", 1) if decimal_comma and "." not in text else text
    whole, point, rest = text.partition(signs[1])
    first, *groups = whole.split(signs[0])
    if groups and not all(len(group) == 3 for group in groups):
        return _NO_NUMBER  # 12.34 among 1.234,5
    return "".join([first, *groups]) + ("." + rest if point else "")


def _straight(cell: str) -> str:
    return cell.replace("\N{MINUS SIGN}", "-")
