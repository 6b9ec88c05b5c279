"""Cameras and boards that options state, and those of them that a file of pixels has rows of."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import get_args

from pkmcal.arguments import did_you_mean, word
from pkmcal.exceptions import ArgumentError
from pkmcal.files.csv_table import Table
from pkmcal.jobs.reading import Reading, named
from pkmcal.readings.boards import Board
from pkmcal.readings.camera import Camera, Mount
from pkmcal.readings.lens import Found

_MOST = 3  # names that a message lists


def cameras(reading: Reading) -> list[Camera]:
    """The cameras that are stated, each with each board; none without a lens.

    Raises
    ------
    ValueError
        A word that is none, a board without a camera, a lens file that cannot be read, several of
        which one has no name.
    """
    chosen = word("--lens", reading.lens, get_args(Found))
    mount = word("--camera-on", reading.camera_on, get_args(Mount))
    if reading.from_pnp is not None and (reading.camera or reading.board):
        raise ArgumentError(
            "--from-pnp: of poses f and board say what the camera and the board were; --camera and"
            " --board go with pixels"
        )
    if not reading.camera:
        if reading.board:
            raise ArgumentError("--board: it is what a camera sees; state its lens, --camera FILE")
        _require_none_of_pixels(reading)
        return []
    for option, given in (("--camera", reading.camera), ("--board", reading.board)):
        names = [name for name, _ in map(named, given)]
        if len(given) > 1 and ("" in names or len({*names}) < len(names)):
            raise ArgumentError(f"{option}: name each of several, {option} NAME=…, {option} NAME=…")
    boards: list[tuple[str, Board | None]] = [("", None)]
    if reading.board:
        boards = [(name, Board.parse(text)) for name, text in map(named, reading.board)]
    return [
        Camera.from_file(
            file, on=mount, board=board, lens=chosen, find_size=reading.find_size,
            size_sigma=reading.size_sigma, camera_name=name, board_name=of_board,
        )
        for name, file in map(named, reading.camera)
        for of_board, board in boards
    ]  # fmt: skip


def _require_none_of_pixels(reading: Reading) -> None:
    """Refuse options that say nothing without a camera."""
    given = {
        "--camera-on": reading.camera_on != "base" and reading.from_pnp is None,
        "--lens": reading.lens != "none",
        "--find-size": reading.find_size,
        "--size-sigma": reading.size_sigma != 0.0,
    }
    for option, is_given in given.items():
        if is_given:
            raise ArgumentError(
                f"{option}: it is of pixels that a camera saw; state its lens, --camera FILE"
            )


def with_rows(stated: Sequence[Camera], table: Table) -> list[Camera]:
    """The stated cameras, each with a board, of which a table has rows; of no pixels none.

    Raises
    ------
    ValueError
        Rows of a camera or a board that is not stated; several that no column tells apart.
    """
    if not {"u", "v"} <= table.columns.keys():
        return []
    names = {
        "camera": {each.camera_name for each in stated},
        "board": {each.board_name for each in stated},
    }
    seen = []
    for column, given in names.items():
        if column in table.columns:
            texts = table.texts(column)
            if given != {""}:
                _require_stated(table, column, texts, given)
                seen.append(texts)
                continue
        elif len(given) > 1:
            raise table.header_error(
                f"there are several {column}s, {', '.join(sorted(given))}, and no column {column!r}"
                " that names that of each row"
            )
        seen.append(tuple(given) * len(table))
    pairs = {*zip(*seen, strict=True)}
    return [each for each in stated if (each.camera_name, each.board_name) in pairs]


def _require_stated(
    table: Table, column: str, texts: Sequence[str], given: Collection[str]
) -> None:
    others = [text for text in texts if text not in given]
    if not others:
        return
    found = list(dict.fromkeys(others))
    shown = ", ".join(map(repr, found[:_MOST])) + ", …" * (len(found) > _MOST)
    near = did_you_mean(found[0], given, listed=0) or "."
    raise table.header_error(
        f"column {column!r}: {len(others)} of {len(texts)} rows are of {shown}, and --{column}"
        f" names {', '.join(sorted(given))}{near} State --{column} {found[0]}=… as well, use one"
        " name for both, or take these rows out of the file"
    )
