"""The command `pkmcal`: loads the verbs, which takes a while, and runs them."""

from __future__ import annotations

from pkmcal.cli import interrupt


def _escaped(error: UnicodeError) -> tuple[str, int]:
    """Characters that an encoding has not, in the way that JSON has them."""
    import json

    assert isinstance(error, UnicodeEncodeError)
    return json.dumps(error.object[error.start : error.end])[1:-1], error.end


def main() -> None:
    """Run the command line; `pkmcal` on the shell."""
    interrupt.ends_at_once()
    import codecs
    import io
    import os
    import sys
    import warnings

    # One thread of NumPy, unless the user states others: it is quicker for the small systems of a
    # calibration, and gives the same last digits whatever the number of processors.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from pkmcal.cli import ending

    interrupt.ends_with_its_reader()
    if sys.stderr is None:  # closed, as services have it, and pythonw
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    if isinstance(sys.stdout, io.TextIOWrapper):
        codecs.register_error("as in JSON", _escaped)
        # a terminal without σ gets "?", who reads JSON gets an escape
        sys.stdout.reconfigure(errors="as in JSON" if "--json" in sys.argv else "replace")
    try:  # an environment that is wrong is said before anything else
        import pkmcal.core.library  # noqa: F401
        from pkmcal.cli.verbs import app
    except Exception as error:
        sys.exit(ending.code(error))
    warnings.showwarning = ending.warned
    app(prog_name="pkmcal")
