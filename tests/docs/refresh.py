"""Write what the blocks of the pages print now: `python -m tests.docs.refresh [PAGE ...]`.

Only blocks whose output is another than the one shown are written; read the difference that git
shows before it is committed.
"""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
from pathlib import Path

from .pages import PAGES, MissingLog, Session, name_of
from .test_pages import same


def refresh(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    back = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            changed = [
                (b, now)
                for b, now in Session(page, Path(folder)).printed()
                if not same(now, b.text)
            ]
        finally:
            os.chdir(back)
    for block, now in reversed(changed):
        text = text[: block.start] + now + text[block.start + len(block.text) :]
    if changed:
        page.write_text(text, encoding="utf-8")
    print(f"{name_of(page)}: {len(changed)} blocks written")


if __name__ == "__main__":
    wanted = sys.argv[1:]
    for each in PAGES:
        if not wanted or name_of(each) in wanted:
            try:
                refresh(each)
            except MissingLog as missing:
                with contextlib.suppress(BrokenPipeError):
                    print(f"{name_of(each)}: left alone, {missing}")
