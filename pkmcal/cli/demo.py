"""`pkmcal demo`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pkmcal.cli.output import folder
from pkmcal.cli.progress import progress
from pkmcal.report.as_json import as_json


def demo(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where the files go.")] = Path(
        "pkmcal-demo"
    ),
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Of errors, poses, noise.")] = 1,
    json: Annotated[bool, typer.Option("--json", help="Print JSON alone; mm and rad.")] = False,
) -> int:
    """Calibrate a simulated machine from beginning to end.

    A 2TPR&2TPS with 28 unknown errors is measured by a tracker, identified, and sent to poses
    that were not measured; its error there before and after is printed.

    Example: pkmcal demo --seed 7 --out my-demo
    """
    from pkmcal.cli.demonstration import demonstrate

    with progress("demonstration"):
        result = demonstrate(seed)
        files = result.write(folder(out))
    if json:
        typer.echo(as_json(result))
    else:
        width = max(len(str(path)) for path in files)
        listed = "\n".join(f"{path!s:{width}}  {what}" for path, what in files.items())
        typer.echo(f"{result}\n\n{listed}")
    return 0 if result.trusted else 1
