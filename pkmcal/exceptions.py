"""Errors and warnings of the package: one base for all, and the built-in ones they also are."""

from __future__ import annotations

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


class FileError(ArgumentError):
    """An error in a file; the message names the file and, where it can, the line."""


class MissingFileError(FileNotFoundError, FileError):
    """Error: there is no such file, or no folder to write it to."""

    __str__ = Error.__str__  # before that of OSError


class CalibrationWarning(_Shown, UserWarning):
    """A warning of `identify` about a fit that succeeded."""


def words_of(error: BaseException) -> str:
    """Return the words of an error; of one of the system the file that it is about first."""
    if not isinstance(error, OSError) or type(error).__str__ is not OSError.__str__:
        return str(error)
    if not (error.strerror and error.filename):
        return str(error)
    return f"{error.filename}: {error.strerror}"
