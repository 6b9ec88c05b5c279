"""Whether what was known before agrees with the measurements."""

from __future__ import annotations

import numpy as np

from pkmcal.arrays import largest_first
from pkmcal.diagnostics.check import Check, Remedy, at_most_one
from pkmcal.display import chance_text
from pkmcal.fitted.solution import Solution
from pkmcal.statistics.prior_test import PriorTest

_PULLED = 2.0  # times what is expected, from which a pull on a prior is worth a word
_ALIKE = 1e-6  # share by which pulls differ that are not equal


def _contradicted(found: Solution) -> tuple[PriorTest, ...]:
    test = found.prior_test
    return at_most_one(test if test is not None and test.contradicted else None)


def _contradicted_text(found: Solution, test: PriorTest) -> str:
    """How likely, which numbers are pulled most, and how wide a prior would agree."""
    pulls, stated = np.nan_to_num(test.pulls), found.fit.parameters.prior_names
    worst = [k for k in largest_first(np.abs(pulls), _ALIKE)[:3] if abs(pulls[k]) > _PULLED]
    shown = ", ".join(f"{stated[k]} {abs(pulls[k]):.1f}" for k in worst)
    pulled = f" and pull {shown} times as far as prior and noise let expect" if worst else ""
    return (
        f"the measurements contradict the prior ({chance_text(test.chance_of_either)}){pulled}: a"
        f" prior {test.factor:.2g} times as wide would agree"
        + (", or leave the outliers out" if found.outliers else "")
    )


def _wider(found: Solution, test: PriorTest) -> tuple[Remedy, ...]:
    outliers = (Remedy("drop", "outliers"),) if found.outliers else ()
    return (Remedy("prior"), *outliers)


CHECKS = (
    Check(
        name="prior-contradicted",
        about="the measurements contradict the prior",
        at_once=True,
        run=_contradicted,
        say=_contradicted_text,
        remedies=_wider,
    ),
)
