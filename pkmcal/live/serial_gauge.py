"""A gauge at a serial port that sends lines of text with a number, as dial gauges do.

A line such as ``+0.1234``, ``01A+000.123`` or ``X 0.0124 in``. Some send by themselves, some when a
button is pressed, some when they are asked.
"""

from __future__ import annotations

import re
from time import monotonic
from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.exceptions import ArgumentError
from pkmcal.files.units import INCH
from pkmcal.live.device import DeviceError

_BAUD = 9600
_WAIT = 60.0  # s for a reading: a button may have to be pressed
_SILENT = 0.1  # s without a byte, after which a line begins: converters send in lots of 16 ms
_READING = re.compile(
    rb"(?:\d{2}[A-Z](?=[+-])|[A-Za-z]?[=: ]{0,3})"
    rb"(?P<number>[+-]? ?\d{1,6}(?P<point>[.,]\d{1,6})?) ?(?P<unit>mm|in|\")?"
)


class SerialGauge:
    """A gauge at a port of this computer; one number a line, in mm where it says no unit."""

    ADDRESS = "PORT[,BAUD[,ASK]]"

    def __init__(self, address: str, units: tuple[str, ...]) -> None:
        if units != ("mm",):
            raise ArgumentError(f"serial: a gauge reads one length; found {', '.join(units)}")
        port, _, rest = address.partition(",")
        baud, _, self._question = rest.partition(",")
        if not port or not (baud or str(_BAUD)).isdecimal():
            raise ArgumentError(f"serial: expected {self.ADDRESS}, found {address!r}")
        self._port = _opened(port, int(baud or _BAUD))
        self._name = port

    def read(self, wanted: str) -> FloatArray:
        """The number of the next line that is whole."""
        try:
            self._port.reset_input_buffer()
            if self._question:
                self._port.write(f"{self._question}\r\n".encode())
            first = b""
            if not self._question:  # it may send by itself, and be in the middle of a line
                self._port.timeout = _SILENT
                first = self._port.read(1)
            if first:
                self._line(_WAIT, first)
            line = self._line(_WAIT)
        except OSError as error:  # pyserial's are of this kind
            raise DeviceError(f"the gauge at {self._name} broke off: {error}") from None
        if not line:
            raise DeviceError(f"the gauge at {self._name} sends nothing")
        return np.array([_number(line, self._name)])

    def close(self) -> None:
        """Close the port."""
        self._port.close()

    def _line(self, wait: float, found: bytes = b"") -> bytes:
        """The next line with something in it; nothing where none ends in time."""
        end = monotonic() + wait
        if found in (b"\r", b"\n"):
            return b""
        while (left := end - monotonic()) > 0.0:
            self._port.timeout = left
            byte = self._port.read(1)
            if byte not in (b"\r", b"\n"):
                found += byte
            elif found.strip():
                return found.strip()
        return b""


def _number(line: bytes, name: str) -> float:
    found = _READING.fullmatch(line)
    if found is None or not (found["point"] or found["unit"]):  # as in "ERR 2", "911"
        raise DeviceError(f"the gauge at {name} sends {line[:60]!r}, which is no single number")
    number = float(found["number"].replace(b",", b".").replace(b" ", b""))
    return number * (INCH if found["unit"] in (b"in", b'"') else 1.0)


def _opened(port: str, baud: int) -> Any:
    try:
        import serial
    except ImportError:
        raise ArgumentError("serial: needs pyserial: pip install pyserial") from None
    try:
        return serial.Serial(port, baud, exclusive=True)
    except (OSError, ValueError) as error:
        raise DeviceError(f"serial: {port}: {error}") from None
