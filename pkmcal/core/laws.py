"""Drive laws: the readings q of actuators and the ways q̃ of their drives, row by row, and back.

Of each drive q̃ = (offset + S(gain q + quadratic q²) + Σ (a cos k q + b sin k q) + table(q)
± backlash / 2) (1 + stretch t) at a tension t, where S(w) = ((R + u)² - R²)/c with u = c w / 2 is a
spool, or w without one. The formulas of what is in the first brackets are those of
``derive/laws.py``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.core.library import rows

_CELLS = 2000  # of a stroke, in which the least slope is bounded
MOST_STEPS = 80  # of Newton's method; bisection alone needs some 60
_PERIOD = 1e-9  # of a period of harmonics, by which a turn may miss it
ROUNDING = 1e-13  # of the numbers of a way


@dataclass(frozen=True, eq=False)
class Drive:
    """One drive: its actuator, and where its numbers are in the flattened geometry.

    Attributes
    ----------
    actuator : int
        Which reading it takes, counted from 0.
    angle : bool
        Whether its way is an angle.
    offset, gain : int
        Places.
    quadratic, spool, buildup, backlash, stretch : int or None
        Places; None: it has no such number.
    harmonics : tuple of (float, int, int)
        k, and the places of cos and sin.
    table : ndarray (K,)
        Readings, rising, at which it has corrections.
    corrections : tuple of int, K
        Their places.
    stroke : tuple of float or None
        Least and most of its way; mm or rad.
    """

    actuator: int
    angle: bool
    offset: int
    gain: int
    quadratic: int | None = None
    spool: int | None = None
    buildup: int | None = None
    harmonics: tuple[tuple[float, int, int], ...] = ()
    table: FloatArray | None = None
    corrections: tuple[int, ...] = ()
    backlash: int | None = None
    stretch: int | None = None
    stroke: tuple[float, float] | None = None

    @property
    def corrected(self) -> bool:
        """True if the drive's inverse has no closed form."""
        return bool(self.harmonics) or self.table is not None


@dataclass(frozen=True, eq=False)
class Ways:
    """Ways (N, drives) at readings, with their first and second derivative by the reading."""

    way: FloatArray
    slope: FloatArray
    bend: FloatArray


class LawNumbers(NamedTuple):
    """The numbers of one law, as its inverse needs them.

    Attributes
    ----------
    base : tuple of float
        Offset, gain, quadratic, radius of the spool and its build-up; 0, 1 and 0 without these.
    waves : list of (float, float, float)
        k, cos and sin of each harmonic.
    points : list of (float, float)
        Readings and corrections of the table.
    most : float
        How large the corrections can be.
    span : (float, float)
        Between which readings it is monotone for certain; NaN: nowhere.
    """

    base: tuple[float, ...]
    waves: list[tuple[float, float, float]]
    points: list[tuple[float, float]]
    most: float
    span: tuple[float, float]


class Laws:
    """The laws of all drives of a machine.

    Parameters
    ----------
    drives : sequence of Drive
        In the order of the drives.
    size : int
        How many numbers a geometry has.
    """

    def __init__(self, drives: Sequence[Drive], size: int) -> None:
        self.drives = tuple(drives)
        self.actuator: IntArray = np.array([drive.actuator for drive in drives], dtype=np.intp)
        zero, one = size, size + 1  # behind the geometry, for numbers that a drive has not
        self._size = size

        def place(found: int | None, blank: int) -> int:
            return blank if found is None else found

        self._offset = np.array([drive.offset for drive in drives])
        self._backlash = np.array([place(drive.backlash, zero) for drive in drives])
        self._stretch = np.array([place(drive.stretch, zero) for drive in drives])
        self._base = np.array(
            [
                [d.gain, place(d.quadratic, zero), place(d.spool, one), place(d.buildup, zero)]
                for d in drives
            ]
        )
        waves = [(d, *each) for d, drive in enumerate(drives) for each in drive.harmonics]
        self._wave_drive = [d for d, _, _, _ in waves]
        self._wave_k = np.array([k for _, k, _, _ in waves])
        self._wave = np.array([(a, b) for _, _, a, b in waves], dtype=np.intp).reshape(-1, 2)
        self._tabled = [d for d, drive in enumerate(drives) if drive.table is not None]
        self._corrected = [d for d, drive in enumerate(drives) if drive.corrected]
        self._of_one: dict[int, Laws] = {}
        self._spans: tuple[bytes, FloatArray] | None = None
        self._of_place: dict[int, tuple[int, str, int]] = {}
        for d, drive in enumerate(drives):
            for kind in ("offset", "gain", "quadratic", "spool", "buildup", "backlash", "stretch"):
                if (found := getattr(drive, kind)) is not None:
                    self._of_place[found] = (d, kind, 0)
            for j, (_, a, b) in enumerate(drive.harmonics):
                self._of_place |= {a: (d, "cos", j), b: (d, "sin", j)}
            self._of_place |= {p: (d, "table", j) for j, p in enumerate(drive.corrections)}

    def drive_of(self, column: int) -> int:
        """The drive whose law has the number at a place of the flattened geometry, or -1."""
        return self._of_place.get(column, (-1, "", 0))[0]

    def ways(
        self,
        slots: FloatArray,
        q: FloatArray,
        approach: FloatArray | None = None,
        tension: FloatArray | None = None,
    ) -> Ways:
        """Ways at readings q (N, n).

        `slots` is one geometry, or one per row (N, ...). Of each drive (N, drives) or (drives,):
        `approach`, the direction that it comes from, +1 upwards, -1 downwards, 0 unknown, and
        `tension`, N.
        """
        numbers = self._numbers(slots)
        at = q[:, self.actuator]
        x = np.empty((*at.shape, 5))
        x[..., 0], x[..., 1:] = at, numbers[:, self._base]
        way, by_x, bend = rows("law_drive", x.reshape(-1, 5))
        found = Ways(
            way.reshape(at.shape) + numbers[:, self._offset],
            by_x[:, 0].reshape(at.shape).copy(),
            bend.reshape(at.shape),
        )
        if self._corrected:
            self._correct(found, numbers, at)
        if approach is not None:
            found.way[...] -= 0.5 * approach * numbers[:, self._backlash]
        if tension is None:
            return found
        longer = self._longer(numbers, tension)
        return Ways(found.way * longer, found.slope * longer, found.bend * longer)

    def by_number(
        self,
        slots: FloatArray,
        q: FloatArray,
        columns: Sequence[int],
        approach: FloatArray | None = None,
        tension: FloatArray | None = None,
    ) -> FloatArray:
        """Derivative of ways by numbers of the laws at `columns`, each of its drive: (N, columns).

        `slots` is one geometry.
        """
        numbers = self._numbers(slots)
        at = q[:, self.actuator]
        out = np.empty((len(q), len(columns)))
        base = {"gain": 1, "quadratic": 2, "spool": 3, "buildup": 4}
        for i, column in enumerate(columns):
            d, kind, j = self._of_place[column]
            if kind == "offset":
                out[:, i] = 1.0
            elif kind == "backlash":
                out[:, i] = 0.0 if approach is None else -0.5 * np.atleast_2d(approach)[:, d]
            elif kind == "stretch":
                out[:, i] = 0.0
                if tension is not None:
                    way = self.ways(slots, q, approach).way[:, d]
                    out[:, i] = way * np.atleast_2d(tension)[:, d]
            elif kind in base:
                x = np.empty((len(q), 5))
                x[:, 0], x[:, 1:] = at[:, d], numbers[:, self._base[d]]
                out[:, i] = rows("law_drive", x)[1][:, base[kind]]
            elif kind == "table":
                segment, _, by_x = self._segments(numbers, at[:, d], d)
                out[:, i] = np.where(segment == j, by_x[:, 1], 0.0)
                out[:, i] += np.where(segment + 1 == j, by_x[:, 2], 0.0)
            else:
                k, *_ = self.drives[d].harmonics[j]
                x = np.column_stack([at[:, d], np.full(len(q), k), np.zeros((len(q), 2))])
                out[:, i] = rows("law_harmonic", x)[1][:, 1 if kind == "cos" else 2]
            if tension is not None and kind != "stretch":
                out[:, i] *= self._longer(numbers, tension)[:, d]
        return out

    def by_tension(
        self, slots: FloatArray, way: FloatArray, tension: FloatArray | None
    ) -> FloatArray:
        """Derivative of ways (N, drives) by their tensions, (N, drives)."""
        numbers = self._numbers(slots)
        unpulled = way if tension is None else way / self._longer(numbers, tension)
        return np.asarray(unpulled * numbers[:, self._stretch])

    def _longer(self, numbers: FloatArray, tension: FloatArray) -> FloatArray:
        """Return the factor by which a tension lengthens the ways."""
        longer: FloatArray = 1.0 + tension * numbers[:, self._stretch]
        return longer

    def readings(
        self,
        slots: FloatArray,
        way: FloatArray,
        approach: FloatArray | None = None,
        tension: FloatArray | None = None,
    ) -> FloatArray:
        """The readings (N, drives) at which drives have gone their ways (N, drives).

        `slots` is one geometry. NaN where there is none, or where a law is not known to be
        monotone.
        """
        numbers = self._numbers(slots)
        if tension is not None:
            way = way / self._longer(numbers, tension)
        rest = way - numbers[:, self._offset]
        if approach is not None:
            rest = rest + 0.5 * approach * numbers[:, self._backlash]
        q = self._uncorrected(numbers, rest, slice(None))
        if self._corrected:
            spans = self.spans(slots)
            for d in self._corrected:
                q[:, d] = self._newton(numbers, rest[:, d], d, spans[d])
        return q

    def returns(self, slots: FloatArray, d: int, turn: float) -> bool:
        """Return whether a law of an angle repeats after a turn of the reading."""
        drive, numbers = self.drives[d], self._numbers(slots)[0]
        if not np.isfinite(turn) or numbers[self._base[d, [1, 3]]].any():
            return False
        waves = [k for k, *places in drive.harmonics if numbers[places].any()]
        periods = np.array(waves) * turn / (2.0 * np.pi)
        whole = np.abs(periods - np.rint(periods)) <= _PERIOD
        return bool(whole.all()) and not numbers[list(drive.corrections)].any()

    def numbers_of(self, slots: FloatArray) -> list[LawNumbers]:
        """The numbers of each drive of one geometry."""
        numbers, found = self._numbers(slots), []
        for d, (drive, span) in enumerate(
            zip(self.drives, self.spans(slots).tolist(), strict=True)
        ):
            flat = numbers[0].tolist()
            table = [] if drive.table is None else drive.table.tolist()
            found.append(
                LawNumbers(
                    (flat[drive.offset], *numbers[0, self._base[d]].tolist()),
                    [(k, flat[a], flat[b]) for k, a, b in drive.harmonics],
                    list(zip(table, (flat[p] for p in drive.corrections), strict=True)),
                    self._most(numbers, d),
                    (span[0], span[1]),
                )
            )
        return found

    # where laws are monotone ----------------------------------------------------------------------

    def spans(self, slots: FloatArray) -> FloatArray:
        """Between which readings each law is monotone for certain, (drives, 2); NaN: nowhere.

        Without corrections a law is so up to its turning point, where its inverse ends by itself.
        """
        key = slots.tobytes()
        if self._spans is None or self._spans[0] != key:
            numbers = self._numbers(slots)
            found = np.array([self._span(numbers, d) for d in range(len(self.drives))])
            self._spans = (key, found)
        return self._spans[1]

    def doubts(self, slots: FloatArray) -> dict[int, str]:
        """Name the drives without an inverse over their stroke, and the reasons."""
        found: dict[int, str] = {}
        numbers = self._numbers(slots)
        spans = self.spans(slots)
        for d, drive in enumerate(self.drives):
            if not np.isfinite(numbers[0, self._base[d]]).all() or not numbers[0, drive.gain]:
                found[d] = "its gain must not be 0"
            elif np.isnan(spans[d]).any() and drive.stroke is None:
                found[d] = (
                    "its corrections may turn it back: state a stroke, over which the law rises"
                    " or falls throughout"
                )
            elif np.isnan(spans[d]).any():
                low, high = drive.stroke or (0.0, 0.0)
                found[d] = f"it turns back within its stroke, {low:.6g} to {high:.6g}"
        return found

    def _span(self, numbers: FloatArray, d: int) -> tuple[float, float]:
        drive = self.drives[d]
        gain, quadratic, radius, buildup = numbers[0, self._base[d]].tolist()
        k = np.array([each[0] for each in drive.harmonics])
        size = np.array([np.hypot(*numbers[0, list(each[1:])]) for each in drive.harmonics])
        steepest = float(np.abs(k) @ size)
        slopes = np.zeros(1)
        most = float(size.sum())
        if drive.table is not None:
            values = numbers[0, list(drive.corrections)]
            slopes = np.append(slopes, np.diff(values) / np.diff(drive.table))
            most += float(np.abs(values).max())
        sign = np.sign(gain * radius)
        least = abs(gain * radius) - steepest + min(0.0, float((sign * slopes).min()))
        if quadratic == 0.0 and buildup == 0.0 and least > 0.0:
            return -np.inf, np.inf
        if drive.stroke is None:
            return (-np.inf, np.inf) if not drive.corrected else (np.nan, np.nan)
        wanted = self._ends(numbers, d, 0.0, most)
        if np.isnan(wanted).any() or not drive.corrected:
            return (np.nan, np.nan) if np.isnan(wanted).any() else (-np.inf, np.inf)
        room = max(drive.stroke[1] - drive.stroke[0], np.pi if drive.angle else 0.0)
        beyond = self._ends(numbers, d, room, most)  # as far as it goes on
        low, high = float(np.fmin(wanted[0], beyond[0])), float(np.fmax(wanted[1], beyond[1]))
        places = np.union1d(np.linspace(low, high, _CELLS + 1), wanted)
        if drive.table is not None:
            inside = drive.table[(drive.table > low) & (drive.table < high)]
            places = np.union1d(places, inside)
        middle = 0.5 * (places[1:] + places[:-1])
        slope = self._alone(d).ways(numbers[:, :-2], middle[:, None]).slope[:, 0]
        turn = np.abs([gain + 2.0 * quadratic * each for each in (low, high)]).max()
        wound = [radius + 0.5 * buildup * (gain + quadratic * e) * e for e in (low, high)]
        bend = 0.5 * abs(buildup) * turn**2 + 2.0 * abs(quadratic) * np.abs(wound).max()
        bend += float(k**2 @ size)
        turns = np.flatnonzero(~(sign * slope - 0.5 * bend * np.diff(places) > 0.0))
        before, behind = turns[middle[turns] < wanted[0]], turns[middle[turns] > wanted[1]]
        if len(before) + len(behind) < len(turns):
            return np.nan, np.nan
        first = 0 if not before.size else int(before[-1]) + 1
        last = len(middle) if not behind.size else int(behind[0])
        return float(places[first]), float(places[last])

    def _ends(self, numbers: FloatArray, d: int, room: float, most: float) -> FloatArray:
        """Readings (2,) at the ends of a drive's stroke and of `room` beyond, whatever corrections.

        NaN beyond a turning point.
        """
        low, high = self.drives[d].stroke or (0.0, 0.0)
        rest = np.array([[low - room - most], [high + room + most]]) - numbers[0, self._offset[d]]
        return np.sort(self._uncorrected(numbers, rest, [d])[:, 0])

    # ----------------------------------------------------------------------------------------------

    def _alone(self, d: int) -> Laws:
        """Return the laws of one drive alone."""
        if d not in self._of_one:
            self._of_one[d] = Laws([replace(self.drives[d], actuator=0)], self._size)
        return self._of_one[d]

    def _numbers(self, slots: FloatArray) -> FloatArray:
        """Geometries flattened, (1 or N, size + 2), with a 0 and a 1 behind."""
        flat = slots.reshape(-1, self._size)
        return np.concatenate([flat, np.tile([0.0, 1.0], (len(flat), 1))], axis=1)

    def _correct(self, found: Ways, numbers: FloatArray, at: FloatArray) -> None:
        """Add harmonics and tables at readings (N, drives)."""
        if self._wave_drive:
            x = np.empty((len(at), len(self._wave_drive), 4))
            x[..., 0], x[..., 1] = at[:, self._wave_drive], self._wave_k
            x[..., 2:] = numbers[:, self._wave]
            error, by_x, bend = rows("law_harmonic", x.reshape(-1, 4))
            shape = x.shape[:2]
            for j, d in enumerate(self._wave_drive):
                found.way[:, d] += error.reshape(shape)[:, j]
                found.slope[:, d] += by_x[:, 0].reshape(shape)[:, j]
                found.bend[:, d] += bend.reshape(shape)[:, j]
        for d in self._tabled:
            _, error, by_x = self._segments(numbers, at[:, d], d)
            found.way[:, d] += error
            found.slope[:, d] += by_x[:, 0]

    def _segments(
        self, numbers: FloatArray, at: FloatArray, d: int
    ) -> tuple[IntArray, FloatArray, FloatArray]:
        """In which segment of a drive's table readings (N,) are, its correction and derivatives."""
        table, places = self.drives[d].table, np.array(self.drives[d].corrections)
        assert table is not None
        segment = np.clip(np.searchsorted(table, at, side="right") - 1, 0, len(table) - 2)
        x = np.empty((len(at), 5))
        x[:, 0] = np.clip(at, table[0], table[-1])  # beyond its ends it stays
        x[:, 1], x[:, 2] = table[segment], table[segment + 1]
        row = np.arange(len(numbers)) if len(numbers) > 1 else 0
        x[:, 3], x[:, 4] = numbers[row, places[segment]], numbers[row, places[segment + 1]]
        error, by_x = rows("law_segment", x)
        by_x[(at < table[0]) | (at > table[-1]), 0] = 0.0
        return segment, error, by_x

    def _uncorrected(
        self, numbers: FloatArray, way: FloatArray, of: slice | list[int]
    ) -> FloatArray:
        """The readings at ways (N, drives) less their offset, without corrections."""
        x = np.empty((*way.shape, 5))
        x[..., 0], x[..., 1:] = way, numbers[:, self._base[of]]
        found: FloatArray = rows("law_drive_inverse", x.reshape(-1, 5))[0].reshape(way.shape)
        return found

    def reading(
        self, slots: FloatArray, way: FloatArray, d: int, approach: FloatArray | None = None
    ) -> FloatArray:
        """`readings` (N,) of one drive at its ways (N,)."""
        numbers = self._numbers(slots)
        rest = way - numbers[:, self._offset[d]]
        if approach is not None:
            rest = rest + 0.5 * approach[..., d] * numbers[:, self._backlash[d]]
        if self.drives[d].corrected:
            return self._newton(numbers, rest, d, self.spans(slots)[d])
        q: FloatArray = self._uncorrected(numbers, rest[:, None], [d])[:, 0]
        return q

    def _most(self, numbers: FloatArray, d: int) -> float:
        """Return a bound of the corrections of a drive."""
        drive = self.drives[d]
        values = numbers[0, [p for _, a, b in drive.harmonics for p in (a, b)]]
        most = float(np.abs(values).sum())
        if drive.table is not None:
            most += float(np.abs(numbers[0, list(drive.corrections)]).max())
        return most

    def _newton(self, numbers: FloatArray, way: FloatArray, d: int, span: FloatArray) -> FloatArray:
        """The readings of a drive with corrections, within brackets that Newton's method keeps."""
        drive = self.drives[d]
        if np.isnan(span).any():
            return np.full(len(way), np.nan)
        most = self._most(numbers, d)
        ends = [self._uncorrected(numbers, way[:, None] + e, [d])[:, 0] for e in (-most, most)]
        rising = numbers[0, drive.gain] * numbers[0, self._base[d, 2]] > 0.0
        low, high = ends if rising else ends[::-1]
        if np.isfinite(span).all():  # beyond a turning point the proof ends
            low = np.where(np.isnan(low), span[0], np.maximum(low, span[0]))
            high = np.where(np.isnan(high), span[1], np.minimum(high, span[1]))
        q: FloatArray = 0.5 * (low + high)
        offset, sign = numbers[0, drive.offset], 1.0 if rising else -1.0
        scale = np.abs(way) + most + abs(offset)
        done, over = np.zeros((2, len(q)), dtype=bool)
        alone = self._alone(d)
        for _ in range(MOST_STEPS):
            found = alone.ways(numbers[:, :-2], q[:, None])
            off = found.way[:, 0] - offset - way
            low, high = np.where(sign * off < 0.0, q, low), np.where(sign * off > 0.0, q, high)
            with np.errstate(divide="ignore", invalid="ignore"):
                step = q - off / found.slope[:, 0]
            inside = (step >= low) & (step <= high)
            last = done  # one more step, and none that another row needs
            done = np.where(over, done, np.abs(off) <= ROUNDING * scale)
            moved = np.where(inside, step, np.where(done, q, 0.5 * (low + high)))
            ended = ~done & (moved == q)  # a bracket without a reading: it stays so
            q, over = np.where(over, q, moved), over | last | ended
            if (over | ~np.isfinite(q)).all():
                break
        q[~done | (q < span[0]) | (q > span[1])] = np.nan
        return q
