"""The command line `pkmcal`: one verb a task, and the place where errors become one line.

Exit codes: 0 done, 1 done but not to be trusted, 2 wrong input.
"""

from __future__ import annotations

import io
import sys
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

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
from pkmcal.cli.plan import plan
from pkmcal.cli.sensitivity import sensitivity
from pkmcal.cli.tolerance import tolerance

_STOPPED = 130  # what shells give a program that Ctrl-C ended


class _Verbs(TyperGroup):
    """The verbs; a verb returns its exit code or raises what the library raises."""

    def main(self, *args: Any, **settings: Any) -> Any:
        settings["standalone_mode"] = False  # hands over return values and errors
        try:
            code = super().main(*args, **settings)
        except (ValueError, OSError) as error:
            code = _refused(_of_library(error))
        except typer.Abort:
            code = _STOPPED
        except Exception as error:
            if not hasattr(error, "format_message"):  # not of typer's: a mistake in this program
                raise
            code = _refused(_of_command_line(error))
        sys.exit(code)


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

        typer.echo(f"pkmcal {pkmcal.__version__}")
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
        typer.echo(context.get_help())


def main() -> None:
    """Run the command line; `pkmcal` on the shell."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal without σ gets "?"
    app(prog_name="pkmcal")


def _refused(message: str) -> int:
    """Print why in one line; wrong input."""
    print("pkmcal:", " ".join(message.split()), file=sys.stderr)
    return 2


def _of_library(error: ValueError | OSError) -> str:
    if isinstance(error, OSError) and error.strerror and error.filename:
        return f"{error.filename}: {error.strerror}"
    return str(error)


def _of_command_line(error: Any) -> str:
    """An error of typer's, which knows the verb that was meant."""
    context = getattr(error, "ctx", None)
    verb = context.command_path if context else "pkmcal"
    return f"{error.format_message().rstrip('.')} (see {verb} --help)"
