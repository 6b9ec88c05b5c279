"""Provenance of a file: the version that wrote it, and checksums of its sources."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping


def version() -> str:
    """The version of this package."""
    from importlib.metadata import version as installed  # takes a while to import

    return installed("pkmcal")


def checksums(files: Mapping[str, bytes]) -> dict[str, str]:
    """SHA-256 of files by their names, in which control characters are escaped."""
    return {_escaped(name): hashlib.sha256(data).hexdigest() for name, data in files.items()}


def _escaped(name: str) -> str:
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in name)


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
