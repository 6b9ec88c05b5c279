"""The machine of a job: a built-in one by its name, or a robot file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib import resources
from typing import Any, ClassVar, TypeVar

from pkmcal.jobs.stated import Refuse, Stated, below, of, refused

M = TypeVar("M", bound="OfMachine")


@dataclass(frozen=True)
class OfMachine(Stated):
    """A job of a machine that has a table of its own in a project file, `TABLE`."""

    TABLE: ClassVar[str] = ""

    robot: str = field(default="", metadata={"argument": True})

    def table(self) -> dict[str, Any]:
        """Tables of a project file: the machine's, and that of the job."""
        found = {"machine": machine_table(self.robot), self.TABLE: super().table()}
        return {name: table for name, table in found.items() if table}

    @classmethod
    def of_table(cls: type[M], table: Mapping[str, Any], refuse: Refuse | None = None) -> M:
        """Read the table machine and the table of this job; others are not looked at.

        Raises
        ------
        ValueError
            An unknown key, or a value that is none of this key.
        """
        refuse = refuse or refused
        robot = machine_of_table(*of(table, "machine", refuse))
        return cls(robot, **cls.values_of_table(*of(table, cls.TABLE, refuse)))

    def in_folder(self: M, folder: str) -> M:
        """Return the job with its relative paths, those of a project file, below a folder."""
        return replace(super().in_folder(folder), robot=in_folder(self.robot, folder))


def machine_table(robot: str) -> dict[str, str]:
    """The table of a machine: the built-in one of this name, or a file."""
    return {"builtin" if is_built_in(robot) else "file": robot} if robot else {}


def machine_of_table(table: Mapping[str, Any], refuse: Refuse) -> str:
    """Read the table of a machine: a built-in machine's name, a file, or nothing."""
    for key, value in table.items():
        if key not in ("builtin", "file"):
            refuse(key, f"unknown key {key!r} of [machine]; it has builtin or file")
        if not isinstance(value, str) or not value:
            refuse(key, f"must be a text, found {value!r}")
        if len(table) > 1:
            refuse(key, "a machine is built-in or a file, not both")
        if key == "builtin" and not is_built_in(value):
            refuse(key, f"{value!r} is no built-in machine")
    return next(iter(table.values()), "")


def is_built_in(robot: str) -> bool:
    """Return whether this is the name of a built-in machine."""
    folders = resources.files("pkmcal") / "builtin"
    files = (folders / kind / f"{robot}.toml" for kind in ("machines", "arms"))
    return not {"/", "\\", "\0"} & set(robot) and any(file.is_file() for file in files)


def in_folder(robot: str, folder: str) -> str:
    """The machine, its file below a folder where it is relative."""
    return robot if not robot or is_built_in(robot) else below(folder, robot)
