"""Methods of classes that people write: what fails in them is named.

And what they return that is of another class than is declared, before it does not fit something
else.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterator, Mapping
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from pkmcal.arguments import kind
from pkmcal.exceptions import ArgumentTypeError, named_failures

_SEVERAL = (Iterator, list, set)  # one does for another


def watch(own: type, declared: type, argument: str = "") -> None:
    """Have the methods of a class, which `declared` declares, name themselves where they fail.

    `argument` is the beginning of the message.
    """
    of = f"of the class {own.__name__}"
    lead = f"{argument}: " if argument else ""
    for name, member in list(vars(own).items()):
        like = vars(declared).get(name)
        if name.startswith("_") or like is None or like is member:
            continue
        if isinstance(like, property) and isinstance(member, property) and member.fget is not None:
            what = f"{lead}{name} {of}"
            setattr(own, name, property(_watched(what, declared, member.fget, like.fget)))
        elif inspect.isfunction(like):
            what = f"{lead}{name} {of}"
            if inspect.isfunction(member):
                setattr(own, name, _watched(what, declared, member, like))
            elif isinstance(member, classmethod):
                watched = _watched(what, declared, member.__func__, like)
                setattr(own, name, classmethod(watched))
            elif callable(member) and (
                isinstance(member, staticmethod) or not hasattr(member, "__get__")
            ):  # which is called without the reading
                alone = getattr(member, "__func__", member)
                watched = _watched(what, declared, alone, like, bound=False)
                setattr(own, name, staticmethod(watched))


def _watched(
    what: str, declared: type, method: Any, like: Any, *, bound: bool = True
) -> Callable[..., Any]:
    """A method that names itself where it fails, or returns what `like` does not.

    `bound`: it is given the object first.
    """
    signature = inspect.signature(like)
    names, returned = [*signature.parameters][1:], signature.return_annotation  # as it is written
    needed = "" if returned == "None" else f" and has to return {returned}"

    files = like.__name__ == "write"

    @functools.wraps(method)
    def called(*given: Any, **named: Any) -> Any:
        has = ", ".join([*names[: len(given) - bound], *named]) or "nothing"
        with named_failures(None, what, f"it is given {has}{needed}", files=files):
            found = method(*given, **named)
            if lazy := isinstance(found, Iterator):
                found = list(found)  # what fails on its way fails here
        classes, parts = _classes(like, declared)
        if classes and not isinstance(found, classes):
            raise ArgumentTypeError(f"{what} must return {returned}; found {kind(found)}")
        for part in found if parts else ():
            if not isinstance(part, parts):
                raise ArgumentTypeError(f"{what} must return {returned}; found {kind(part)} in it")
        return iter(found) if lazy else found

    return called


@functools.cache
def _classes(method: Any, declared: type) -> tuple[tuple[type, ...], tuple[type, ...]]:
    """The classes that the result of a declared method may have, and its parts; empty: any."""
    hint = get_type_hints(method)["return"]
    if hint in (NoneType, bool, Any):
        return (), ()
    if get_origin(hint) in _SEVERAL:
        return (list, tuple, set), get_args(hint)
    found = []
    for part in get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,):
        of = declared if isinstance(part, TypeVar) else get_origin(part) or part
        found.append(Mapping if of is dict else of)
    return tuple(found), ()
