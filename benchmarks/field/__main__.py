"""What pkmcal does with real data beside what people would take instead: one table.

    make field                       installs the others beside pkmcal, and prints the table
    python -m benchmarks.field NAME  only printer, arm, hexapod, belts or camera

Data are those of `examples/` and, where they lie beside the checkout, of `../shared/data`. A tool
that is not installed, and data that are not there, have no row. All tools get the same rows, in
the same quarters: each fits three of them and is scored on the fourth.
"""

from __future__ import annotations

import logging
import sys
import warnings

from benchmarks.field import arm, belts, camera, hexapod, printer
from pkmcal.exceptions import CalibrationWarning

CASES = {"printer": printer, "arm": arm, "hexapod": hexapod, "belts": belts, "camera": camera}


def main(names: list[str]) -> None:
    """Print a table in Markdown, row by row as each is known."""
    logging.disable(logging.INFO)
    warnings.simplefilter("ignore", CalibrationWarning)
    print(
        "| data | tool | error at rows left out | processor time of a fit | intervals hold | says |"
    )
    print("|---|---|--:|--:|--:|---|")
    for name in names or CASES:
        for row in CASES[name].rows():
            hold = "none stated" if row.intervals is None else "{} of {}".format(*row.intervals)
            print(
                f"| {row.data} | {row.tool} | {row.held_out:.3g} {row.unit} "
                f"| {row.seconds * 1e3:.3g} ms | {hold} | {row.says} |",
                flush=True,
            )


if __name__ == "__main__":
    main(sys.argv[1:])
