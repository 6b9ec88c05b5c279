"""Orientations as files state them: angles of any order, rotation vectors, quaternions, matrices.

SciPy's `Rotation` converts them. What a file states in another convention than its headings say is
found by the machine: turned by its frame and its tool, no wrong convention fits several poses.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from pkmcal.arrays import FloatArray
from pkmcal.files.column_names import (
    ANGLES,
    EULER,
    MATRIX,
    NUMBERED,
    QUATERNION,
    VECTOR,
    orientation_in,
)
from pkmcal.files.csv_table import Table
from pkmcal.measurements.table_layout import ORDERS, OWN_ORDER, QUATERNIONS, ROTATIONS

_UNIT = 0.02  # by so much the length of a quaternion or of a row of a matrix may differ from 1
_ALIKE = 1.01  # of misfits that do not tell two conventions apart
_ROUNDED = 1e-9  # rad
_MOST = 3  # conventions that are named
_FITS = np.radians(3.0)  # what errors of a machine do not turn it by
_BETTER = 0.2  # of the misfit that another convention may leave to be named
_TURNED = ("--invert-poses", "without --invert-poses")  # where that was not asked for, or was
_ABSURD = np.radians(20.0)  # from which orientations are of another machine, or of other rows


def read(
    table: Table, rotation: str | None, nominal: FloatArray | None, inverts: bool = False
) -> FloatArray:
    """Angles α β γ (N, 3) of orientations in any other form.

    Parameters
    ----------
    table : Table
        With the columns of `orientation_in`.
    rotation : str or None
        How they are stated, where headings do not say.
    nominal : ndarray (N, 3) or None
        α β γ of the machine as it is described, NaN where it has no pose: tells conventions apart.
    inverts : bool
        Whether they will be turned round, as was asked for; `nominal` is turned round already.

    Raises
    ------
    ValueError
        The convention is not stated, or another one fits the machine; no unit quaternion.
    """
    names = orientation_in(table.columns)
    given = _numbers(table, names)
    forms = _forms(names, given)
    said = " ".join(repr(table.columns[name].name) for name in names)
    if rotation is None and len(forms) > 1:
        rotation = _told_by(table, said, forms, nominal, inverts)
    chosen = _chosen(table, said, forms, rotation)
    turns = forms[chosen]
    if nominal is not None:
        others = _inverted(chosen, turns, inverts) | _in_sequence(names, given)
        _refuse_wrong(table, said, chosen, forms | others, nominal)
    angles: FloatArray = turns.as_euler("xyz")
    return angles


def _numbers(table: Table, names: Sequence[str]) -> FloatArray:
    if names in (QUATERNION, NUMBERED, MATRIX):
        given = table.stacked(names, ["1"] * len(names))
        rows = given.reshape(len(given), -1, 3 if names == MATRIX else 4)
        off = np.abs(np.linalg.norm(rows, axis=2) - 1.0).max(axis=1)
        if (off > _UNIT).any():
            row = int(np.argmax(off > _UNIT))
            what = "a rotation matrix" if names == MATRIX else "a quaternion of length 1"
            raise table.cell_error(names[0], row, f"is not part of {what}")
        return given
    return table.stacked(names, ["rad"] * len(names))


def _forms(names: Sequence[str], given: FloatArray) -> dict[str, Rotation]:
    """Return possible meanings of the numbers, by name."""
    if names == QUATERNION:  # the headings say which is which
        return {"wxyz": Rotation.from_quat(given[:, [1, 2, 3, 0]])}
    if names == NUMBERED:
        return {
            "wxyz": Rotation.from_quat(given[:, [1, 2, 3, 0]]),
            "xyzw": Rotation.from_quat(given),
        }
    if names == MATRIX:
        return {"matrix": Rotation.from_matrix(given.reshape(-1, 3, 3))}
    if names == VECTOR:
        return {"rotvec": Rotation.from_rotvec(given)}
    forms = {}
    for order in ORDERS:
        angles = given
        if names in (EULER[0], ANGLES):  # Rx belongs to x, whichever is turned first
            if len(set(order.lower())) < 3:
                continue
            angles = given[:, ["xyz".index(axis) for axis in order.lower()]]
        forms[order] = Rotation.from_euler(order, angles)
    if names == EULER[0]:
        forms["rotvec"] = Rotation.from_rotvec(given)
    return forms


def _told_by(
    table: Table,
    said: str,
    forms: dict[str, Rotation],
    nominal: FloatArray | None,
    inverts: bool,
) -> str:
    """The one form that fits the machine, as words of an error: it is for the user to state."""
    what = "makers mean different angles by them"
    if set(forms) == set(QUATERNIONS):
        what = "makers begin or end with the scalar part"
    hint = f"state how with --rotation, such as {' or '.join(list(forms)[:2])}"
    if nominal is not None:
        off = {word: misfit(turns, nominal) for word, turns in forms.items()}
        best = min(off, key=lambda word: off[word])
        alike = [word for word in off if off[word] <= off[best] / _BETTER]
        if np.isfinite(off[best]) and off[best] < _FITS:
            if set(forms) == set(QUATERNIONS) and len(alike) == 1:
                table.notes.append(
                    f"columns {said} taken as {best}: off by {_deg(off[best])} from this machine,"
                    f" {_deg(max(off.values()))} in the other order"
                )
                return best
            listed = " and ".join(f"{word} ({_deg(off[word])})" for word in alike[:4])
            hint = f"this machine is fitted by {listed}: --rotation {alike[0]}"
            if len(alike) > 1:
                hint = f"this machine is fitted by {listed}: state which with --rotation"
        else:
            off = {word: misfit(turns.inv(), nominal) for word, turns in forms.items()}
            best = min(off, key=lambda word: off[word])
            if off[best] < _FITS:
                hint = (
                    f"this machine is fitted by {best} turned round ({_deg(off[best])}):"
                    f" --rotation {best} {_TURNED[inverts]}"
                )
    raise table.header_error(f"columns {said}: {what}; {hint}")


def _chosen(table: Table, said: str, forms: dict[str, Rotation], rotation: str | None) -> str:
    if rotation is None:
        return next(iter(forms))
    if rotation in forms:
        return rotation
    if len(forms) == 1 and rotation not in ROTATIONS:
        return next(iter(forms))  # the headings say more
    raise table.header_error(f"columns {said} are not {rotation!r}; expected {', '.join(forms)}")


def _inverted(chosen: str, turns: Rotation, inverts: bool) -> dict[str, Rotation]:
    """Other meanings that headings of orientations may have."""
    other = {f"{chosen} turned round ({_TURNED[inverts]})": turns.inv()}
    if chosen == "wxyz":
        other["xyzw"] = Rotation.from_quat(turns.as_quat()[:, [3, 0, 1, 2]])
    if chosen == "matrix":
        other["matrix by columns"] = turns.inv()
    return other


def _in_sequence(names: Sequence[str], given: FloatArray) -> dict[str, Rotation]:
    """Columns of x, y and z as the first, second and third angle of an order."""
    if names not in (EULER[0], ANGLES):
        return {}
    return {
        f"{order}, one after the other (columns A, B, C)": Rotation.from_euler(order, given)
        for order in ORDERS
        if order.lower() != OWN_ORDER
    }


def _refuse_wrong(
    table: Table, said: str, chosen: str, forms: dict[str, Rotation], nominal: FloatArray
) -> None:
    off = {word: misfit(turns, nominal) for word, turns in forms.items()}
    best = min(off, key=lambda word: off[word])
    if off[chosen] > _FITS and off[best] < min(_BETTER * off[chosen], _FITS):
        # xyzw read as wxyz is the inverse, up to a frame and a tool: what fits alike is named
        alike = [word for word in off if off[word] < _ALIKE * off[best] + _ROUNDED]
        alike = alike[:_MOST]
        raise table.header_error(
            f"columns {said}: off by {_deg(off[chosen])} from this machine as {chosen}, by"
            f" {_deg(off[best])} as {' or '.join(alike)}"
        )
    if off[chosen] > _ABSURD:
        raise table.header_error(
            f"columns {said}: off by {_deg(off[chosen])} from this machine as {chosen}, by"
            f" {_deg(off[best])} as {best}, which fits best: these orientations are of other rows"
            " or of another machine, or columns are exchanged"
        )


def misfit(turns: Rotation, nominal: FloatArray) -> float:
    """Return the misfit of orientations to the machine's, rad rms, up to a frame and a tool.

    M = F R T for every pose leaves, between two poses, rotation vectors that F alone turns.
    """
    known = np.isfinite(nominal).all(axis=1)
    if known.sum() < 3:
        return float("nan")
    seen, own = turns[known], Rotation.from_euler("xyz", nominal[known])
    mine = (seen * seen[0].inv()).as_rotvec()
    theirs = (own * own[0].inv()).as_rotvec()
    if np.abs(theirs).max() < _FITS:
        return float("nan")
    u, _, v = np.linalg.svd(mine.T @ theirs)
    turn = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ v))]) @ v
    apart = Rotation.from_rotvec(mine).inv() * Rotation.from_rotvec(theirs @ turn.T)
    return float(np.sqrt(np.mean(apart.magnitude() ** 2)))


def _deg(angle: float) -> str:
    return f"{np.degrees(angle):.2g} deg"
