"""The file that a measurement grows into: each row is on the disk before anything else happens.

A file of measurements as any other. Rows are added at its end and never changed; a row that was
half written when the power went is cut off when it is opened again, and that is said.
"""

from __future__ import annotations

import errno
import os
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from pkmcal import arguments
from pkmcal.arrays import FloatArray
from pkmcal.exceptions import FileError
from pkmcal.files.csv_writer import lines_of
from pkmcal.kinematics.reading_units import reading_units
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.measurement_csv import read_measurements
from pkmcal.measurements.measurement_writer import headed_cells
from pkmcal.measurements.measurements import Measurements
from pkmcal.readings.reading import Reading

try:
    import fcntl
except ImportError:  # Windows, where a second program could write to the log, too
    fcntl = None  # type: ignore[assignment]

_BINARY = getattr(os, "O_BINARY", 0)


class RowLog:
    """Rows of a measurement that goes on.

    Parameters
    ----------
    path : path
        The file; rows that are there are gone on from.
    robot : Robot
        The machine.
    kind : Reading
        What is read.
    sigma : ndarray (k,) or None
        Its deviation, which each new row states; rows that are there keep theirs.
    target : ndarray (3,) or None
        The point that is measured, likewise.
    comment : str
        For the head of the file: where the machine is from.

    Raises
    ------
    ValueError
        A file that is there is of another machine, or of other columns, or has a row that is not
        whole.
    OSError
        It cannot be written, or another program writes to it.

    Attributes
    ----------
    notes : tuple of str
        What was found when the file was opened.
    """

    def __init__(
        self,
        path: Path,
        robot: Robot,
        kind: Reading,
        sigma: FloatArray | None,
        target: FloatArray | None,
        comment: str,
    ) -> None:
        self._path, self._robot, self._kind = path, robot, kind
        self._sigma, self._target = sigma, target
        self._units = reading_units(robot)
        self._actuators: list[FloatArray] = []
        self._values: list[FloatArray] = []
        self._seconds: list[float] = []
        self._sigmas: list[FloatArray] = []  # of each row, as the file has it
        self._targets: list[FloatArray] = []
        self._size = 0  # bytes that the file has when nobody else writes to it
        self.notes: tuple[str, ...] = ()
        self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | _BINARY, 0o666)
        try:
            self._lock()
            head = arguments.comment(comment) + lines_of([self._headings()])
            if os.fstat(self._file).st_size:
                self._go_on(head)
            else:
                self._write(head)
        except BaseException:
            self.close()
            raise

    @property
    def rows(self) -> Measurements | None:
        """All rows; None where there is none yet."""
        if not self._actuators:
            return None
        return replace(
            self._measured(self._actuators, self._values, self._seconds),
            sigma=None if self._sigma is None else np.array(self._sigmas),
            target=None if self._target is None else np.array(self._targets),
        )

    def append(self, actuators: FloatArray, values: FloatArray, seconds: float) -> None:
        """Write rows of one pose: actuators (n,), values (R, k), and when that was.

        Raises
        ------
        OSError
            The disk is full, say: what was there is as it was. Or another program has changed the
            file, or put another in its place.
        """
        many = len(values)
        new = [actuators] * many, [*values], [seconds] * many
        _, cells = headed_cells(self._measured(*new), self._units)
        self._require_ours()
        self._write(lines_of(cells))
        self._actuators += new[0]
        self._values += new[1]
        self._seconds += new[2]
        self._state(many)

    def close(self) -> None:
        """Close the file."""
        with suppress(OSError):
            os.close(self._file)

    def _measured(
        self, actuators: list[FloatArray], values: list[FloatArray], seconds: list[float]
    ) -> Measurements:
        read: FloatArray | None = np.array(values).reshape(len(values), -1)
        if not self._kind.components:
            read = None
        elif read is not None and read.shape[1] == 1:
            read = read[:, 0]
        return Measurements(
            np.array(actuators),
            read,
            self._kind,
            sigma=self._sigma,
            target=self._target,
            actuator_units=self._robot.actuator_units,
            time=np.array(seconds),
        )

    def _headings(self) -> list[str]:
        """Headings of the columns, which are the same whatever the numbers are."""
        home = [np.zeros(self._robot.n_actuators)]
        none = [np.zeros(len(self._kind.components))]
        return headed_cells(self._measured(home, none, [0.0]), self._units)[0]

    def _go_on(self, head: str) -> None:
        """Read the rows that are there.

        Raises
        ------
        ValueError
            Another head: of another machine or other columns.
        """
        content = self._path.read_bytes()
        plain = content.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n")  # of some editors
        if not plain.startswith(head.encode()):
            raise FileError(
                f"{self._path}: is there and begins otherwise than a measurement of this kind of"
                f" this machine; choose another file. Expected {_shown(head)}, found"
                f" {_shown(plain[: len(head)].decode('utf-8', 'replace'))}"
            )
        whole = content.rfind(b"\n") + 1
        if whole < len(content):
            cut = content[whole:].decode("utf-8", "replace")
            os.ftruncate(self._file, whole)
            os.fsync(self._file)
            self.notes += (
                f"{self._path}: its last line has no end, as if half written, and is cut off:"
                f" {cut[:200]!r}",
            )
        self._size = whole
        if not plain[len(head.encode()) : plain.rfind(b"\n") + 1].strip():
            return
        there = read_measurements(self._path, self._robot)
        self._require_whole(there)
        self._actuators = [*there.actuators]
        self._values = [*there.values.reshape(len(there), -1)]
        self._seconds = [0.0] * len(there) if there.time is None else there.time.tolist()
        self._state(len(there))
        for mine, of_file in ((self._sigmas, there.sigma), (self._targets, there.target)):
            if of_file is not None and mine:
                changed = [*np.broadcast_to(of_file, (len(there), len(mine[0])))]
                if not np.array_equal(changed, mine):
                    what = "deviation" if mine is self._sigmas else "point"
                    self.notes += (
                        f"{self._path}: its rows state another {what} than new ones will, and keep"
                        " it",
                    )
                mine[:] = changed
        self.notes += (f"{self._path}: goes on behind {len(there)} rows",)

    def _require_whole(self, there: Measurements) -> None:
        """Refuse rows of which a number is missing.

        Raises
        ------
        ValueError
            The first of them, by its line.
        """
        parts = [there.actuators, there.values, there.sigma, there.target]
        rows = [np.reshape(each, (len(there), -1)) for each in parts if each is not None
                and np.size(each) % len(there) == 0]  # fmt: skip
        bad = np.flatnonzero(~np.isfinite(np.hstack(rows)).all(axis=1))
        if len(bad):
            line = "" if there.lines is None else f", line {there.lines[bad[0]]}"
            raise FileError(
                f"{self._path}{line}: a number is missing; complete the row or delete it"
            )

    def _state(self, many: int) -> None:
        """Note what new rows state."""
        if self._sigma is not None:
            self._sigmas += [self._sigma] * many
        if self._target is not None:
            self._targets += [self._target] * many

    def _require_ours(self) -> None:
        """Refuse to write where another program has.

        Raises
        ------
        OSError
            The file is another, is gone, or has another size.
        """
        mine = os.fstat(self._file)
        try:
            now = os.stat(self._path)
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(self._path)) from None
        if not os.path.samestat(mine, now) or mine.st_size != self._size:
            raise OSError(
                errno.EBUSY, "another program has changed it while it was measured", str(self._path)
            )

    def _write(self, text: str) -> None:
        """Add to the file, and see it on the disk; all of it or nothing."""
        before, left = os.fstat(self._file).st_size, text.encode()
        try:
            while left:
                left = left[os.write(self._file, left) :]
            os.fsync(self._file)
        except OSError as error:
            with suppress(OSError):
                os.ftruncate(self._file, before)
            raise OSError(error.errno, error.strerror, str(self._path)) from None
        self._size = os.fstat(self._file).st_size

    def _lock(self) -> None:
        """Keep others away who would write between these rows."""
        if fcntl is None:
            return
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise OSError(
                error.errno, "another measurement writes to it", str(self._path)
            ) from None


def _shown(head: str) -> str:
    return " / ".join(repr(line) for line in head.splitlines())
