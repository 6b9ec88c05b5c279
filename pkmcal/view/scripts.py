"""The scripts and the style sheet of a machine's page, without the packages that compute."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

_SCRIPTS = ("algebra", "core", "laws", "mover", "arm", "limits", "bodies", "scene", "panel")
MODULES = {"limbs": "limbs", "chains": "chains", "arm": "arms"}  # WebAssembly of each kind


@cache
def style() -> str:
    """Return the style sheet of the element."""
    return _squeezed(_text("page/view.css"))


@cache
def scripts(*more: str) -> str:
    """Return all scripts of the element: the body of a function of ``root`` and ``data``."""
    names = [*_SCRIPTS, *more, "start"]
    body = "\n".join(_squeezed(_text(f"page/{name}.js")) for name in names)
    return f"'use strict'\n{body}\nreturn start(root, data)"


def module(*more: str) -> str:
    """Return the scripts as a module that exports ``start(root, data)``."""
    return f"export async function start(root, data) {{\n{scripts(*more)}\n}}\n"


@cache
def resource(name: str) -> bytes:
    """Return a file of this room."""
    return files("pkmcal.view").joinpath(name).read_bytes()


def _squeezed(text: str) -> str:
    """Return the text without indentation, empty lines, and lines that are a comment."""
    lines = (line.strip() for line in text.splitlines())
    return "\n".join(line for line in lines if line and not line.startswith(("//", "/*")))


def _text(name: str) -> str:
    return resource(name).decode()
