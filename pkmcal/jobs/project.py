"""A project file: what a window or a folder asks for, as plain TOML.

It says what the options of the verbs say, in tables: ``machine``, ``measured`` and ``fit`` of a
calibration, ``plan`` of poses to measure, ``import`` of the configuration that the machine is made
of, ``export`` with the controllers that it is written for.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NoReturn

from pkmcal.exceptions import FileError
from pkmcal.jobs.calibration import Calibration
from pkmcal.jobs.configuration import Importing
from pkmcal.jobs.plan import Planning
from pkmcal.jobs.stated import Refuse, of, refused

VERSION = 1
_VERSION = "pkmcal-project"
_TABLES = ("machine", "measured", "fit", "plan", "import", "export")
_ESCAPES = {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\t": "\\t", "\r": "\\r"}


@dataclass(frozen=True)
class Project:
    """The content of a project file.

    Attributes
    ----------
    calibration : Calibration
        The tables machine, measured and fit.
    plan : Planning
        The table plan; its machine is that of the calibration.
    importing : Importing or None
        The table import: of which configuration the machine is made.
    targets : tuple of str
        What the calibrated machine is written for: `as` of the table export.

    Examples
    --------
    >>> project = Project(Calibration("hexapod", ("measured.csv",), holdout="0.2"))
    >>> print(project.text(), end="")
    pkmcal-project = 1
    <BLANKLINE>
    [machine]
    builtin = "hexapod"
    <BLANKLINE>
    [measured]
    files = ["measured.csv"]
    <BLANKLINE>
    [fit]
    holdout = "0.2"
    >>> Project.of_text(project.text()) == project
    True
    """

    calibration: Calibration = field(default=Calibration())
    plan: Planning = field(default=Planning())
    importing: Importing | None = None
    targets: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "plan", replace(self.plan, robot=self.calibration.robot))

    def table(self) -> dict[str, Any]:
        """Return the content of the file in plain values."""
        importing = {} if self.importing is None else self.importing.table()
        targets = {"export": {"as": list(self.targets)}} if self.targets else {}
        return {
            _VERSION: VERSION,
            **self.calibration.table(),
            **self.plan.table(),
            **importing,
            **targets,
        }

    @classmethod
    def of_table(cls, table: Mapping[str, Any], refuse: Refuse | None = None) -> Project:
        """Read a project from its tables.

        Raises
        ------
        ValueError
            Another version, an unknown key, or a value that is none of this key.
        """
        refuse = refuse or refused
        version = table.get(_VERSION)
        if version != VERSION or isinstance(version, bool):
            refuse(_VERSION, f"must be {VERSION}, the version of project files, found {version!r}")
        for key in table:
            if key not in (_VERSION, *_TABLES):
                refuse(key, f"unknown key {key!r} of a project")
        targets, refuse_target = of(table, "export", refuse)
        if targets.keys() - {"as"} or not _texts(targets.get("as", [])):
            refuse_target("as", f"must be a list of controllers alone, found {dict(targets)!r}")
        return cls(
            Calibration.of_table(table, refuse),
            Planning.of_table(table, refuse),
            Importing.of_table(table, refuse) if "import" in table else None,
            tuple(targets.get("as", [])),
        )

    def text(self) -> str:
        """Text of the project file."""
        return toml(self.table())

    @classmethod
    def of_text(cls, text: str | bytes, place: str = "project.toml") -> Project:
        """Read the text of a file; mistakes are told with file, line and key.

        Raises
        ------
        ValueError
            No TOML, or as `of_table`.
        """
        from pkmcal.files.toml_lines import Source  # it needs the numerical packages

        source = Source(text.encode() if isinstance(text, str) else text, place)

        def refuse(key: str, why: str) -> NoReturn:
            table, dot, below = key.partition(".")
            name = f"[{table}]: {below}" if dot else table
            said = why if repr(below or table) in why else f"{name}: {why}"
            raise FileError(f"{source.where(table, *[below] * bool(dot))}: {said}")

        return cls.of_table(source.data, refuse)

    def in_folder(self, folder: str | Path) -> Project:
        """Return the project with its relative paths below a folder."""
        folder = str(folder)
        importing = None if self.importing is None else self.importing.in_folder(folder)
        calibration, plan = self.calibration.in_folder(folder), self.plan.in_folder(folder)
        return Project(calibration, plan, importing, self.targets)


def _texts(value: object) -> bool:
    return isinstance(value, list) and all(isinstance(each, str) for each in value)


def toml(table: Mapping[str, Any]) -> str:
    """Plain values as TOML: texts, numbers, lists of texts, tables of texts."""
    head = [f"{_toml_key(key)} = {_value(value)}" for key, value in table.items()
            if not isinstance(value, Mapping)]  # fmt: skip
    parts = ["\n".join(head)] if head else []
    for name, below in table.items():
        if isinstance(below, Mapping):
            lines = [f"{_toml_key(key)} = {_value(value)}" for key, value in below.items()]
            parts.append("\n".join([f"[{_toml_key(name)}]", *lines]))
    return "\n\n".join(parts) + "\n"


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, Mapping):
        pairs = ", ".join(f"{_toml_key(key)} = {_value(each)}" for key, each in value.items())
        return f"{{ {pairs} }}"
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    return repr(value)


def _toml_key(key: str) -> str:
    plain = key.isascii() and key.replace("-", "").replace("_", "").isalnum()
    return key if plain else _text(key)


def _text(text: str) -> str:
    return f'"{"".join(map(_letter, text))}"'


def _letter(letter: str) -> str:
    if letter in _ESCAPES:
        return _ESCAPES[letter]
    control = ord(letter) < 0x20 or 0x7F <= ord(letter) < 0xA0
    return f"\\u{ord(letter):04X}" if control else letter
