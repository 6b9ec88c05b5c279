"""Options as frozen dataclasses: to a command line, to a table of a project file, and back.

Nothing here needs more than the standard library, so that a server can hold such objects without
the time and memory of a numerical package.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable, Iterable, Mapping
from dataclasses import Field, fields, replace
from pathlib import Path
from typing import Any, ClassVar, NoReturn, TypeVar

from pkmcal.exceptions import ArgumentError

PathText = str  # the text of a path: relative paths of a project are those of its folder
S = TypeVar("S", bound="Stated")
Refuse = Callable[[str, str], NoReturn]  # of a key, and why

_NUMBERS: dict[str, type] = {"int": int, "float": float}


class Stated:
    """The base of what options state.

    A subclass is a frozen dataclass. Each of its fields is an option of the same name; its type
    says how it is written: ``bool`` a flag, ``tuple[str, ...]`` an option that is repeated,
    ``PathText`` a file. A field of the metadata ``argument`` is an argument of the verb, and none
    of the table's keys.
    """

    OWNER: ClassVar[str] = "a table"  # whose keys those of the table are, for messages

    def __post_init__(self) -> None:
        for each in fields(self):  # type: ignore[arg-type]  # each subclass is a dataclass
            value = _in_form(each.type, getattr(self, each.name))
            object.__setattr__(self, each.name, value)

    @classmethod
    def of_options(cls: type[S], given: Mapping[str, Any]) -> S:
        """Take the fields out of what a command line gave, by the names of the options."""
        return cls(**{each.name: given[each.name] for each in fields(cls) if each.init})  # type: ignore[arg-type]

    @classmethod
    def _options(cls) -> list[Field[Any]]:
        return [each for each in fields(cls) if not each.metadata.get("argument")]  # type: ignore[arg-type]

    def options(self) -> list[str]:
        """The words of the command line that say this; nothing of what is so by default."""
        words: list[str] = []
        for each in self._stated():
            value = getattr(self, each.name)
            option = f"--{_key(each)}"
            if value is True:
                words.append(option)
            else:
                several = value if isinstance(value, tuple) else (value,)
                words += [word for one in several for word in (option, _word(one))]
        return words

    def table(self) -> dict[str, Any]:
        """A table of a project file, in plain values; nothing of what is so by default."""
        found = {_key(each): getattr(self, each.name) for each in self._stated()}
        return {
            key: list(value) if isinstance(value, tuple) else value for key, value in found.items()
        }

    def _stated(self) -> list[Field[Any]]:
        return [each for each in self._options() if getattr(self, each.name) != each.default]

    @classmethod
    def of_table(cls: type[S], table: Mapping[str, Any], refuse: Refuse | None = None) -> S:
        """Read the options that a table of a project file states.

        Parameters
        ----------
        table : mapping
            Keys and values as `table` returns them.
        refuse : callable, optional
            Raises an error about a key; by default an `ArgumentError`.

        Raises
        ------
        ValueError
            An unknown key, or a value that is none of this key.
        """
        return cls(**cls.values_of_table(table, refuse or refused))

    @classmethod
    def values_of_table(cls, table: Mapping[str, Any], refuse: Refuse) -> dict[str, Any]:
        """The values of the fields that a table states."""
        options = {_key(each): each for each in cls._options()}
        for key in table:
            if key not in options:
                refuse(key, f"unknown key {key!r} of {cls.OWNER}{_meant(key, options)}")
        return {
            options[key].name: _of_table(options[key], value, lambda why, key=key: refuse(key, why))  # type: ignore[misc]
            for key, value in table.items()
        }

    def in_folder(self: S, folder: str) -> S:
        """Return the options with relative paths below a folder."""
        changed = {}
        for each in fields(self):  # type: ignore[arg-type]
            value = getattr(self, each.name)
            if "PathText" in str(each.type) and value is not None:
                several = isinstance(value, tuple)
                changed[each.name] = (
                    tuple(below(folder, one) for one in value) if several else below(folder, value)
                )
        return replace(self, **changed)  # type: ignore[type-var]


def refused(key: str, why: str) -> NoReturn:
    """Refuse a value of a table that is in no file."""
    raise ArgumentError(why if repr(key) in why else f"{key}: {why}")


def of(table: Mapping[str, Any], name: str, refuse: Refuse) -> tuple[Mapping[str, Any], Refuse]:
    """A table within a table, empty if it is not there, and what refuses its keys."""
    found = table.get(name, {})
    if not isinstance(found, Mapping):
        refuse(name, f"must be a table, found {found!r}")
    return found, lambda key, why: refuse(f"{name}.{key}", why)


def below(folder: str, path: str) -> str:
    """A path; below a folder where it is relative."""
    return str(Path(folder, path))


def command(verb: str, arguments: Iterable[str], options: Iterable[str]) -> list[str]:
    """The words of a command line; arguments that begin with a dash stand behind two dashes."""
    arguments, options = list(arguments), list(options)
    if any(each.startswith("-") for each in arguments):
        return ["pkmcal", verb, *options, "--", *arguments]
    return ["pkmcal", verb, *arguments, *options]


def quoted(argv: Iterable[str]) -> str:
    """A command line as it is typed in a shell."""
    return shlex.join(argv)


def _key(field: Field[Any]) -> str:
    """The option of a field without its dashes."""
    return str(field.metadata.get("option", field.name.replace("_", "-")))


def _word(value: Any) -> str:
    return repr(value) if isinstance(value, float) else str(value)


def _in_form(kind: Any, value: Any) -> Any:
    """A value as its field has it: lists are tuples, paths are texts."""
    kind = str(kind)
    if kind.startswith("tuple"):
        value = tuple(value or ())
        return tuple(str(Path(each)) for each in value) if "PathText" in kind else value
    if kind.startswith("PathText") and value is not None:
        return str(Path(value))
    if kind.startswith("float") and value is not None:
        return float(value)
    return value


def _of_table(field: Field[Any], value: Any, refuse: Callable[[str], NoReturn]) -> Any:
    """A value of a table, as its field has it."""
    kind = str(field.type)
    if kind == "bool":
        if not isinstance(value, bool):
            refuse(f"must be true or false, found {value!r}")
        return value
    if kind.startswith("tuple"):
        several = [value] if isinstance(value, str) else value
        if not isinstance(several, list) or not all(isinstance(each, str) for each in several):
            refuse(f"must be a list of texts, found {value!r}")
        return several
    for name, of in _NUMBERS.items():
        if kind.startswith(name):
            taken = (int,) if of is int else (int, float)
            finite = isinstance(value, taken) and not isinstance(value, bool)
            if not finite or not math.isfinite(value):
                refuse(f"must be a {'whole ' * (of is int)}number, found {value!r}")
            return of(value)
    if isinstance(value, int | float) and not isinstance(value, bool):
        return _word(value)  # 0.2, which an option has as a text
    if not isinstance(value, str):
        refuse(f"must be a text, found {value!r}")
    return value


def _meant(key: str, known: Iterable[str]) -> str:
    from pkmcal.arguments import did_you_mean  # only where something is wrong

    return did_you_mean(key, known)
