"""heightmap.csv of RepRapFirmware: points of the bed, as its Grid.cpp writes them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pkmcal as pk
from pkmcal.files.text_rows import text_rows

TITLE = "RepRapFirmware height map file v2 generated at 2026-01-05 18:03, mean error 0.1\n"
LABELS = {  # of its three versions, and a grid of 3 by 2 points
    "one spacing": (
        "xmin,xmax,ymin,ymax,radius,spacing,xnum,ynum\n",
        "-40.00,40.00,-20.00,20.00,50.00,40.00,3,2\n",
    ),
    "two spacings": (
        "xmin,xmax,ymin,ymax,radius,xspacing,yspacing,xnum,ynum\n",
        "-40.00,40.00,-20.00,20.00,-1.00,40.00,40.00,3,2\n",
    ),
    "axes": (
        "axis0,axis1,min0,max0,min1,max1,radius,spacing0,spacing1,num0,num1\n",
        "X,Y,-40.00,40.00,-20.00,20.00,-1.00,40.00,40.00,3,2\n",
    ),
}
GRID = "  0.110,  0.120,  0\n -0.130,  0.000,  0.150\n"
POINTS = [  # a bare 0 was not probed, 0.000 was
    [-40.0, -20.0, 0.11],
    [0.0, -20.0, 0.12],
    [-40.0, 20.0, -0.13],
    [0.0, 20.0, 0.0],
    [40.0, 20.0, 0.15],
]


def rows(text: str) -> list[list[float]]:
    found = text_rows(Path("heightmap.csv"), text.encode())
    assert found.rows[0][1] == ["x [mm]", "y [mm]", "contact [mm]"]
    return [[float(cell) for cell in row] for _, row in found.rows[1:]]


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
@pytest.mark.parametrize("version", LABELS)
def test_points_stand_where_the_grid_says(version: str, newline: str) -> None:
    text = (TITLE + "".join(LABELS[version]) + GRID).replace("\n", newline)
    np.testing.assert_allclose(rows(text), POINTS)


def test_a_spacing_that_is_rounded_reaches_the_end_of_the_grid() -> None:
    """185 mm in 8 steps is 23.125 mm, written as 23.12 by some and as 23.13 by others."""
    names, _ = LABELS["two spacings"]
    for written in ("23.12", "23.13"):
        grid = ", ".join(["0.100"] * 9)
        text = f"{TITLE}{names}10.00,195.00,0.00,40.00,-1.00,{written},40.00,9,2\n{grid}\n{grid}\n"
        assert rows(text)[8][0] == pytest.approx(195.0)
    text = f"{TITLE}{names}0.00,100.00,0.00,40.00,-1.00,30.00,40.00,4,2\n" + "1.0,1.0,1.0,1.0\n" * 2
    assert [row[0] for row in rows(text)[:4]] == [0.0, 30.0, 60.0, 90.0]  # the end is not reached


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (TITLE, "ends before its grid"),
        (TITLE + "".join(LABELS["axes"]).replace("X,Y", "X,Z") + GRID, "line 2: .* axes XZ"),
        (TITLE + "a,b\n1,2\n" + GRID, "line 2: .* no grid"),
        (TITLE + "".join(LABELS["axes"]) + GRID[:20], "2 rows of 3 points below line 3"),
        (TITLE + "".join(LABELS["axes"]).replace("3,2", "4,2") + GRID, "2 rows of 4 points"),
    ],
)
def test_mistakes_are_named(text: str, message: str) -> None:
    with pytest.raises(pk.FileError, match=message):
        rows(text)
