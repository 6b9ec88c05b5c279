"""Text files of controllers: decoded with every character kept, and split where their lines end."""

from __future__ import annotations

import re
from os import PathLike
from typing import Literal

from pkmcal.arguments import path as as_path
from pkmcal.exceptions import FileError
from pkmcal.files.reading import MOST_TEXT, content

MARK = "\ufeff"  # before the text of some editors
_LINE = re.compile(r"[^\r\n]*(?:\r\n|\r|\n)|[^\r\n]+")


def text_in(
    path: str | PathLike[str], errors: Literal["strict", "replace", "surrogateescape"] = "strict"
) -> str:
    """Return the text of a file, with line ends and byte order mark as they are.

    Raises
    ------
    FileError
        It is no text in UTF-8, unless `errors` says what to do with it, as in `bytes.decode`.
    """
    try:
        return content(path, MOST_TEXT).decode("utf-8", errors)
    except UnicodeDecodeError:
        raise FileError(
            f"{as_path('path', path)}: this is no text in UTF-8: save it as UTF-8, in an"
            " editor by Save as, Encoding"
        ) from None


def lines_of(text: str) -> list[str]:
    """The lines of a text with their ends.

    ``str.splitlines`` ends one at other characters, too, which may stand in a comment.
    """
    return _LINE.findall(text)
