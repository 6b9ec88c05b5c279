"""Printed output of the verbs."""

from __future__ import annotations

import typer

from pkmcal.display import visible


def say(text: object, err: bool = False) -> None:
    """Print to stdout or stderr; names of others may be in it, which steer no terminal."""
    typer.echo(visible(str(text)), err=err)


def tell(text: object) -> None:
    """Print a line on what was assumed, to stderr."""
    say(f"pkmcal: {text}", err=True)
