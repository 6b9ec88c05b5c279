"""Draw the pictures of the gallery: the page of each machine as Chromium shows it, cut out.

python docs/gallery/draw.py
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

import pkmcal as pk
from pkmcal.files.toml_lines import tomllib

sys.path.insert(0, str(Path(__file__).parents[2]))
from tests.browser import look

HERE = Path(__file__).parent
WIDTH, HEIGHT = 300, 225  # of a picture, px
SCENE = 560  # width of the machine on a page that is 900 px wide, px
PLAIN = """<script>setInterval(() => {
for (const each of document.querySelectorAll('input[type=checkbox]:checked'))
  if (['numbers', 'frames'].includes(each.parentNode.textContent.trim())) each.click()
}, 100)</script>"""  # neither numbers nor frames
NET = 206  # grey levels above are background or the net on the ground


def draw(stem: str, source: str) -> None:
    """Write one picture: the machine without the net around it, in 16 levels a channel."""
    with tempfile.TemporaryDirectory() as made:
        page, shot = Path(made, "page.html"), Path(made, "shot.png")
        pk.load(source).show(page)
        with page.open("a", encoding="utf-8") as text:
            text.write(PLAIN)
        look(page, f"--screenshot={shot}", "--window-size=900,700", "--force-device-scale-factor=2",
             "--virtual-time-budget=15000")  # fmt: skip
        scene = cv2.imread(str(shot))[:, : 2 * SCENE]
    rows, columns = np.nonzero(scene.min(axis=2) < NET)
    top, bottom, left, right = rows.min(), rows.max(), columns.min(), columns.max()
    cut = scene[max(top - 20, 0) : bottom + 20, max(left - 20, 0) : right + 20]
    factor = min(WIDTH / cut.shape[1], HEIGHT / cut.shape[0])
    size = (round(cut.shape[1] * factor), round(cut.shape[0] * factor))
    small = cv2.resize(cut, size, interpolation=cv2.INTER_AREA)
    picture = np.full((HEIGHT, WIDTH, 3), scene[2, 2], dtype=np.uint8)
    y, x = (HEIGHT - size[1]) // 2, (WIDTH - size[0]) // 2
    picture[y : y + size[1], x : x + size[0]] = small
    levels = (np.round(picture / 16.0).clip(0, 15) * 16).astype(np.uint8)
    cv2.imwrite(str(HERE / f"{stem}.png"), levels, [cv2.IMWRITE_PNG_COMPRESSION, 9])


if __name__ == "__main__":
    for stem, source in tomllib.loads((HERE / "machines.toml").read_text()).items():
        draw(stem, source)
