"""A contact sheet of all pictures, with the corners that were found."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from pkmcal.arrays import FloatArray, Int64Array
from pkmcal.vision.detectors import opencv

_WIDE = 400  # px of a panel
_GREEN, _RED, _BLACK = (60, 190, 0), (0, 0, 230), (0, 0, 0)  # blue, green, red
_MOST = 40  # numbers in a panel


class Panel(NamedTuple):
    """A picture on the sheet.

    Attributes
    ----------
    grey : ndarray of uint8 (height, width)
        Grey levels.
    name : str
        Its title.
    ids : ndarray of int (k,)
        Corners.
    pixel : ndarray (k, 2)
        Where they are.
    bad : bool
        Whether it is not taken.
    """

    grey: Any
    name: str
    ids: Int64Array
    pixel: FloatArray
    bad: bool


def draw(panels: Sequence[Panel]) -> bytes:
    """Draw the pictures side by side, in rows, as a PNG file."""
    cv2 = opencv()
    drawn = [_drawn(panel) for panel in panels]
    height = max(len(each) for each in drawn)
    columns = int(np.ceil(np.sqrt(len(drawn))))
    empty = np.full((height, _WIDE, 3), 255, dtype=np.uint8)
    cells = [np.pad(d, ((0, height - len(d)), (0, 0), (0, 0)), constant_values=255) for d in drawn]
    cells += [empty] * (-len(cells) % columns)
    rows = [np.hstack(cells[i : i + columns]) for i in range(0, len(cells), columns)]
    return bytes(cv2.imencode(".png", np.vstack(rows))[1])


def _drawn(panel: Panel) -> Any:
    cv2 = opencv()
    height, width = panel.grey.shape
    scale = _WIDE / width
    small = cv2.resize(panel.grey, (_WIDE, round(height * scale)), interpolation=cv2.INTER_AREA)
    image = cv2.cvtColor(small, cv2.COLOR_GRAY2BGR)
    every = max(1, len(panel.ids) // _MOST)
    color = _RED if panel.bad else _GREEN
    for k, (number, place) in enumerate(zip(panel.ids, panel.pixel, strict=True)):
        at = tuple(((place + 0.5) * scale - 0.5).round().astype(int).tolist())
        cv2.circle(image, at, 3, color, 1, cv2.LINE_AA)
        if k % every == 0:
            beside = (at[0] + 4, at[1] - 3)
            cv2.putText(image, str(number), beside, cv2.FONT_HERSHEY_SIMPLEX, 0.32, color, 1)
    title = panel.name.encode("ascii", "replace").decode()
    cv2.rectangle(image, (0, 0), (9 * len(title) + 8, 18), (255, 255, 255), -1)
    cv2.putText(image, title, (4, 13), cv2.FONT_HERSHEY_SIMPLEX, 0.42, _BLACK, 1, cv2.LINE_AA)
    if panel.bad:
        cv2.rectangle(image, (0, 0), (_WIDE - 1, len(image) - 1), _RED, 5)
    return image
