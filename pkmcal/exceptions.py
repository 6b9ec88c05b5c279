"""Errors and warnings of the package: one base for all, and the built-in ones they also are."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

from pkmcal.display import visible


class _Shown(Exception):
    """An error or warning whose message steers no terminal, whatever it quotes."""

    def __str__(self) -> str:
        return visible(super().__str__())


class Error(_Shown):
    """An error about the arguments or files of pkmcal."""


class ArgumentError(Error, ValueError):
    """An argument that makes no sense; the message names it and says what was found."""


class ArgumentTypeError(ArgumentError, TypeError):
    """An argument of a type that is not taken; the message names it and says what was found."""


class FitError(ArgumentError):
    """Measurements that no geometry near the present one agrees with; the message says which."""


class UnreachedError(FitError):
    """Some rows at which what was read contradicts the actuators: no pose agrees with both.

    Attributes
    ----------
    rows : tuple of int
        Which.
    """

    def __init__(self, text: str, rows: tuple[int, ...]) -> None:
        super().__init__(text)
        self.rows = rows


class FileError(ArgumentError):
    """An error in a file; the message names the file and, where it can, the line."""


class MissingFileError(FileNotFoundError, FileError):
    """Error: there is no such file, or no folder to write it to."""

    __str__ = Error.__str__  # before that of OSError


class CalibrationWarning(_Shown, UserWarning):
    """A warning of `identify` about a fit that succeeded."""


def of_the_package(given: object) -> bool:
    """Return whether a function, or the class of an object, is one of the package."""
    module = getattr(given.func if isinstance(given, partial) else given, "__module__", None)
    return str(module).partition(".")[0] == __name__.partition(".")[0]


@contextmanager
def named_failures(
    owner: object, what: str, needed: str = "", *, files: bool = False
) -> Iterator[None]:
    """Name what fails in a class or a function that is no part of the package.

    Parameters
    ----------
    owner : object
        The object of the class, or the function.
    what : str
        What it is to the user, the beginning of a sentence: its method, its class.
    needed : str
        What it is given and has to return, the end of that sentence.
    files : bool
        Whether it is there to write a file that its caller names: errors of the system are his.

    Raises
    ------
    TypeError
        Whatever was raised, but for errors of the package and of memory.
    """
    try:
        yield
    except Exception as error:
        passing = (Error, MemoryError, OSError) if files else (Error, MemoryError)
        if isinstance(error, passing) or of_the_package(owner):
            raise
        raise ArgumentTypeError(
            f"{what} failed with {type(error).__name__}: {error}{needed and '; '}{needed}"
        ) from error


def words_of(error: BaseException) -> str:
    """Return the words of an error; of one of the system the file that it is about first."""
    if not isinstance(error, OSError) or type(error).__str__ is not OSError.__str__:
        return str(error)
    if not (error.strerror and error.filename):
        return str(error)
    return f"{error.filename}: {error.strerror}"
