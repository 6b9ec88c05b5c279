"""Where a file comes from: the version that wrote it and the checksums of what was read."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path

_LONGEST = 120  # letters of a name


def version() -> str:
    """The version of this package."""
    import pkmcal

    return str(pkmcal.__version__)


def contents(robot: str, *paths: Path) -> dict[str, bytes]:
    """What a command reads, by name; a built-in machine by its own.

    Parameters
    ----------
    robot : str
        A name or a file, as `load` takes it.
    *paths : Path
        Other files.

    Raises
    ------
    ValueError, OSError
        No such machine; a file that cannot be read.
    """
    from pkmcal.robotfile import located

    content, place, file = located(robot)
    return {Path(file).name if file else place: content} | {p.name: p.read_bytes() for p in paths}


def checksums(files: Mapping[str, bytes]) -> dict[str, str]:
    """SHA-256 of files by their printable names."""
    return {printable(name): hashlib.sha256(data).hexdigest() for name, data in files.items()}


def comment(files: Mapping[str, bytes]) -> str:
    """Lines for the head of a TOML or CSV file.

    Examples
    --------
    >>> print(comment({"probe.csv": b""}))  # doctest: +ELLIPSIS
    # Written by pkmcal ... from
    #   probe.csv, sha256 e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855
    <BLANKLINE>
    """
    lines = [f"# Written by pkmcal {version()} from"]
    lines += [f"#   {name}, sha256 {digest}" for name, digest in checksums(files).items()]
    return "\n".join(lines) + "\n"


def printable(text: str, longest: int = _LONGEST) -> str:
    r"""A name on one line: control characters replaced, a long one cut.

    Examples
    --------
    >>> printable("rod\n1")
    'rod�1'
    """
    shown = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)
    return shown if len(shown) <= longest else shown[: longest - 1] + "…"
