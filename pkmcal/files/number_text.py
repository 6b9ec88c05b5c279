"""Numbers as people and programs write them: decimal commas, thousands apart, a true minus."""

from __future__ import annotations

import re
from collections.abc import Iterable

_THOUSANDS = re.compile(  # told from decimals by the other sign, or by a blank
    r"[+-]?[0-9]{1,3}(?:(?P<point>(?:\.[0-9]{3})+,[0-9]+)|(?P<comma>(?:,[0-9]{3})+\.[0-9]+)"
    r"|(?:(?P<blank>[ '\u2019\u00a0\u202f])[0-9]{3})+(?:(?P<decimal>[.,])[0-9]*)?)"
)
_NO_NUMBER = "no number"
Signs = tuple[str, str]  # of thousands and of decimals


def thousands(cells: Iterable[str]) -> tuple[Signs, str] | None:
    """What separates thousands and decimals in a column, and a cell that shows it; None: nothing.

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
    text = cell.replace("\N{MINUS SIGN}", "-").replace("_", _NO_NUMBER)  # float() takes 1_000
    if signs is None:
        return text.replace(",", ".", 1) if decimal_comma and "." not in text else text
    whole, point, rest = text.partition(signs[1])
    first, *groups = whole.split(signs[0])
    if groups and not all(len(group) == 3 for group in groups):
        return _NO_NUMBER  # 12.34 among 1.234,5
    return "".join([first, *groups]) + ("." + rest if point else "")
