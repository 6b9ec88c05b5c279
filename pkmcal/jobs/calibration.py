"""A calibration as options and tables say it; what runs it is in `calibrating`."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any

from pkmcal.exceptions import ArgumentError
from pkmcal.jobs.machine import in_folder, machine_of_table, machine_table
from pkmcal.jobs.reading import Reading
from pkmcal.jobs.stated import PathText, Refuse, Stated, below, command, of, refused

if TYPE_CHECKING:
    from pkmcal.diagnostics.check import Remedy

_ARGUMENT = {"argument": True}


@dataclass(frozen=True)
class Calibration(Stated):
    """A calibration: machine, files, and what the options of `pkmcal calibrate` say.

    Texts are those of the options. What the verb writes is a `Writing`.

    Attributes
    ----------
    robot : str
        A built-in machine or a robot file.
    files : tuple of str
        Measurements.
    reading : Reading
        How the files are read.

    Examples
    --------
    >>> job = Calibration("linear-delta", ("probe.csv",), free=("default", "gain1"), holdout="0.2")
    >>> " ".join(job.argv())
    'pkmcal calibrate linear-delta probe.csv --free default --free gain1 --holdout 0.2'
    >>> job.table()["fit"]
    {'free': ['default', 'gain1'], 'holdout': '0.2'}
    >>> Calibration.of_table(job.table()) == job
    True
    """

    OWNER = "[fit]"

    robot: str = field(default="", metadata=_ARGUMENT)
    files: tuple[PathText, ...] = field(default=(), metadata=_ARGUMENT)
    reading: Reading = field(default=Reading(), metadata=_ARGUMENT)
    free: tuple[str, ...] = ()
    fix: tuple[str, ...] = ()
    prior: tuple[str, ...] = ()
    uncertainty: tuple[str, ...] = ()
    consider: tuple[str, ...] = ()
    datum: str = "none"
    frame: str = "known"
    target: str = "known"
    attachment: str = "known"
    effects: tuple[str, ...] = ()
    expansion: tuple[str, ...] = ()
    per_session: tuple[str, ...] = ()
    session: tuple[str, ...] = ()
    approach: str | None = None
    holdout: str | None = None
    drop: tuple[str, ...] = ()
    drop_outliers: bool = False
    drop_slack: bool = False
    loss: str = "linear"
    covariance: str = "auto"
    tracker: str | None = None

    @classmethod
    def of_options(cls, given: Mapping[str, Any]) -> Calibration:
        """Take the fields out of what a command line gave, by the names of the options."""
        return super().of_options({**given, "reading": Reading.of_options(given)})

    def argv(self) -> list[str]:
        """Command line of the job, without what is written."""
        words = [*self.reading.options(), *self.options()]
        return command("calibrate", [self.robot, *self.files], words)

    def table(self) -> dict[str, Any]:
        """Tables of a project file: machine, measured, fit."""
        files = {"files": list(self.files)} if self.files else {}
        found = {
            "machine": machine_table(self.robot),
            "measured": {**files, **self.reading.table()},
            "fit": super().table(),
        }
        return {name: table for name, table in found.items() if table}

    @classmethod
    def of_table(cls, table: Mapping[str, Any], refuse: Refuse | None = None) -> Calibration:
        """Read the tables machine, measured and fit; others are not looked at.

        Raises
        ------
        ValueError
            An unknown key, or a value that is none of this key.
        """
        refuse = refuse or refused
        measured, of_measured = of(table, "measured", refuse)
        files = measured.get("files", [])
        if not isinstance(files, list) or not all(isinstance(each, str) for each in files):
            of_measured("files", f"must be a list of files, found {files!r}")
        others = {key: value for key, value in measured.items() if key != "files"}
        return cls(
            machine_of_table(*of(table, "machine", refuse)),
            tuple(files),
            Reading.of_table(others, of_measured),
            **cls.values_of_table(*of(table, "fit", refuse)),
        )

    def in_folder(self, folder: str) -> Calibration:
        """Return the job with its relative paths, those of a project file, below a folder."""
        found = replace(super().in_folder(folder), reading=self.reading.in_folder(folder))
        found = replace(found, robot=in_folder(self.robot, folder))
        if self.held_file is not None:
            found = replace(found, holdout=below(folder, self.held_file))
        return found

    @property
    def held_file(self) -> str | None:
        """The file that is held out; None where it is a share of the poses, or nothing."""
        from pkmcal.files.number_text import typed

        try:
            _ = None if self.holdout is None else typed(self.holdout)
        except ValueError:
            return self.holdout
        return None

    def with_remedy(self, remedy: Remedy) -> Calibration:
        """The calibration with what a check suggests, beside what it has.

        Raises
        ------
        ValueError
            A remedy of which only the user knows the value, or one that is no option.
        """
        if remedy.value is None or remedy.option is None:
            raise ArgumentError(f"{remedy.argument}: the remedy states no value; state it yourself")
        if remedy.argument == "effects":
            from pkmcal.jobs.effects_option import with_effects

            return replace(self, effects=with_effects(self.effects, remedy.value))
        known = {f"--{each.name.replace('_', '-')}": each.name for each in fields(self)}
        words, changed = shlex.split(remedy.option), dict[str, Any]()
        while words:
            name = known[words.pop(0)]
            value, before = getattr(self, name), changed.get(name)
            if isinstance(value, bool):
                changed[name] = True
            elif isinstance(value, tuple):
                kept = () if name == "free" else value
                changed[name] = tuple(dict.fromkeys((*(before or kept), words.pop(0))))
            else:
                changed[name] = words.pop(0)
        return replace(self, **changed)

    @property
    def sources(self) -> tuple[object, ...]:
        """Statements that reading depends on: equal ones need to be read only once."""
        return self.robot, self.files, self.reading, self.held_file


@dataclass(frozen=True)
class Writing(Stated):
    """Outputs of `pkmcal calibrate`: its options for them.

    Attributes
    ----------
    out, report : str or None
        Folders of robot.toml and residuals.png, and of the report.
    certificate : str or None
        The file that the report begins with.
    pdf, force : bool
        Whether to print the report, and whether to replace files that others wrote.

    Examples
    --------
    >>> Writing(report="out", pdf=True).options()
    ['--report', 'out', '--pdf']
    """

    OWNER = "[write]"

    out: PathText | None = None
    report: PathText | None = None
    certificate: PathText | None = None
    pdf: bool = False
    force: bool = False
