"""The base of results: one line in a list, a table on a terminal, the same table in a notebook."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from importlib import import_module
from typing import Any, ClassVar, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from pkmcal.display import Table, first_rows, visible
from pkmcal.exceptions import ArgumentError

Kept = TypeVar("Kept")


def read_only(value: Kept) -> Kept:
    """Return an array, or a tuple with arrays in it, that cannot be written to.

    The array that was given stays as it is. Anything else is returned as it is.
    """
    if isinstance(value, np.ndarray) and value.flags.writeable:
        kept = value.view()
        kept.flags.writeable = False
        return cast(Kept, kept)
    parts: object = value
    if type(parts) is tuple and any(isinstance(each, np.ndarray) for each in parts):
        return cast(Kept, tuple(map(read_only, parts)))
    return value


class ReadOnly:
    """Fields that are arrays cannot be written to: what is stated of them would not follow.

    Nor can those of its copies, and of what is read from a pickle.
    """

    def __post_init__(self) -> None:
        fields = vars(self)
        for name, value in fields.items():
            fields[name] = read_only(value)

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self.__post_init__()


class Result(ReadOnly):
    """A result that says itself: ``repr`` in one line, ``str`` and ``_repr_html_`` as tables.

    A subclass gives its parts once, text and tables in the order they are read; the first is its
    title, on one line. An empty text is a blank line on a terminal; breaks and indents of lines are
    a terminal's too.
    """

    @abstractmethod
    def _parts(self) -> Iterator[str | Table]:
        """Title, then paragraphs and tables."""

    def __repr__(self) -> str:
        title = str(next(self._parts())).partition("\n")[0]
        return visible(f"<{type(self).__name__}: {title}>")

    def __str__(self) -> str:
        return visible("\n".join(str(part) for part in self._parts()))

    def paragraphs(self) -> list[str]:
        """Return the text as paragraphs without line breaks; the title is first."""
        texts = (part for part in self._parts() if isinstance(part, str))
        return [visible(" ".join(text.split())) for text in texts if text]

    def tables(self) -> list[str]:
        """Return the tables as a terminal shows them."""
        return [visible(str(part)) for part in self._parts() if isinstance(part, Table)]

    def _columns(self) -> Mapping[str, Sequence[Any]]:
        """Columns of a data frame by heading; a result that has rows gives them."""
        raise ArgumentError(f"a {type(self).__name__} has no rows to make a data frame of")

    def to_pandas(self) -> Any:
        """The rows as a pandas data frame, where pandas is installed; mm and rad.

        Raises
        ------
        ImportError
            pandas is not installed.
        ValueError
            This result has no rows.
        """
        columns = self._columns()
        return import_module("pandas").DataFrame(dict(columns))

    def _repr_html_(self) -> str:
        return "\n".join(
            part.html() if isinstance(part, Table) else f"<p>{escape(' '.join(part.split()))}</p>"
            for part in self._parts()
            if part != ""
        )


class RowResult(Result):
    """A result of many rows with a status each, 0 where the row was solved.

    Attributes
    ----------
    status : ndarray of int (...)
        What became of each row.
    STATUS : mapping of int to str
        What each status means.
    """

    status: NDArray[np.int32]
    STATUS: ClassVar[Mapping[int, str]]

    @property
    def ok(self) -> NDArray[np.bool_]:
        """Mask of rows that were solved, (...)."""
        return np.equal(self.status, 0)

    @property
    def success(self) -> NDArray[np.bool_]:
        """Mask of rows that were solved, as `ok` does."""
        return self.ok

    @property
    def failed(self) -> NDArray[np.bool_]:
        """Mask of rows that were not solved, (...)."""
        return np.not_equal(self.status, 0)

    def failures(self) -> str:
        """One line on what failed and where; empty where nothing did."""
        return failed_rows(np.ravel(self.status), self.STATUS)

    def _counts(self) -> str:
        """Count the rows of each status."""
        codes, counts = np.unique(self.status, return_counts=True)
        parts = (f"{n} {self.STATUS[int(code)]}" for code, n in zip(codes, counts, strict=True))
        total = "1 row" if np.size(self.status) == 1 else f"{np.size(self.status)} rows"
        return f"{total}: {', '.join(parts)}" if codes.size else total


def failed_rows(
    status: NDArray[np.int32],
    meanings: Mapping[int, str],
    numbers: NDArray[np.intp] | None = None,
    most: int = 5,
) -> str:
    """Say how many rows failed and why, and list the first; empty where none did.

    Parameters
    ----------
    status : ndarray of int (N,)
        Of each row; 0 where it was solved.
    meanings : mapping of int to str
        What each status means.
    numbers : ndarray of int (N,), optional
        What the rows are called; by default they are counted from 0.
    most : int
        How many rows are listed of each status.
    """
    parts: list[str] = []
    if not status.any():
        return ""
    for code, words in meanings.items():
        rows = np.flatnonzero(status == code)
        if code and rows.size:
            called = rows if numbers is None else numbers[rows]
            listed = first_rows(called.tolist(), most)
            parts.append(f"{rows.size} of {status.size} rows {words} (rows {listed})")
    return "; ".join(parts)
