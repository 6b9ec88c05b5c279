"""A plan of poses as options and tables say it; what makes it is in `planning`."""

from __future__ import annotations

from dataclasses import dataclass, replace

from pkmcal.jobs.machine import OfMachine
from pkmcal.jobs.reading import is_file
from pkmcal.jobs.stated import PathText, below, command

GCODE = ("klipper", "reprap", "marlin", "linuxcnc")  # firmwares that a plan is written for


@dataclass(frozen=True)
class Planning(OfMachine):
    """A plan of poses: a machine, and what the options of `pkmcal plan` say.

    Examples
    --------
    >>> job = Planning("hexapod", kind="pose", count=20)
    >>> " ".join(job.argv())
    'pkmcal plan hexapod --count 20 --kind pose'
    >>> Planning.of_table(job.table()) == job
    True
    """

    OWNER, TABLE = "[plan]", "plan"

    count: int | None = None
    accuracy: float | None = None
    poses: PathText | None = None
    targets: PathText | None = None
    direction: str | None = None
    measured: PathText | None = None
    criterion: str = "prediction"
    kind: str = "position"
    target: tuple[str, ...] = ()
    noise: str = "0.02"
    actuator_noise: float | None = None
    travel_weight: float = 0.0
    payloads: str | None = None
    effects: tuple[str, ...] = ()
    compliance: tuple[str, ...] = ()
    camera: PathText | None = None
    camera_on: str = "base"
    board: str | None = None
    camera_at: str | None = None
    look_at: str | None = None
    free: tuple[str, ...] = ()
    prior: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()
    within: tuple[str, ...] = ()
    seed: int = 0
    gcode: str | None = None
    dwell: float = 5.0
    safe_height: float | None = None

    def argv(self) -> list[str]:
        """Command line of the job, without what is written."""
        return command("plan", [self.robot], self.options())

    def in_folder(self, folder: str) -> Planning:
        """Return the job with its relative paths, those of a project file, below a folder."""
        found = super().in_folder(folder)
        board = self.board
        if board is None or not is_file(board):
            return found
        return replace(found, board=below(folder, board))
