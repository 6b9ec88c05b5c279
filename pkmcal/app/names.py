"""Names of files that others have chosen: what a folder, a terminal and a page may take of them."""

from __future__ import annotations

import re
import unicodedata

_LONGEST = 100  # bytes
_ENDING = 12  # of these for the ending
_FOREIGN = frozenset("<>:\"|?*'`$&;!%#\\/()[]{}^~")  # of shells and of file systems
_DEVICE = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\.|$)", re.IGNORECASE)  # Windows


def safe_name(given: str) -> str:
    """Return a name that no shell, terminal, option parser or file system takes for something else.

    The last part of a path, composed (NFC), without control and direction marks and without what
    shells know, neither hidden nor an option, of 100 bytes at the most.

    Examples
    --------
    >>> safe_name("../../etc/passwd"), safe_name("-rf"), safe_name("a b.csv")
    ('passwd', 'rf', 'a b.csv')
    >>> safe_name("aux.txt"), safe_name("…") == safe_name("…")
    ('file_aux.txt', True)
    """
    text = unicodedata.normalize("NFC", given).replace("\\", "/").rstrip("/").rpartition("/")[2]
    text = "".join("_" if _foreign(letter) else letter for letter in text)
    text = text.strip().lstrip(".-~_ ").rstrip(". ")
    if len(text.encode()) > _LONGEST:
        stem, dot, ending = text.rpartition(".")
        ending = _cut(ending, _ENDING - 2) if dot else ""
        text = _cut(stem if dot else text, _LONGEST - _ENDING) + dot + ending
    return f"file_{text}" if not text or _DEVICE.match(text) else text


def _foreign(letter: str) -> bool:
    return letter in _FOREIGN or not letter.isprintable() or unicodedata.category(letter)[0] == "C"


def _cut(text: str, most: int) -> str:
    """Return the beginning of a text in so many bytes, no letter cut in two."""
    return text.encode()[:most].decode(errors="ignore")
