"""The command `pkmcal`: loads the verbs, which takes a while, and runs them."""

from __future__ import annotations

from pkmcal.cli import interrupt


def main() -> None:
    """Run the command line; `pkmcal` on the shell."""
    interrupt.ends_at_once()
    import io
    import os
    import signal
    import sys
    import warnings

    from pkmcal.cli import ending

    if hasattr(signal, "SIGPIPE"):
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # `pkmcal … | head` ends as others do
    if sys.stderr is None:  # closed, as services have it, and pythonw
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal without σ gets "?"
    try:
        from pkmcal.cli.verbs import app
    except Exception as error:
        sys.exit(ending.code(error))
    warnings.showwarning = ending.warned
    app(prog_name="pkmcal")
