"""Round trips of machines with random errors: how many return, and what becomes of the others.

A row is wrong where it came with a pose that is neither the one it started from nor another that
meets the closures. tests/round_trips.py says how that is checked.
"""

from __future__ import annotations

import argparse
import time

from benchmarks.timing import Report
from pkmcal.core.library import STATUS
from tests.round_trips import RETURNED, SIGMA, round_trips
from tests.workspaces import WORKSPACE

CHUNK = 20_000


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", type=float, default=1e6, help="of each machine; 1e6")
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    count = int(asked.rows) // CHUNK * CHUNK
    report, rows = Report("Round trips"), []
    report.text(
        f"{count} rows of every machine, {count // CHUNK} times with new errors in every number "
        f"(σ {SIGMA['mm']} mm, {1e3 * SIGMA['rad']:g} mrad, gains {SIGMA['1']:g}), a quarter of the "
        f"rows each with errors of its own; cold from home. Returned: within {RETURNED:g} mm, "
        "angles as arcs at the characteristic length."
    )
    start = time.perf_counter()
    for name in WORKSPACE:
        found = round_trips(name, count, CHUNK, asked.seed)
        share = f"{found.ok / found.rows:.4%}"
        cells = [name, found.rows, found.returned, found.other, *found.flagged, found.wrong]
        rows.append([*cells, share, f"{found.worst:.1e}"])
    flags = [STATUS[code] for code in range(1, len(STATUS))]
    heads = ["machine", "rows", "returned", "another mode", *flags, "wrong", "ok", "worst, mm"]
    report.table(heads, rows)
    print(f"{time.perf_counter() - start:.0f} s")
    report.write("round_trips")


if __name__ == "__main__":
    main()
