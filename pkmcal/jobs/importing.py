"""The import of a firmware's configuration, as options and tables say it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import PurePath

from pkmcal.jobs.stated import PathText, Stated, command


@dataclass(frozen=True)
class Importing(Stated):
    """A configuration that becomes a robot file: the options of `pkmcal import`.

    Attributes
    ----------
    file : str
        The configuration.
    out : str
        The folder of robot.toml and of what the configuration had stored.
    firmware : str or None
        Whose it is, where it does not show it.
    log : str or None
        The log of a Maslow's calibration.

    Examples
    --------
    >>> Importing("printer.cfg", out="machine").argv()
    ['pkmcal', 'import', 'printer.cfg', '--out', 'machine']
    >>> Importing("printer.cfg", out="machine").robot
    'machine/robot.toml'
    """

    OWNER = "[import]"

    file: PathText | None = None
    out: PathText = "."
    firmware: str | None = field(default=None, metadata={"option": "from"})
    log: PathText | None = None

    def argv(self) -> list[str]:
        """The command line that says the same."""
        words = self.options()
        place = words.index("--file")  # which is the argument of the verb
        file = words[place + 1]
        return command("import", [file], words[:place] + words[place + 2 :])

    @property
    def robot(self) -> str:
        """The robot file that it makes."""
        return str(PurePath(self.out) / "robot.toml")
