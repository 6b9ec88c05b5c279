"""The load on the platform of a machine that yields, and on its tool."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pkmcal.arrays import FloatArray, as_numbers
from pkmcal.exceptions import ArgumentError

CARRIED = (
    "mass", *(f"{of}.{axis}" for of in ("centre", "force", "moment") for axis in "xyz"),
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Load:
    """A load on a machine that yields, in place of the payload that its file states.

    Each may be one for all rows of a call, or have the leading shape of its rows.

    Attributes
    ----------
    mass : array_like (...)
        kg.
    centre : array_like (..., 3)
        Its centre of mass in the frame of the tool, mm.
    force : array_like (..., 3)
        What pulls at the origin of the tool, N, in the axes of the base.
    moment : array_like (..., 3)
        N mm, in the axes of the base.

    Raises
    ------
    ValueError, TypeError
        A wrong shape, numbers that are not finite, a mass below 0.

    Examples
    --------
    >>> import pkmcal as pk
    >>> pk.Load(mass=5, centre=(0, 0, 60)).rows(()).tolist()
    [5.0, 0.0, 0.0, 60.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    """

    mass: ArrayLike = 0.0
    centre: ArrayLike = (0.0, 0.0, 0.0)
    force: ArrayLike = (0.0, 0.0, 0.0)
    moment: ArrayLike = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        self.rows(None)

    @classmethod
    def of_rows(cls, rows: FloatArray) -> Load:
        """The load of numbers (..., 10) in the order of `CARRIED`."""
        return cls(rows[..., 0], rows[..., 1:4], rows[..., 4:7], rows[..., 7:10])

    @classmethod
    def stated(cls, numbers: Mapping[str, float]) -> Load:
        """The payload among the numbers of a geometry; nothing where none is stated."""
        return cls.of_rows(np.array([numbers.get(f"payload.{name}", 0.0) for name in CARRIED]))

    def rows(self, shape: tuple[int, ...] | None) -> FloatArray:
        """The numbers in the order of `CARRIED`, (10,), or (N, 10) for a batch of this shape.

        None takes the shape that the load itself has.
        """
        parts = [as_numbers("mass of the load", self.mass, "")[..., None].astype(np.float64)]
        for name in ("centre", "force", "moment"):
            given = as_numbers(f"{name} of the load", getattr(self, name), 3).astype(np.float64)
            if given.shape[-1:] != (3,):
                raise ArgumentError(
                    f"{name} of the load must have shape (..., 3), found {given.shape}"
                )
            parts.append(given)
        if not all(np.isfinite(part).all() for part in parts):
            raise ArgumentError("the load must be finite")
        if (parts[0] < 0.0).any():
            raise ArgumentError(f"mass of the load must not be negative, found {parts[0].min():g}")
        try:
            own = np.broadcast_shapes(*(part.shape[:-1] for part in parts))
            wanted = own if shape is None or own == () else np.broadcast_shapes(own, shape)
        except ValueError:
            wanted = None
        if wanted is None or (shape is not None and own != () and wanted != shape):
            found = ", ".join(str(part.shape[:-1]) for part in parts)
            raise ArgumentError(
                f"load: mass, centre, force and moment are batches {found}, which do not go with"
                f" one another or with a call of {shape} rows"
            )
        each = [np.broadcast_to(part, (*wanted, part.shape[-1])) for part in parts]
        whole: FloatArray = np.concatenate(each, axis=-1)
        return whole if wanted == () else whole.reshape(-1, len(CARRIED))
