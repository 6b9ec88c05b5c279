"""Configurations of controllers, read and written, as options and tables say it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pkmcal.jobs.machine import OfMachine
from pkmcal.jobs.stated import PathText, Refuse, Stated, command, of, refused


@dataclass(frozen=True)
class Importing(Stated):
    """A configuration that a robot file is made of: what the options of `pkmcal import` say.

    Examples
    --------
    >>> job = Importing("config.g", firmware="reprap")
    >>> " ".join(job.argv())
    'pkmcal import config.g --from reprap'
    >>> job.table()
    {'import': {'file': 'config.g', 'from': 'reprap'}}
    >>> Importing.of_table(job.table()) == job
    True
    """

    OWNER = "[import]"

    file: PathText = field(metadata={"argument": True})
    out: PathText = "."
    firmware: str | None = field(default=None, metadata={"option": "from"})
    log: PathText | None = None

    def argv(self) -> list[str]:
        """Command line of the job."""
        return command("import", [self.file], self.options())

    def table(self) -> dict[str, Any]:
        """A table of a project file: import."""
        return {"import": {"file": self.file, **super().table()}}

    @classmethod
    def of_table(cls, table: Mapping[str, Any], refuse: Refuse | None = None) -> Importing:
        """Read the table import; others are not looked at.

        Raises
        ------
        ValueError
            An unknown key, or a value that is none of this key.
        """
        stated, refuse = of(table, "import", refuse or refused)
        file = stated.get("file", "")
        if not isinstance(file, str) or not file:
            refuse("file", f"must be the file to import, found {file!r}")
        others = {key: value for key, value in stated.items() if key != "file"}
        return cls(file, **cls.values_of_table(others, refuse))


@dataclass(frozen=True)
class Exporting(OfMachine):
    """A machine that is written for a controller: what the options of `pkmcal export` say.

    Examples
    --------
    >>> job = Exporting("robot.toml", "klipper", "new.cfg", config="printer.cfg")
    >>> " ".join(job.argv())
    'pkmcal export robot.toml --as klipper --out new.cfg --config printer.cfg'
    >>> Exporting.of_table(job.table()) == job
    True
    """

    OWNER, TABLE = "[export]", "export"

    target: str = field(default="", metadata={"option": "as"})
    out: PathText | None = None
    number: str | None = None
    config: PathText | None = None
    project: bool = False

    def argv(self) -> list[str]:
        """Command line of the job."""
        return command("export", [self.robot], self.options())
