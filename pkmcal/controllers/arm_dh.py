"""Denavit–Hartenberg numbers of an arm as a table, and as the deltas of Universal Robots."""

from __future__ import annotations

from os import PathLike

import numpy as np

from pkmcal.arguments import instance
from pkmcal.arguments import path as as_path
from pkmcal.arms.arm import SerialArm
from pkmcal.arms.denavit_hartenberg import Convention, DHTable, Parallel
from pkmcal.arrays import FloatArray
from pkmcal.controllers.loss import require_plain
from pkmcal.exceptions import ArgumentError
from pkmcal.files.atomic import write_whole
from pkmcal.files.csv_writer import write_csv

_UR_JOINTS = 6
_MOVED = 1e-6  # mm and rad: what a frame may differ by and still be the same
_ORDER = {  # and with Hayati's parameter
    "standard": ("Rz(theta) Tz(d) Tx(a) Rx(alpha)", "Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta)"),
    "modified": ("Rx(alpha) Tx(a) Rz(theta) Tz(d)", "Rx(alpha) Tx(a) Ry(beta) Rz(theta) Tz(d)"),
}


def dh(
    arm: SerialArm,
    path: str | PathLike[str],
    convention: Convention = "standard",
    parallel: Parallel = "hayati",
) -> DHTable:
    """Write the Denavit–Hartenberg numbers of an arm as a CSV file.

    Parameters
    ----------
    arm : SerialArm
        Its joint errors are built in.
    path : str or path
        Where to write; complete or untouched.
    convention : {"standard", "modified"}
        As in `SerialArm.from_dh`.
    parallel : {"hayati", "normal"}
        As in `SerialArm.dh`: where some axes are nearly parallel, a column beta, or a and d that
        are large and cancel.

    Returns
    -------
    DHTable
        What was written: a row a joint, in mm and deg; base and tool in comments.
    """
    require_plain(instance("arm", arm, SerialArm), "a table of Denavit-Hartenberg numbers")
    table = arm.dh(convention, parallel)
    leaning = table.beta is not None and bool(table.beta.any())
    names = arm.joint_names or tuple(str(i + 1) for i in range(arm.n_joints))
    followed = "".join(
        f"# joint {names[joint - 1]} moves by {by!r} times joint {names[leader - 1]}"
        + (", mm or rad\n" if arm.kinds[joint - 1] != arm.kinds[leader - 1] else "\n")
        for joint, leader, by in arm.followers.ratios
    )
    comment = (
        f"# {_line(arm.name)}: {convention} Denavit-Hartenberg numbers,"
        f" {_ORDER[convention][leaning]} a row\n"
        + _matrix("base, the first frame in it", table.base)
        + _matrix("tool, in the last frame", table.tool)
        + followed
    )
    degrees = np.degrees([table.alpha, table.theta])
    columns = [table.a, degrees[0], table.d, degrees[1]]
    heads = ["joint", "kind", "a [mm]", "alpha [deg]", "d [mm]", "theta [deg]"]
    if table.beta is not None and leaning:
        columns.append(np.degrees(table.beta))
        heads.append("beta [deg]")
    rows = (
        [name, arm.kinds[i], *(repr(float(column[i])) for column in columns)]
        for i, name in enumerate(names)
    )
    write_csv(as_path("path", path), heads, rows, comment=comment)
    return table


def modified_dh(arm: SerialArm, path: str | PathLike[str]) -> DHTable:
    """Write the numbers of the modified convention, as `dh` does."""
    return dh(arm, path, "modified")


def universal_robots(arm: SerialArm, path: str | PathLike[str]) -> DHTable:
    """Write the four lists of a Universal Robots ``calibration.conf``, in m and rad.

    They are what the calibrated Denavit–Hartenberg numbers differ by from those of the same arm
    without joint errors, which has to be the maker's nominal one. Checksums are the controller's
    own and are not written: replace the lists in a copy of the robot's file.

    Parameters
    ----------
    arm : SerialArm
        Six turning joints, calibrated.
    path : str or path
        Where to write; complete or untouched.

    Returns
    -------
    DHTable
        The calibrated numbers. Its base and tool take up what the lists cannot hold.

    Raises
    ------
    ValueError
        Another arm, or one whose numbers are not of the form of these robots.
    """
    require_plain(instance("arm", arm, SerialArm), "a calibration.conf")
    if arm.kinds != ("revolute",) * _UR_JOINTS or arm.followers:
        raise ArgumentError(f"{arm.name}: these robots have six turning joints")
    nominal, real = arm.replace(np.zeros((_UR_JOINTS, 6))).dh(), arm.dh()
    if np.abs(nominal.theta).max() > _MOVED:
        raise ArgumentError(
            f"{arm.name}: the offsets theta of these robots are 0, found"
            f" {np.degrees(nominal.theta).round(4).tolist()} deg: export the calibrated robot.toml,"
            " which has the nominal numbers and the errors apart"
        )
    lists = {
        "delta_theta": _turned(real.theta - nominal.theta),
        "delta_a": (real.a - nominal.a) / 1000.0,
        "delta_d": (real.d - nominal.d) / 1000.0,
        "delta_alpha": _turned(real.alpha - nominal.alpha),
    }
    text = f"# {_line(arm.name)}\n"
    for what, mine, theirs in (
        ("base", real.base, nominal.base),
        ("tool", real.tool, nominal.tool),
    ):
        change = np.linalg.inv(theirs) @ mine
        if np.abs(change - np.eye(4)).max() > _MOVED:
            text += _matrix(f"not in these lists: the {what} frame moves by", change)
    text += "[mounting]\n"
    for name, values in lists.items():
        text += f"{name} = [ {', '.join(repr(float(v)) for v in values)}]\n"
    write_whole(as_path("path", path), text)
    return real


def _turned(angles: FloatArray) -> FloatArray:
    """Angles within ±180°."""
    within: FloatArray = (angles + np.pi) % (2.0 * np.pi) - np.pi
    return within


def _matrix(what: str, motion: FloatArray) -> str:
    rows = "".join("#   " + "  ".join(f"{v:.9g}" for v in row) + "\n" for row in motion[:3] + 0.0)
    return f"# {what} [mm]:\n{rows}"


def _line(name: str) -> str:
    return "".join(c if c.isprintable() else " " for c in name)
