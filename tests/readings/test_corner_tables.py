"""Tables of corners: what is wrong in one is told by its line."""

from __future__ import annotations

from pathlib import Path

import pytest

import pkmcal as pk
from pkmcal.files.csv_table import Table
from pkmcal.readings import Board, Camera

CAMERA = Camera(fx=900.0, fy=900.0, board=Board.chessboard(4, 3, 20))


@pytest.mark.parametrize(
    ("number", "message"),
    [
        ("12", "the board has 12 corners, 0 to 11; found 12"),
        ("-1", "the board has 12 corners, 0 to 11; found -1"),
        ("3.5", "expected a whole number, found '3.5'"),
    ],
)
def test_a_corner_that_the_board_does_not_have_is_told_by_file_and_line_once(
    tmp_path: Path, number: str, message: str
) -> None:
    file = tmp_path / "pixels.csv"
    file.write_text(f"corner,u,v\n0,1,2\n11,1,2\n{number},1,2\n")
    with pytest.raises(pk.FileError) as error:
        CAMERA.read(Table(file), None)
    assert str(error.value).startswith(f"{file}, line 4, column 'corner': {message}")
    assert str(error.value).count("line ") == 1
