"""A check of a calibration: what it looks for, what it makes of that, how it says so.

A check is one entry of the tuple `CHECKS` in one of the files that `checks` lists.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, Literal, TypeVar

from pkmcal.arguments import function, instance, shown, words
from pkmcal.estimation.loss import LIMITS
from pkmcal.exceptions import ArgumentError
from pkmcal.fitted.solution import Solution

CHANCE = 0.01  # with which a check of all readings may doubt sound ones
RARE = 0.001  # with which one that tries many groups of them may
F = TypeVar("F")
Level = Literal["grave", "doubt", "remark"]

_OPTIONS = {  # what the command line says otherwise than `identify`; None: it has no such option
    ("drop", "outliers"): "--drop-outliers",
    ("drop", "slack"): "--drop-slack",
    ("unknown", "target"): "--target unknown",
    ("fix", "datum"): "--datum auto",
    ("effects", None): "--expansion",
    ("bounds", None): None,
}
# arguments that take more beside what they have
_SEVERAL = ("drop", "effects", "fix", "loss", "per_session", "unknown")


@dataclass(frozen=True)
class Remedy:
    """An argument of `identify` that would help: an option in a sentence, a button in a window.

    Attributes
    ----------
    argument : str
        The name of the argument.
    value : object
        The value that it should have; None where the user has to say.

    Examples
    --------
    >>> print(Remedy("loss", "cauchy"))
    --loss cauchy (loss='cauchy')
    >>> Remedy("drop", (4, 17)).option
    '--drop 4,17'
    >>> Remedy("drop", "outliers").applied({"drop": (3,), "holdout": 0.2})
    {'drop': (3, 'outliers'), 'holdout': 0.2}
    >>> Remedy("loss", "cauchy").applied({"loss": ("huber", "cluster")})
    {'loss': ('cluster', 'cauchy')}
    >>> import pkmcal as pk
    >>> Remedy("effects", (pk.Sag("all"),)).applied({"effects": [pk.Coupling([(6, 5)]), pk.Sag()]})
    {'effects': (Coupling(pairs=[(6, 5)], ratio=None), Sag('all'))}
    >>> Remedy("unknown", "target").applied({"unknown": {"frame": "known", "target": "known"}})
    {'unknown': {'frame': 'known', 'target': 'unknown'}}
    """

    argument: str
    value: Any = None

    def applied(self, arguments: Mapping[str, Any]) -> dict[str, Any]:
        """Arguments of `identify` with this one, beside what it had where it takes several.

        Raises
        ------
        ValueError
            A remedy of which only the user knows the value.
        """
        if self.value is None:
            raise ArgumentError(f"{self.argument}: the remedy states no value; state it yourself")
        before = arguments.get(self.argument)
        value = self.value
        if isinstance(before, Mapping):  # `unknown`, where each set has a word
            value = {**before, **dict.fromkeys(_listed(value), "unknown")}
        elif self.argument in _SEVERAL and before is not None:
            kept = [each for each in _listed(before) if not self._replaces(each)]
            new = [each for each in _listed(value) if each not in kept]
            several = (*kept, *new)
            value = several if len(several) > 1 else value
        return {**arguments, self.argument: value}

    def _replaces(self, word: object) -> bool:
        """Return whether it is another loss, or an effect of the same name: there is only one."""
        if self.argument == "effects":
            names = {each.name for each in self.value}
            return word == "auto" or getattr(word, "name", None) in names
        return self.argument == "loss" and {self.value, word} <= LIMITS.keys()

    @property
    def option(self) -> str | None:
        """The option of ``pkmcal calibrate``; None where it has none."""
        several = isinstance(self.value, tuple)
        if several and all(hasattr(each, "option") for each in self.value):  # effects
            return f"--{self.argument} {','.join(each.option for each in self.value)}"
        if not several and (self.argument, self.value) in _OPTIONS:
            return _OPTIONS[self.argument, self.value]
        name = f"--{self.argument.replace('_', '-')}"
        if self.value is None:
            return name
        if not several:
            return f"{name} {self.value}"
        if all(isinstance(each, str) for each in self.value):
            return " ".join(f"{name} {each!r}" for each in self.value)
        return f"{name} {','.join(map(str, self.value))}"

    def __str__(self) -> str:
        several = isinstance(self.value, tuple)
        shown = "" if self.value is None else repr(list(self.value) if several else self.value)
        if several and len(self.value) == 1 and isinstance(self.value[0], str):
            shown = repr(self.value[0])
        python = f"{self.argument}={shown}"
        return python if self.option is None else f"{self.option} ({python})"


def _listed(value: Any) -> tuple[Any, ...]:
    return tuple(value) if isinstance(value, Iterable) and not isinstance(value, str) else (value,)


@dataclass(frozen=True)
class Said:
    """The statement of one check about a calibration.

    Attributes
    ----------
    check : str
        The name of the check.
    level : {"grave", "doubt", "remark"}
        What it makes of the result: no calibration, a doubtful one, neither.
    text : str
        One sentence: the cause, its size, the cure.
    finding : object
        The numbers behind it.
    remedies : tuple of Remedy
        What would help, as data.
    """

    check: str
    level: Level
    text: str
    finding: Any = None
    remedies: tuple[Remedy, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Check(Generic[F]):
    """One thing that may be wrong with a calibration.

    Attributes
    ----------
    name : str
        By which other checks, files and windows refer to it.
    about : str
        What it looks for: a line of the table in the documentation.
    run : callable (found) -> iterable
        Look, and return what was seen: nothing, one finding or several.
    say : callable (found, finding) -> str
        One sentence on a finding: the cause, its size, the cure.
    levels : tuple of {"grave", "doubt", "remark"}
        What a finding makes of the result.
    level_of : callable (found, finding) -> level or None, optional
        Which of several levels a finding has; None where it is not worth a word.
    remedies : callable (found, finding) -> tuple of Remedy, optional
        What would help.
    unless : tuple of str
        Checks and levels that explain what this one would say: where one of them speaks, it does
        not.
    at_once : bool
        Whether `identify` warns of it. The others may take time, and are made when somebody asks
        for the verdict.
    """

    name: str
    about: str
    run: Callable[[Solution], Iterable[F]]
    say: Callable[[Solution, F], str]
    levels: tuple[Level, ...] = ("doubt",)
    level_of: Callable[[Solution, F], Level | None] | None = None
    remedies: Callable[[Solution, F], tuple[Remedy, ...]] | None = None
    unless: tuple[str, ...] = ()
    at_once: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise ArgumentError(f"name of a check must be a word, found {shown(self.name)}")
        instance(f"about of the check {self.name}", self.about, str)
        for member in ("run", "say", "level_of", "remedies"):
            if (given := getattr(self, member)) is not None or member in ("run", "say"):
                function(f"{self.name}: {member}", given)
        for field in ("levels", "unless"):
            several = words(f"{field} of the check {self.name}", getattr(self, field))
            object.__setattr__(self, field, several)


def at_most_one(finding: F | None) -> tuple[F, ...]:
    """Return the findings of `run`, of which there is at most one."""
    return () if finding is None else (finding,)
