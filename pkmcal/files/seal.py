"""A file that states the SHA-256 of the rest of itself: whether it is as it was written.

What has no seal, or another content than it states, is somebody's work. The seal stands where the
format has room for a remark: a comment of CSV, TOML, HTML, SVG, XML, URDF, C, ini and hal files
and of a lens file in YAML, the first key of JSON, a text chunk before the end of PNG, a comment at
the end of PDF. Other files, a machine's configuration in YAML, in a printer's form or in G-code
among them, are their owner's and have no seal.
"""

from __future__ import annotations

import hashlib
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass

_WORDS = "sha256 of the rest"
_IEND = 12  # bytes that end a PNG file
_OPENCV = b"%YAML:1.0\n---\n"  # the head of its YAML files, which has to stay the first


@dataclass(frozen=True)
class _Form:
    """The form of a seal and its place: after so many bytes, or before so many.

    A content without the `head` has no seal.
    """

    written: Callable[[str], bytes]
    after: int | None = None
    before: int = 0
    head: bytes = b""

    def place(self, length: int) -> int:
        """Return the seal's place in a content of this length without it."""
        return length - self.before if self.after is None else self.after


def _line(digest: str) -> bytes:
    return f"# {_WORDS}: {digest}\n".encode()


def _remark_in_c(digest: str) -> bytes:
    return f"/* {_WORDS}: {digest} */\n".encode()


def _key(digest: str) -> bytes:
    return f'  "{_WORDS}": "{digest}",\n'.encode()


def _remark(digest: str) -> bytes:
    return f"<!-- {_WORDS}: {digest} -->\n".encode()


def _comment(digest: str) -> bytes:
    return f"% {_WORDS}: {digest}\n".encode()


def _chunk(digest: str) -> bytes:
    body = b"tEXt" + f"{_WORDS}\0{digest}".encode()
    return struct.pack(">I", len(body) - 4) + body + struct.pack(">I", zlib.crc32(body))


_FORMS = {
    ".csv": _Form(_line, after=0),
    ".toml": _Form(_line, after=0),
    ".ini": _Form(_line, after=0),
    ".yaml": _Form(_line, after=len(_OPENCV), head=_OPENCV),
    ".hal": _Form(_line, after=0),
    ".h": _Form(_remark_in_c, after=0),
    ".c": _Form(_remark_in_c, after=0),
    ".json": _Form(_key, after=len("{\n")),
    ".html": _Form(_remark),
    ".svg": _Form(_remark),
    ".xml": _Form(_remark),
    ".urdf": _Form(_remark),
    ".sdf": _Form(_remark),
    ".pdf": _Form(_comment),
    ".png": _Form(_chunk, before=_IEND),
}


def sealed(content: bytes, kind: str) -> bytes:
    r"""A file's content with its seal, if files of its kind have one.

    Parameters
    ----------
    content : bytes
        What is written, without a seal; JSON begins with a brace on a line of its own.
    kind : str
        The ending of the file's name, such as ".csv".

    Examples
    --------
    >>> print(sealed(b"x [mm]\n1\n", ".csv").decode())  # doctest: +ELLIPSIS
    # sha256 of the rest: 6831eba9...
    x [mm]
    1
    <BLANKLINE>
    """
    form = _FORMS.get(kind)
    if form is None or not content.startswith(form.head):
        return content
    at = form.place(len(content))
    return content[:at] + form.written(hashlib.sha256(content).hexdigest()) + content[at:]


def is_sealed(content: bytes, kind: str) -> bool:
    r"""Return whether a file is still as it was when it was sealed.

    Examples
    --------
    >>> written = sealed(b"x [mm]\n1\n", ".csv")
    >>> is_sealed(written, ".csv"), is_sealed(written + b"2\n", ".csv")
    (True, False)
    """
    form = _FORMS.get(kind)
    if form is None or not content.startswith(form.head):
        return False
    size = len(form.written("0" * 64))
    at = form.place(len(content) - size)
    return at >= 0 and sealed(content[:at] + content[at + size :], kind) == content
