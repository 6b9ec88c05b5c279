"""The project of a window: a folder of the user's files, and one plain file of what is asked.

Nothing else is a state. The file is written whole at every change; every change has a number, so
that of two tabs that change the same state the second is told.
"""

from __future__ import annotations

import contextlib
import filecmp
import json
import os
import shutil
import stat
import sys
import weakref
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pkmcal.app.aside import free_place
from pkmcal.app.commands import OUTPUTS, PLAN, REPORT
from pkmcal.app.names import safe_name
from pkmcal.exceptions import ArgumentError, FileError
from pkmcal.files.atomic import write_whole
from pkmcal.jobs.machine import is_built_in
from pkmcal.jobs.project import Project
from pkmcal.jobs.reading import is_file

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found,unused-ignore]

FILE = "project.toml"
OWN = frozenset({  # names that are pkmcal's; a user's file gets another
    FILE, "robot.toml", "certificate.toml", PLAN, REPORT, "machine", *OUTPUTS,
})  # fmt: skip
MOST_FILE, MOST_FOLDER = 100_000_000, 1_000_000_000  # bytes
UPLOAD = ".upload-", ".part"  # around the name of a file that is being sent
_MOST = 1_000_000  # bytes of a project file, as many as a request may state
_UNDO = 100


class Folder:
    """A project and its versions.

    Parameters
    ----------
    path : Path
        Made if it is not there. A project file in it is read.

    Raises
    ------
    ValueError
        A project file with a mistake, with its line.
    """

    def __init__(self, path: Path) -> None:
        path.mkdir(parents=True, exist_ok=True)
        self.path = path.resolve()
        self._same = _identity(self.path)
        self.project, self.version = Project(), 1
        self._before: list[Project] = []
        self._content: bytes | None = None  # of the project's file, as it was read or written last
        self._follow()
        self._before.clear()
        for part in self.path.glob("*".join(UPLOAD)):  # of a server that was killed
            part.unlink(missing_ok=True)

    @property
    def files(self) -> list[str]:
        """The user's files, by name; none where the folder is gone."""
        with contextlib.suppress(OSError):
            return sorted(each.name for each in self.path.iterdir() if self._is_users(each))
        return []

    def follow(self) -> None:
        """Take over what somebody else has written into the project's file, in an editor.

        Raises
        ------
        ValueError
            A mistake in it, with its line, or the folder is gone; the state is what it was.
        """
        self.refuse_gone()
        if self._follow():
            self.version += 1

    def refuse_gone(self) -> None:
        """Refuse a folder that is gone, and another one by its name: processes are in the former.

        Raises
        ------
        ValueError
            With what brings it back.
        """
        if not self.path.is_dir():
            raise ArgumentError(
                f"{self.path}: the folder of this project is gone: bring it back to go on"
            )
        if not self._same():
            raise ArgumentError(
                f"{self.path}: another folder has this name now: bring the former back, or end"
                " pkmcal app in its terminal and start it again"
            )

    def _follow(self) -> bool:
        try:
            content = _content(self.path / FILE)
        except FileNotFoundError:
            return False
        if content == self._content:
            return False
        project = _parsed(content, str(self.path / FILE))
        _refuse_elsewhere(project)
        self._before = [*self._before, self.project][-_UNDO:]
        self.project, self._content = project, content
        return True

    def change(self, table: Mapping[str, Any], version: object) -> bool:
        """Take a whole new state, written at once; False where another was first.

        Raises
        ------
        ValueError
            A key or value that is none, a file that is not in the folder, or a mistake that
            somebody made in the project's file.
        """
        self.follow()
        if version != self.version:
            return False
        project = Project.of_table(table)
        self.refuse_links(project)
        self._inside(project)
        if project != self.project:
            self._before = [*self._before, self.project][-_UNDO:]
            self._take(project)
        return True

    def undo(self, version: object) -> bool:
        """Go back to the state before; False where there is none or another was first."""
        self.follow()
        if version != self.version or not self._before:
            return False
        self._take(self._before[-1])
        del self._before[-1]
        return True

    @property
    def undoable(self) -> bool:
        """True if there is an earlier state to return to."""
        return bool(self._before)

    def store(self, name: str, content: Path) -> tuple[str, str | None]:
        """Take a file that was sent.

        Returns
        -------
        name : str
            What it is called here.
        former : str or None
            What another content that had this name is called now; None where there was none.
        """
        name = safe_name(name)
        if _is_own(name):
            name = f"my_{name}"
        place, former = self.path / name, None
        own = place.is_file() and not place.is_symlink()  # a link goes, what it leads to stays
        if own and not filecmp.cmp(place, content, shallow=False):
            former = free_place(place)
            shutil.copy2(place, former)
        content.replace(place)
        return name, None if former is None else former.name

    def refuse_links(self, project: Project) -> None:
        """Refuse symbolic links that lead out of the folder, to read or to write.

        Raises
        ------
        ValueError
            With the link's name.
        """
        made = Path(project.importing.out).parts[:1] if project.importing else ()
        read = {Path(name).parts[0] for name in named(project)}
        for each in self.path.iterdir():
            if _is_own(each.name) or each.name in made or each.name in read:
                below = each.rglob("*") if each.is_dir() and not each.is_symlink() else ()
                for one in (each, *below):
                    if one.is_symlink() and not self._is_within(one):
                        name = json.dumps(str(one.relative_to(self.path)))
                        raise ArgumentError(
                            f"{name} is a link that leads out of this project: copy there what it"
                            " leads to"
                        )

    def written(self, path: str) -> Path | None:
        """Return a file of the folder that may be taken away, or None."""
        if "\0" in path:
            return None
        try:
            found = (self.path / path).resolve()
            there = found.is_relative_to(self.path) and found.is_file()
        except (OSError, RuntimeError):  # a name that is too long, links in a circle
            return None
        if not there:
            return None
        hidden = any(part.startswith(".") for part in found.relative_to(self.path).parts)
        return None if hidden else found

    def used(self) -> int:
        """Total size of all files, bytes."""
        return sum(each.lstat().st_size for each in self.path.rglob("*") if each.is_file())

    def _is_within(self, path: Path) -> bool:
        try:
            return path.resolve().is_relative_to(self.path)
        except (OSError, RuntimeError):  # links in a circle
            return False

    def _take(self, project: Project) -> None:
        content = project.text().encode()
        write_whole(self.path / FILE, content)
        self.project, self._content = project, content
        self.version += 1

    def _inside(self, project: Project) -> None:
        """Refuse files that are not in the folder, and places to write that are not."""
        _refuse_elsewhere(project)
        made = project.importing.out if project.importing else None
        for name in named(project):
            below = made is not None and Path(name).parts[:1] == Path(made).parts  # not yet there
            if not (below or self.written(name) is not None):
                raise ArgumentError(f"there is no file {json.dumps(name)} in this project")

    @staticmethod
    def _is_users(path: Path) -> bool:
        return path.is_file() and not path.name.startswith(".") and path.name != FILE


def _identity(folder: Path) -> Callable[[], bool]:
    """Return what tells whether a folder is still the one that has its name now.

    It is held open, for file systems that number a folder anew once nobody has it.
    """
    if sys.platform == "win32":  # where a folder that a process is in cannot be renamed
        return lambda: True
    place = os.open(folder, os.O_RDONLY)

    def same() -> bool:
        return os.path.samestat(os.fstat(place), folder.stat())

    weakref.finalize(same, os.close, place)
    return same


def _content(file: Path) -> bytes:
    """Read a project file, which a pipe or a device with its name would never end."""
    found = file.stat()
    if stat.S_ISREG(found.st_mode) and found.st_size > _MOST:
        raise ArgumentError(f"{file}: {found.st_size} bytes are too many for a project file")
    if not (stat.S_ISREG(found.st_mode) or stat.S_ISDIR(found.st_mode)):
        raise ArgumentError(f"{file}: a pipe or a device is no project file")
    return file.read_bytes()


def _parsed(content: bytes, place: str) -> Project:
    """Parse a project file; what says where a mistake is takes the packages that compute."""
    try:
        with contextlib.suppress(ValueError):
            return Project.of_table(tomllib.loads(content.decode()))
        return Project.of_text(content, place)
    except RecursionError:
        raise FileError(f"{place}: its lists lie in one another too deeply") from None


def _refuse_elsewhere(project: Project) -> None:
    """Refuse paths that lead out of the folder."""
    if project.importing is not None and _outside(project.importing.out):
        raise ArgumentError("import: out must be a folder within this project")
    for name in named(project):
        if _outside(name):
            raise ArgumentError(f"{json.dumps(name)} is not within this project")


def _is_own(name: str) -> bool:
    """Return whether pkmcal writes, or may write, a name, in whatever letters it is spelt."""
    name = name.casefold()  # as some file systems have it
    return name in OWN or name.startswith(("new.", "for_")) or name.endswith(".part")


def named(project: Project) -> list[str]:
    """Return the files that a project names, the machine's first."""
    job, plan, importing = project.calibration, project.plan, project.importing
    reading = job.reading
    board = plan.board if plan.board is not None and is_file(plan.board) else None
    configuration = (importing.file, importing.log) if importing else ()
    machine = None if is_built_in(job.robot) else job.robot
    seen = (*reading.lens_files, *reading.board_files)
    read = (reading.controller, reading.columns, job.held_file)
    others = (*read, *seen, board, plan.poses, plan.targets, plan.camera)
    return [name for name in (machine, *configuration, *job.files, *others) if name]


def _outside(path: str) -> bool:
    """Return whether a path may lead out of the folder, or is the folder itself."""
    parts = Path(path).parts
    return not parts or Path(path).is_absolute() or ".." in parts or "\0" in path
