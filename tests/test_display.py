"""Numbers show the digits that their uncertainty supports, and no others."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pkmcal import display
from pkmcal.exceptions import (
    ArgumentError,
    ArgumentTypeError,
    CalibrationWarning,
    FileError,
    MissingFileError,
)


@pytest.mark.parametrize(
    ("value", "sigma", "text"),
    [
        (160.01312, 0.02134, "160.013 ± 0.021"),
        (160.0, 0.00996, "160.000 ± 0.010"),  # rounding up the sigma costs no third digit
        (-0.0003, 0.02, "0.000 ± 0.020"),
        (1234.5, 123.0, "1230 ± 120"),
        (12.3, 4.0, "12.3 ± 4.0"),
        (-12.3, 3100.0, "-12 ± 3100"),  # no sigma makes a value 0
        (0.0123, 1.0e-6, "0.0123000 ± 0.0000010"),
    ],
)
def test_sigma_has_two_digits_and_the_value_ends_with_it(
    value: float, sigma: float, text: str
) -> None:
    assert display.with_uncertainty(value, sigma) == text


@pytest.mark.parametrize("sigma", [math.inf, math.nan, 0.0])
def test_a_useless_sigma_is_named_and_the_value_stays_readable(sigma: float) -> None:
    assert display.with_uncertainty(340.0, sigma) == f"340 ± {sigma:g}"


def test_nan_and_infinity_are_printed_as_they_are() -> None:
    assert display.with_uncertainty(math.nan, 0.1) == "nan ± 0.10"
    assert display.fixed(math.inf, -2) == "inf"


@given(st.floats(-1e6, 1e6), st.floats(1e-9, 1e5))
def test_rounding_moves_the_value_by_less_than_a_tenth_of_sigma(value: float, sigma: float) -> None:
    shown, shown_sigma = map(float, display.with_uncertainty(value, sigma).split(" ± "))
    assert abs(shown - value) <= 0.06 * sigma + 1e-9 * abs(value)
    assert abs(shown_sigma - sigma) <= 0.06 * sigma


@given(st.floats(-1, 1), st.integers(0, 6))
def test_there_is_no_negative_zero(value: float, places: int) -> None:
    text = display.fixed(value, places)
    assert float(text) != 0 or not text.startswith("-")


def test_angles_are_shown_in_degrees_and_lengths_as_they_are() -> None:
    assert display.displayed(math.radians(30), "rad") == (pytest.approx(30), "deg")
    assert display.displayed(12.5, "mm") == (12.5, "mm")


def test_columns_of_a_table_line_up() -> None:
    lines = display.Table(["name", "mm"], [["radius", "1.0"], ["rod", "340.00"]], left=1)
    assert str(lines).splitlines() == ["name        mm", "radius     1.0", "rod     340.00"]


def test_long_tables_fold_into_columns_side_by_side() -> None:
    rows = [[name, str(k)] for k, name in enumerate("abcde")]
    folded = str(display.Table(["name", "n"], rows, left=1, columns=2)).splitlines()
    assert folded == [
        "name  n   name  n",
        "a     0   d     3",
        "b     1   e     4",
        "c     2",
    ]


@pytest.mark.parametrize(
    "kind", [ArgumentError, ArgumentTypeError, FileError, MissingFileError, CalibrationWarning]
)
def test_a_message_that_quotes_a_file_steers_no_terminal(kind: type[Exception]) -> None:
    assert str(kind("joint '\x1b[31m\u202e' of\ntwo lines")) == "joint '�[31m�' of\ntwo lines"
