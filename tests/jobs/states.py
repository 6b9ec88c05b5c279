"""Objects of what options say, for Hypothesis; and what a verb makes of a command line."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import hypothesis.strategies as st
import pytest

from pkmcal.jobs.stated import Stated

# Letters that shells, TOML, command lines and paths each take for something.
LETTERS = st.sampled_from("ab-'\"\\ $*;#=,:[]{}\n\té±σ\x7f\u200b𝔸1.@/")
TEXT = st.text(LETTERS, min_size=1, max_size=8)
HEADING = st.text(LETTERS.filter(lambda each: each != "="), min_size=1, max_size=6).filter(
    lambda text: text == text.strip()
)
RENAMED = st.builds("{}={}".format, HEADING, TEXT.filter(lambda text: text == text.strip()))
OF_KIND: dict[str, st.SearchStrategy[Any]] = {
    "bool": st.booleans(),
    "str": TEXT,
    "str | None": st.none() | TEXT,
    "PathText | None": st.none() | TEXT,
    "PathText": TEXT,
    "int": st.integers(0, 2**63),
    "int | None": st.none() | st.integers(-9, 99),
    "float": st.floats(allow_nan=False, allow_infinity=False),
    "float | None": st.none() | st.floats(allow_nan=False, allow_infinity=False),
    "tuple[str, ...]": st.lists(TEXT, max_size=3),
}


def states(of: type[Stated], **own: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    parts = {each.name: OF_KIND.get(str(each.type)) for each in fields(of)} | own  # type: ignore[arg-type]
    return st.builds(of, **parts)


def said_by(run: Any, verb: Any, name: str, of: type[Stated], argv: list[str]) -> list[Any]:
    """What the verb hands to that of its functions that does the work, of these classes."""
    seen: list[tuple[Any, ...]] = []

    def taken(*given: Any) -> None:
        seen.append(given)
        raise KeyboardInterrupt  # the work is not done

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(verb, name, taken)
        result = run(*argv)
    assert seen, result.output
    return [each for each in seen[0] if isinstance(each, of)]
