"""Text files out of the templates of this room."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jinja2 import Environment


@cache
def _environment() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined  # takes a while to import

    return Environment(
        loader=PackageLoader("pkmcal.controllers"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def rendered(template: str, contents: Mapping[str, Any]) -> str:
    """A template with its names replaced by what they stand for."""
    return _environment().get_template(template).render(contents)
