"""Addresses as users type them: nothing is asked that they did not name."""

from __future__ import annotations

import re

from pkmcal.exceptions import ArgumentError

_HTTP = re.compile(
    r"(?P<scheme>https?)://(?P<host>[A-Za-z0-9.-]+|\[[0-9A-Fa-f:]+\])(:(?P<port>\d+))?/?"
)
_PLAIN = re.compile(r"(?P<host>[A-Za-z0-9.-]+|\[[0-9A-Fa-f:]+\])(:(?P<port>\d+))?")


def http_address(text: str, what: str) -> str:
    """The address of a server of HTTP, without a slash at its end.

    Raises
    ------
    ValueError
        None, or one with a path, a user or a password.
    """
    found = _HTTP.fullmatch(text)
    if found is None or not _port_is_one(found["port"]):
        raise ArgumentError(
            f"{what}: expected an address such as http://printer.local:7125, without path, user and"
            f" password; found {text!r}"
        )
    return text.rstrip("/")


def host_and_port(text: str, port: int, what: str) -> tuple[str, int]:
    """Host and port, where a port need not be stated.

    Raises
    ------
    ValueError
        None.
    """
    found = _PLAIN.fullmatch(text)
    if found is None or not _port_is_one(found["port"]):
        raise ArgumentError(f"{what}: expected HOST or HOST:PORT, found {text!r}")
    return found["host"].strip("[]"), int(found["port"] or port)


def _port_is_one(port: str | None) -> bool:
    return port is None or 0 < int(port) < 65536
