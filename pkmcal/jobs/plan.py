"""A plan of poses as options and tables say it; what makes it is in `planning`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from pkmcal.jobs.machine import in_folder, machine_of_table, machine_table
from pkmcal.jobs.stated import PathText, Refuse, Stated, below, command, of, refused


@dataclass(frozen=True)
class Planning(Stated):
    """A plan of poses: a machine, and what the options of `pkmcal plan` say.

    Examples
    --------
    >>> job = Planning("hexapod", kind="pose", count=20)
    >>> " ".join(job.argv())
    'pkmcal plan hexapod --count 20 --kind pose'
    >>> Planning.of_table(job.table()) == job
    True
    """

    OWNER = "[plan]"

    robot: str = field(default="", metadata={"argument": True})
    count: int | None = None
    accuracy: float | None = None
    poses: PathText | None = None
    targets: PathText | None = None
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

    def argv(self) -> list[str]:
        """The command line that says the same, without what is written."""
        return command("plan", [self.robot], self.options())

    def table(self) -> dict[str, Any]:
        """Tables of a project file: machine and plan."""
        found = {"machine": machine_table(self.robot), "plan": super().table()}
        return {name: table for name, table in found.items() if table}

    @classmethod
    def of_table(cls, table: Mapping[str, Any], refuse: Refuse | None = None) -> Planning:
        """What the tables machine and plan say; others are not looked at.

        Raises
        ------
        ValueError
            An unknown key, or a value that is none of this key.
        """
        refuse = refuse or refused
        robot = machine_of_table(*of(table, "machine", refuse))
        return cls(robot, **cls.values_of_table(*of(table, "plan", refuse)))

    def in_folder(self, folder: str) -> Planning:
        """The same with its relative paths below a folder: those of a project file."""
        found = replace(super().in_folder(folder), robot=in_folder(self.robot, folder))
        if self.board is None or not self.board.lower().endswith(".csv"):
            return found
        return replace(found, board=below(folder, self.board))
