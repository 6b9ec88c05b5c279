"""`pkmcal app`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pkmcal.cli import interrupt
from pkmcal.cli.output import say
from pkmcal.exceptions import ArgumentError


def app(
    folder: Annotated[
        Path,
        typer.Argument(metavar="[FOLDER]", help="The project: its files are kept there."),
    ] = Path("pkmcal-project"),
    browser: Annotated[
        bool,
        typer.Option(
            "--browser/--no-browser", help="Open it in the browser, or print where it is."
        ),
    ] = True,
    port: Annotated[
        int, typer.Option(metavar="PORT", min=0, max=65535, help="0: one that is free.")
    ] = 0,
    install_icon: Annotated[
        bool,
        typer.Option("--install-icon", help="Add pkmcal to the menu of the desktop, and end."),
    ] = False,
) -> int:
    """Calibrate in the browser: from the first file to the changed configuration.

    It is served on this computer alone, and nothing leaves it. The project is a folder with your
    files and project.toml, which `pkmcal calibrate --project` reads, too. Ctrl-C ends it.

    Example: pkmcal app my-printer
    """
    if install_icon:
        from pkmcal.app.icon import install

        say(f"written: {install()}")
        return 0
    try:
        from pkmcal.app.launch import launch
    except ImportError as error:
        missing = str(error.name).partition(".")[0]
        raise ArgumentError(
            f"pkmcal app needs {missing}: python -m pip install starlette uvicorn"
        ) from None
    with interrupt.lost_connections_are_errors():  # of tabs that are closed, of what it started
        launch(folder, say, browser, port)
    return 0
