"""The base of results: one line in a list, a table on a terminal, the same table in a notebook."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from html import escape

from pkmcal.display import Table


class Result:
    """A result that says itself: ``repr`` in one line, ``str`` and ``_repr_html_`` as tables.

    A subclass gives its parts once, text and tables in the order they are read; the first is its
    title, on one line. An empty text is a blank line on a terminal.
    """

    @abstractmethod
    def _parts(self) -> Iterator[str | Table]:
        """Title, then paragraphs and tables."""

    def __repr__(self) -> str:
        title = str(next(self._parts())).partition("\n")[0]
        return f"<{type(self).__name__}: {title}>"

    def __str__(self) -> str:
        return "\n".join(str(part) for part in self._parts())

    def _repr_html_(self) -> str:
        return "\n".join(
            part.html() if isinstance(part, Table) else f"<p>{escape(part)}</p>"
            for part in self._parts()
            if part != ""
        )
