"""Every target by its name: those of the package, one entry each, and those of others.

A package of others names its targets in its ``pyproject.toml``, in the group `GROUP`.
"""

from __future__ import annotations

import warnings
from functools import cache
from importlib.metadata import entry_points

from pkmcal.arguments import instance
from pkmcal.controllers.target import Target
from pkmcal.exceptions import ArgumentError, CalibrationWarning

GROUP = "pkmcal.targets"
_HERE = "pkmcal.controllers."

_PACKAGE = (
    Target(
        "c",
        _HERE + "c_header:c_header",
        "a C99 header with its inverse and forward kinematics and Jacobian",
        label="C header",
        file="machine.h",
    ),
    Target(
        "klipper",
        _HERE + "klipper:klipper",
        "the numbers of a linear or rotary delta for Klipper or Kalico",
        label="Klipper, Kalico",
        tried=True,
    ),
    Target(
        "reprap",
        _HERE + "delta_gcode:reprap",
        "M665 and M666 of a linear delta, M669 and M666 of a rotary one, for RepRapFirmware",
        label="RepRapFirmware",
        tried=True,
    ),
    Target(
        "marlin",
        _HERE + "delta_gcode:marlin",
        "M665, M666 and M851 of a linear delta, for Marlin",
        label="Marlin",
        tried=True,
    ),
    Target(
        "hangprinter",
        _HERE + "hangprinter:hangprinter",
        "M669 and M666 of a Hangprinter, for RepRapFirmware",
        label="Hangprinter",
        tried=True,
    ),
    Target(
        "maslow",
        _HERE + "maslow:maslow",
        "the anchors of a maslow.yaml, for FluidNC",
        label="Maslow",
        tried=True,
    ),
    Target(
        "linuxcnc",
        _HERE + "linuxcnc:linuxcnc",
        "a folder with a kinematics component for LinuxCNC and a simulation that runs it",
        label="LinuxCNC",
        file="linuxcnc",
        folder=True,
        said="LinuxCNC's own module for it is ",
    ),
    Target("mjcf", _HERE + "mjcf:mjcf", "a model for MuJoCo", label="MuJoCo", file="machine.xml"),
    Target("fmu", _HERE + "fmu:fmu", "an FMU for co-simulation", label="FMU", file="machine.fmu"),
    Target(
        "urdf",
        _HERE + "urdf:urdf",
        "a tree of links",
        takes="arm",
        label="URDF",
        file="machine.urdf",
    ),
    Target(
        "sdf", _HERE + "sdf:sdf", "an SDFormat model", takes="arm", label="SDF", file="machine.sdf"
    ),
    Target(
        "dh",
        _HERE + "arm_dh:dh",
        "a table of Denavit-Hartenberg numbers",
        takes="arm",
        label="Denavit–Hartenberg table",
    ),
    Target(
        "dh-modified",
        _HERE + "arm_dh:modified_dh",
        "that table in the modified convention",
        takes="arm",
        label="modified Denavit–Hartenberg table",
    ),
    Target(
        "ur",
        _HERE + "arm_dh:universal_robots",
        "the lists of a calibration.conf of Universal Robots",
        takes="arm",
        label="Universal Robots",
    ),
)
_OWN = {each.name: each for each in _PACKAGE}
_REGISTERED: dict[str, Target] = {}


def register(target: Target) -> None:
    """Make a target known to the command line, to projects and to the window, in this process.

    One that was registered by the same name is replaced. To make it known wherever your package is
    installed, name it in the ``pyproject.toml`` of that::

        [project.entry-points."pkmcal.targets"]
        names = "my_package.names:TARGET"

    Parameters
    ----------
    target : Target
        With a name that no target of pkmcal has.

    Raises
    ------
    ValueError
        A target of pkmcal has this name.

    Examples
    --------
    >>> import pkmcal as pk
    >>> def names(robot, path):
    ...     path.write_text(" ".join(robot.geometry.names))
    >>> pk.export.register(pk.export.Target("names", names, "the names of its numbers"))
    >>> pk.export.targets()["names"].about
    'the names of its numbers'
    """
    if instance("target", target, Target).name in _OWN:
        raise ArgumentError(f"target: pkmcal has a target {target.name}; name yours otherwise")
    _REGISTERED[target.name] = target


def targets() -> dict[str, Target]:
    """Return every target by its name: pkmcal's, those of installed packages, registered ones."""
    return {**_installed(), **_OWN, **_REGISTERED}


@cache
def _installed() -> dict[str, Target]:
    """Targets of other packages; of one that cannot be had a warning says why."""
    found = {}
    for entry in entry_points(group=GROUP):
        why = f"pkmcal has a target {entry.name}" if entry.name in _OWN else ""
        try:
            target = entry.load()
        except Exception as error:  # whatever a package of others raises
            why = f"{type(error).__name__}: {error}"
        else:
            if not isinstance(target, Target) or target.name != entry.name:
                why = why or f"{entry.value} is no Target of this name"
        if why:
            text = f"the target {entry.name} of an installed package is left out: {why}"
            warnings.warn(text, CalibrationWarning, stacklevel=3)
        else:
            found[entry.name] = target
    return found
