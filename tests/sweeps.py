"""Cases of a law, of which `make test` takes a few and `make test-all` takes all."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def sweep(names: str, cases: Iterable[Any], quick: Iterable[Any]) -> pytest.MarkDecorator:
    """Parametrize a test by these cases, of which all but the quick ones are slow."""
    every, few = list(map(_tuple, cases)), list(map(_tuple, quick))
    missing = [case for case in few if case not in every]
    assert not missing, f"no case of the sweep: {missing}"
    parameters = [
        pytest.param(*case, marks=() if case in few else (pytest.mark.slow,)) for case in every
    ]
    return pytest.mark.parametrize(names, parameters)


def _tuple(case: Any) -> tuple[Any, ...]:
    return case if isinstance(case, tuple) else (case,)
