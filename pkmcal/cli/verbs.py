"""The verbs of the command line, one for each task."""

from __future__ import annotations

import sys
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from pkmcal.cli import ending, interrupt
from pkmcal.cli.calibrate import calibrate
from pkmcal.cli.check import check
from pkmcal.cli.compensate import compensate
from pkmcal.cli.demonstration import demo
from pkmcal.cli.export import export
from pkmcal.cli.forward import forward
from pkmcal.cli.import_file import import_file
from pkmcal.cli.inverse import inverse
from pkmcal.cli.machines import machines
from pkmcal.cli.new import new
from pkmcal.cli.output import say
from pkmcal.cli.plan import plan
from pkmcal.cli.sensitivity import sensitivity
from pkmcal.cli.tolerance import tolerance


class _Verbs(TyperGroup):
    """The verbs; a verb returns its exit code or raises what the library raises."""

    def main(self, *args: Any, **settings: Any) -> Any:
        settings["standalone_mode"] = False  # hands over return values and errors
        try:
            code = super().main(*args, **settings)
        except Exception as error:
            code = ending.code(error)
        sys.exit(code)

    def invoke(self, ctx: Any) -> Any:
        try:
            with interrupt.IsRaised():
                return super().invoke(ctx)
        except KeyboardInterrupt as stop:
            return ending.code(stop)


app = typer.Typer(cls=_Verbs, pretty_exceptions_enable=False)
for verb in (
    demo,
    machines,
    new,
    check,
    sensitivity,
    tolerance,
    plan,
    calibrate,
    compensate,
    export,
):
    app.command()(verb)
app.command("import")(import_file)
_SIGNED = {"ignore_unknown_options": True}  # an argument may be -330,-330,-330
app.command(context_settings=_SIGNED)(inverse)
app.command(context_settings=_SIGNED)(forward)


def _version(wanted: bool) -> None:
    if wanted:
        import pkmcal

        say(f"pkmcal {pkmcal.__version__}")
        raise typer.Exit()


@app.callback(invoke_without_command=True)
def _start(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Model, calibrate and compensate parallel kinematic machines.

    Lengths are in mm, angles in degrees. Every verb explains itself: pkmcal calibrate --help
    """
    if context.invoked_subcommand is None:
        say(context.get_help())
