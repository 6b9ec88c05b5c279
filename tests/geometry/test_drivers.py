"""What is said of drivers is what their formulas say."""

from __future__ import annotations

import pytest
import sympy as sp
from pkmcal.derive import limbs

from pkmcal.geometry.drivers import Driver
from pkmcal.geometry.limb_kinds import KINDS

OF_KINDS = {driver.name: driver for driver in (kind.driver for kind in KINDS.values())}


@pytest.mark.parametrize("formula", limbs.DRIVERS, ids=lambda each: str(each.name))
def test_a_driver_is_what_its_formula_says(formula: limbs.Driver) -> None:
    driver = OF_KINDS[formula.name]
    assert driver.unit == formula.unit
    assert bool(driver.carries) == formula.moves
    f = limbs.LimbFunction("probe", "", "")
    f.numbers()
    anchor, length = formula.anchor(f, f.scalar("qt", ""))
    used = f.written_out(sp.Matrix([*anchor, length])).free_symbols
    lengths = {slot for slot in ("rod", "crank") if f.g[slot] in used}
    assert set(driver.lengths.values()) == lengths


@pytest.mark.parametrize(
    ("carries", "lengths"),
    [("about", {"rod": "rod"}), ("along", {"rod": "rod", "radius": "crank"})],
)
def test_a_radius_is_stated_where_the_anchor_turns_and_only_there(
    carries: str, lengths: dict[str, str]
) -> None:
    with pytest.raises(ValueError, match="radius"):
        Driver("slider", carries=carries, lengths=lengths)  # type: ignore[arg-type]


def test_a_driver_that_the_core_lacks_is_refused_with_the_way_to_it() -> None:
    with pytest.raises(ValueError, match=r"winch: .*derive/limbs\.py"):
        Driver("winch")
