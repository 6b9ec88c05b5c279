"""The verbs of the command line, one for each task."""

from __future__ import annotations

import sys
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from pkmcal.cli import ending, interrupt
from pkmcal.cli.output import say

_VERBS = {  # where each is: file and function
    "demo": "demonstration.demo",
    "machines": "machines.machines",
    "show": "show.show",
    "app": "app.app",
    "new": "new.new",
    "check": "check.check",
    "stiffness": "stiffness.stiffness",
    "sensitivity": "sensitivity.sensitivity",
    "tolerance": "tolerance.tolerance",
    "plan": "plan.plan",
    "measure": "measure.measure",
    "board": "board.board",
    "detect": "detect.detect",
    "calibrate": "calibrate.calibrate",
    "compensate": "compensate.compensate",
    "export": "export.export",
    "import": "import_file.import_file",
    "inverse": "inverse.inverse",
    "forward": "forward.forward",
}
_SIGNED = ("inverse", "forward", "stiffness")  # an argument may be -330,-330,-330


class _Verbs(TyperGroup):
    """The verbs; a verb returns its exit code or raises what the library raises."""

    def main(self, *args: Any, **settings: Any) -> Any:
        settings["standalone_mode"] = False  # hands over return values and errors
        given = settings.get("args", args[0] if args else None)
        json = "--json" in (sys.argv[1:] if given is None else given)
        try:
            code = super().main(*args, **settings)
        except Exception as error:
            code = ending.code(error, json)
        sys.exit(code)

    def invoke(self, ctx: Any) -> Any:
        try:
            with interrupt.IsRaised():
                return super().invoke(ctx)
        except KeyboardInterrupt as stop:
            return ending.code(stop, "--json" in sys.argv)

    def list_commands(self, ctx: Any) -> list[str]:
        return list(_VERBS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """A verb is loaded when it is asked for, all of them if there is none of that name."""
        with interrupt.EndsAtOnce():
            for name in (cmd_name,) if cmd_name in _VERBS else _VERBS:
                if name not in self.commands:
                    self.add_command(_loaded(name))
        return super().get_command(ctx, cmd_name)


def _loaded(name: str) -> Any:
    """A verb with all that it needs, which takes a while."""
    file, _, function = _VERBS[name].partition(".")
    verb = getattr(import_module(f"pkmcal.cli.{file}"), function)
    alone = typer.Typer(add_completion=False)
    alone.command(name, context_settings={"ignore_unknown_options": name in _SIGNED})(verb)
    return typer.main.get_command(alone)


app = typer.Typer(cls=_Verbs, pretty_exceptions_enable=False)


def _version(wanted: bool) -> None:
    if wanted:
        import pkmcal

        say(f"pkmcal {pkmcal.__version__}")
        raise typer.Exit()


def _schema(wanted: bool) -> None:
    if wanted:
        from importlib.resources import files

        say(files("pkmcal.report").joinpath("schema.json").read_text("utf-8").rstrip())
        raise typer.Exit()


@app.callback(invoke_without_command=True)
def _start(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
    schema: Annotated[
        bool,
        typer.Option(
            "--json-schema",
            callback=_schema,
            is_eager=True,
            help="Print the JSON Schema of what --json prints.",
        ),
    ] = False,
) -> None:
    """Model, calibrate and compensate parallel kinematic machines.

    Lengths are in mm, angles in degrees. Every verb explains itself: pkmcal calibrate --help
    """
    if context.invoked_subcommand is None:
        say(context.get_help())
