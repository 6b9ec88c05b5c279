"""A target: something that robots are written for, with what it takes and what writes it."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from pkgutil import resolve_name
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Literal

from pkmcal import arguments
from pkmcal.arguments import instance, shown, word
from pkmcal.exceptions import (
    ArgumentError,
    ArgumentTypeError,
    Error,
    named_failures,
    of_the_package,
)
from pkmcal.files.atomic import write_whole

if TYPE_CHECKING:
    from pkmcal.controllers.loss import Loss

Takes = Literal["parallel", "arm", "any"]
OPTIONS = ("number", "config", "project")  # what the command line may be told beside the file


@dataclass(frozen=True)
class Target:
    """Something that robots are written for: a controller, a simulator, a file format.

    `register` makes it known to the command line, to projects and to the window.

    Parameters
    ----------
    name : str
        What ``--as`` calls it.
    write : callable or str
        Writes a machine: ``write(machine, path)``, and keywords ``number``, ``config`` and
        ``project`` of the command line's options, those of them that it has. It returns the `Loss`
        of what it wrote or anything else, and raises a ValueError where the target cannot hold the
        machine. A text ``"package.module:function"`` is imported when it is needed.
    about : str
        What is written, a phrase of the help.
    takes : {"parallel", "arm", "any"}
        Which machines: parallel ones, serial arms, or both. An arm is handed over with its joint
        errors and without the laws of its joints, of which the `Loss` is said.
    label : str
        What the window calls it; "" where it does not offer it.
    file : str
        Name of the file that the window writes; by default it contains the name.
    folder : bool
        Whether a folder is written.
    tried : bool
        Whether it holds few kinds of machines, so that the window tries it before it offers it.
    said : str
        Words before a loss where it is not that of what was written.

    Examples
    --------
    >>> import pkmcal as pk
    >>> def names(robot, path):
    ...     path.write_text(" ".join(robot.geometry.names))
    >>> pk.export.Target("names", names, "the names of its numbers").options
    ()
    >>> pk.export.targets()["klipper"].options
    ('config', 'project')
    """

    name: str
    write: Callable[..., Any] | str
    about: str
    takes: Takes = "parallel"
    label: str = ""
    file: str = ""
    folder: bool = False
    tried: bool = False
    said: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name or self.name.split() != [self.name]:
            raise ArgumentError(f"name must be one word, found {shown(self.name)}")
        if not (callable(self.write) or isinstance(self.write, str)):
            raise ArgumentTypeError(f"write must be a function, found {shown(self.write)}")
        word("takes", self.takes, ("parallel", "arm", "any"))
        for member in ("about", "label", "file", "said"):
            instance(f"{member} of the target {self.name}", getattr(self, member), str)
        if not self.file:
            object.__setattr__(self, "file", f"for_{self.name}.txt")

    @property
    def writer(self) -> Callable[..., Any]:
        """The function that writes."""
        if callable(self.write):
            return self.write
        try:
            found: Callable[..., Any] = resolve_name(self.write)
        except (ImportError, AttributeError, ValueError) as error:
            raise ArgumentError(
                f"the target {self.name}: its function {self.write!r} cannot be had: {error}"
            ) from error
        return found

    @property
    def options(self) -> tuple[str, ...]:
        """The options of the command line that its function has."""
        known = inspect.signature(self.writer).parameters
        return tuple(name for name in known if name in OPTIONS)

    def export(
        self, machine: Any, path: PathLike[str], options: Mapping[str, Any] | None = None
    ) -> Loss | None:
        """Write a machine.

        Parameters
        ----------
        machine : Robot or SerialArm
            One that it takes.
        path : path
            The file, or the folder. What was there before stays until the function has written
            the whole, elsewhere.
        options : mapping, optional
            Values of `options`.

        Returns
        -------
        Loss or None
            What is lost of the machine; None where nothing is, or nothing can be said.

        Raises
        ------
        ValueError
            What the target cannot hold, or does not take; a function that is no part of pkmcal
            failed, or did not write what its target states.
        TypeError
            A path that is none.
        OSError
            What was written cannot be moved to its place.
        """
        from pkmcal.arms.arm import SerialArm
        from pkmcal.controllers.loss import Loss, laws
        from pkmcal.kinematics.calibratable import as_machine

        if self.takes not in (kind := as_machine(machine).kind, "any"):
            found = "a serial arm" if kind == "arm" else "a parallel machine"
            wanted = "serial arms" if self.takes == "arm" else "parallel machines"
            raise ArgumentError(f"the target {self.name} is for {wanted}, found {found}")
        lost = None
        if isinstance(machine, SerialArm):
            lost = None if machine.laws is None else laws(machine)
            machine = machine.rigid
        place = arguments.path("path", path)
        if self.folder and place.exists() and not place.is_dir():
            raise ArgumentError(f"{place}: the target {self.name} writes a folder, this is a file")
        with TemporaryDirectory(prefix="pkmcal-") as folder:
            draft = Path(folder) / place.resolve().name
            found = self._written(machine, draft, options or {})
            for each in sorted(Path(folder).rglob("*")):
                to = place.parent / each.relative_to(folder)
                if each.is_dir():
                    to.mkdir(parents=True, exist_ok=True)
                else:
                    write_whole(to, each.read_bytes())
        return found if isinstance(found, Loss) else lost

    def _written(self, machine: Any, draft: Path, options: Mapping[str, Any]) -> Any:
        """Have the function write where nothing is, and return what it returns."""
        writer, said = self.writer, f"the target {self.name}"
        with named_failures(writer, said, files=True):
            try:
                found = writer(machine, draft, **options)
            except ValueError as error:  # what it cannot hold
                if isinstance(error, Error) or of_the_package(writer):
                    raise
                raise ArgumentError(f"{said}: {error}") from error
        if not draft.exists():
            raise ArgumentError(f"{said} wrote no {draft.name}")
        if draft.is_dir() != self.folder:
            wrote, states = ("file", "True") if self.folder else ("folder", "False")
            raise ArgumentError(f"{said} wrote a {wrote} {draft.name}, and states folder={states}")
        return found
