"""The table of all checks in `docs/believe.md`; `python -m tests.docs.checks_table` writes it."""

from __future__ import annotations

from pkmcal.diagnostics.checks import CHECKS

from .pages import DOCS

PAGE = DOCS / "believe.md"
_BEGIN, _END = "| check | looks for |", "\n\n"
_MEANS = {"grave": "not calibrated", "doubt": "doubtful", "remark": "a note"}


def table() -> str:
    """The rows of the table, one a check, in the order in which the checks speak."""
    rows = [f"{_BEGIN} says | silent beside | warned of |", "|---|---|---|---|---|"]
    for check in CHECKS:
        says = " or ".join(_MEANS[level] for level in check.levels)
        beside = [_MEANS.get(other, f"`{other}`") for other in check.unless]
        at_once = "yes" if check.at_once else ""
        rows.append(
            f"| `{check.name}` | {check.about} | {says} | {', '.join(beside)} | {at_once} |"
        )
    return "\n".join(rows)


def stated() -> str:
    """The table as the page has it."""
    text = PAGE.read_text(encoding="utf-8")
    start = text.index(_BEGIN)
    return text[start:].partition(_END)[0].rstrip("\n")


if __name__ == "__main__":
    page = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(page.replace(stated(), table()), encoding="utf-8")
