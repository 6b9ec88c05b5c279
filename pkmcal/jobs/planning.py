"""A plan of poses to measure, as options and tables say it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import PurePath

from pkmcal.jobs.stated import PathText, Stated, command


@dataclass(frozen=True)
class Planning(Stated):
    """What to plan: options of `pkmcal plan`.

    Attributes
    ----------
    kind, target, noise, unknown, inside : tuple of str
        What is measured, where on the platform, how well, what is unknown, where to stay.
    count : int or None
        How many poses.
    accuracy : float or None
        In place of it: as few as reach this, mm.
    out : str
        The folder of poses.csv and commands.csv.

    Examples
    --------
    >>> Planning(kind=("height",), count=20).argv("delta.toml")
    ['pkmcal', 'plan', 'delta.toml', '--kind', 'height', '--count', '20', '--out', 'plan']
    """

    OWNER = "[plan]"

    kind: tuple[str, ...] = ()
    target: tuple[str, ...] = ()
    count: int | None = None
    accuracy: float | None = None
    noise: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()
    inside: tuple[str, ...] = field(default=(), metadata={"option": "within"})
    out: PathText = "plan"

    def argv(self, robot: str) -> list[str]:
        """The command line that says the same of a robot."""
        words = self.options()
        return command("plan", [robot], [*words, *["--out", "plan"] * ("--out" not in words)])

    @property
    def commands(self) -> str:
        """The file of actuator coordinates that it writes."""
        return str(PurePath(self.out) / "commands.csv")
