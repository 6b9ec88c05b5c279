"""How files of measurements are read: one object for options and tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from pkmcal.exceptions import ArgumentError
from pkmcal.jobs.stated import PathText, Refuse, Stated, below


@dataclass(frozen=True)
class Reading(Stated):
    """Reading of files: the options of `pkmcal calibrate` and `pkmcal check` for it.

    Attributes
    ----------
    controller : str or None
        A log with the actuators.
    join : str
        How rows of the log are found.
    ignore : tuple of str
        Headings of columns that are left out.
    rename : tuple of str
        "OLD=NEW" of each heading that is read as another.
    columns : str or None
        A TOML file that says the same.
    units, rotation, probe_offset : str or None
        Units of columns without one, order of angles, the probe's place.
    invert_poses : bool
        Whether poses are those of the base.
    camera, camera_on, board, lens, find_size
        The lens file of a camera, what it is fixed to, what it sees, what is unknown of both.

    Examples
    --------
    >>> reading = Reading(rename=("Lg1=q1 [mm]",), ignore=("Quality",))
    >>> reading.options()
    ['--ignore', 'Quality', '--rename', 'Lg1=q1 [mm]']
    >>> reading.table()
    {'ignore': ['Quality'], 'rename': {'Lg1': 'q1 [mm]'}}
    >>> Reading.of_table(reading.table()) == reading
    True
    """

    OWNER = "the measured files"

    controller: PathText | None = None
    join: str = "auto"
    ignore: tuple[str, ...] = ()
    rename: tuple[str, ...] = ()
    columns: PathText | None = None
    units: str | None = None
    rotation: str | None = None
    probe_offset: str | None = None
    invert_poses: bool = False
    camera: PathText | None = None
    camera_on: str = "base"
    board: str | None = None
    lens: str = "none"
    find_size: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        names = dict(map(_renamed, self.rename))
        object.__setattr__(self, "rename", tuple(f"{old}={new}" for old, new in names.items()))

    @property
    def names(self) -> dict[str, str]:
        """The names of columns, and what each is read as."""
        return dict(map(_renamed, self.rename))

    def table(self) -> dict[str, Any]:
        """A table of a project file."""
        found = super().table()
        return {**found, "rename": self.names} if self.rename else found

    @classmethod
    def values_of_table(cls, table: Mapping[str, Any], refuse: Refuse) -> dict[str, Any]:
        """The values of the fields that a table states."""
        names = table.get("rename")
        if isinstance(names, Mapping):
            if not all(isinstance(new, str) for new in names.values()):
                refuse("rename", f"must have a name for each heading, found {dict(names)!r}")
            table = {**table, "rename": [f"{old}={new}" for old, new in names.items()]}
        return super().values_of_table(table, refuse)

    def in_folder(self, folder: str) -> Reading:
        """Return the options with their relative paths, those of a project file, below a folder."""
        found = super().in_folder(folder)
        board = board_file(self.board)
        return found if board is None else replace(found, board=below(folder, board))


def board_file(board: str | None) -> str | None:
    """The file of a board's own points; None of a board that words describe."""
    return board if board is not None and board.lower().endswith(".csv") else None


def _renamed(text: str) -> tuple[str, str]:
    old, equals, new = text.partition("=")
    if not equals or not old.strip() or not new.strip():
        raise ArgumentError(f"--rename {text}: expected OLD=NEW, such as 'Lg=q1 [mm]'")
    return old.strip(), new.strip()
