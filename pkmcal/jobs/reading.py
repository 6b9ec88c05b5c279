"""Options that say how files of measurements are read: one object for options and tables."""

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
        Whether poses are those of the base; with `from_pnp` those of the camera.
    from_pnp : str or None
        Poses are those of a board that other software found in pictures: "f=640,board=160x120".
    camera, board : tuple of str
        The lens file of a camera, and what it sees; of several each as "NAME=…".
    camera_on, lens, find_size, size_sigma
        What cameras are fixed to, what is unknown of them and of boards.

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
    from_pnp: str | None = None
    camera: tuple[str, ...] = ()
    camera_on: str = "base"
    board: tuple[str, ...] = ()
    lens: str = "none"
    find_size: bool = False
    size_sigma: float = 0.0

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

    @property
    def lens_files(self) -> tuple[str, ...]:
        """Files of the lenses of all cameras."""
        return tuple(file for _, file in map(named, self.camera))

    @property
    def board_files(self) -> tuple[str, ...]:
        """Files of boards of one's own points."""
        return tuple(board for _, board in map(named, self.board) if is_file(board))

    def in_folder(self, folder: str) -> Reading:
        """Return the options with their relative paths, those of a project file, below a folder."""

        def there(text: str) -> str:
            name, file = named(text)
            return f"{name}={below(folder, file)}" if name else below(folder, file)

        boards = tuple(there(each) if is_file(named(each)[1]) else each for each in self.board)
        cameras = tuple(map(there, self.camera))
        return replace(super().in_folder(folder), camera=cameras, board=boards)


def named(text: str) -> tuple[str, str]:
    """The name before an equals sign, "" where there is none, and what stands behind it."""
    name, equals, what = text.partition("=")
    return (name.strip(), what.strip()) if equals else ("", text)


def is_file(board: str) -> bool:
    """Tell a board that is a file of one's own points from a word that describes it."""
    return board.lower().endswith(".csv")


def _renamed(text: str) -> tuple[str, str]:
    old, equals, new = text.partition("=")
    if not equals or not old.strip() or not new.strip():
        raise ArgumentError(f"--rename {text}: expected OLD=NEW, such as 'Lg=q1 [mm]'")
    return old.strip(), new.strip()
