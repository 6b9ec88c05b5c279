"""How much of each imperfect scenario any test could see: what it leaves of a fit without noise.

A scenario is drawn as in `bench_imperfect`, but its noise is a millionth of what it is there. The
squares that its calibration leaves then, over the variances of the noise, are the noncentrality of
the test that knows the shape of the error beforehand, which no test of a level exceeds. Where they
are few, the free numbers take up the error: no residual shows it, whatever is looked for.

    python -m benchmarks.bench_seen [--draws 6] [SCENARIO ...]
"""

from __future__ import annotations

import argparse
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.stats import norm

import pkmcal as pk
from benchmarks.imperfect import models, outsider, silent, statements  # noqa: F401  # they add scenarios
from benchmarks.imperfect.cases import SCENARIOS, Case
from benchmarks.timing import Report
from pkmcal.arrays import FloatArray

QUIET = 1e-6
ROWS = 20  # from which on draws of a scenario are noise; errors of a machine are fewer
LEVEL = 0.01  # of the ideal test


class Quiet(np.random.Generator):
    """Draws as a generator does, but for noise of rows, which is next to none."""

    def normal(self, *given: Any, **named: Any) -> Any:
        """As of a generator; noise is a millionth of it."""
        found = super().normal(*given, **named)
        return QUIET * found if np.ndim(found) and len(found) >= ROWS else found


def drawn(name: str, number: int, kind: type[np.random.Generator]) -> Case:
    """A draw of a scenario, as `bench_imperfect` has it, with noise or without."""
    seed = np.random.SeedSequence([number, *name.encode()])
    return SCENARIOS[name].draw(kind(np.random.PCG64(seed)))


def left(name: str, number: int) -> tuple[float, float] | None:
    """Squares that are left without noise, over its variances, and degrees of freedom.

    None where a scenario is several files, its noise is not drawn by rows, or it is refused.
    """
    noisy, quiet = (drawn(name, number, kind) for kind in (np.random.Generator, Quiet))
    if not isinstance(quiet.data, pk.Measurements):
        return None
    noise: FloatArray = np.sqrt(np.mean((noisy.data.values - quiet.data.values) ** 2, axis=0))
    if not (noise > 0.0).all():
        return None
    case = replace(quiet, data=replace(quiet.data, sigma=noise))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            found = pk.identify(case.robot, case.data, case.free, **case.options)
        except (ValueError, TypeError):
            return None
    fit = found.fit.uncertainty.fit
    return float(fit.squares), float(fit.freedom)


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("names", nargs="*", help="scenarios, or how their names begin")
    options.add_argument("--draws", type=int, default=6)
    given = options.parse_args()
    report = Report("What could be seen of imperfect data")
    lines = []
    for name, each in SCENARIOS.items():
        asked = not given.names or any(name.startswith(begin) for begin in given.names)
        if each.meant != "other" or not asked:
            continue
        found = [pair for k in range(given.draws) if (pair := left(name, k)) is not None]
        if not found:
            continue
        squares, freedom = np.median(found, axis=0)
        power = norm.sf(norm.isf(LEVEL / 2.0) - np.sqrt(squares))
        lines.append([name, f"{squares:.3g}", f"{freedom:.0f}", f"{100 * power:.0f} %"])
        print(*lines[-1], sep=" | ", flush=True)
    report.table(["scenario", "noncentrality", "spare equations", "ideal test"], lines)
    report.write("seen")


if __name__ == "__main__":
    main()
