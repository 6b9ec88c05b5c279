"""Write a CSV file whole: comment lines, headings, rows."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from os import PathLike

from pkmcal import arguments
from pkmcal.files.atomic import write_whole


def write_csv(
    path: str | PathLike[str],
    headings: Iterable[str],
    rows: Iterable[Iterable[str]],
    *,
    comment: str = "",
) -> None:
    """Write a file that `pkmcal.files.csv_table.Table` reads back, or nothing.

    Parameters
    ----------
    path : str or path
        The file; replaced as a whole or not at all.
    headings : iterable of str
        Of the columns, each with its unit.
    rows : iterable of iterables of str
        Cells.
    comment : str, optional
        Lines for its head, each with its ``#``.

    Raises
    ------
    ValueError
        A line of the comment without its ``#``.
    OSError
        The file cannot be written; one that was there before is untouched.
    """
    text = io.StringIO()
    text.write(arguments.comment(comment))
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(headings)
    writer.writerows(rows)
    write_whole(path, text.getvalue())
