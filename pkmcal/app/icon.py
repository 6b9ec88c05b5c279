"""An entry for the menus of desktops that follow freedesktop.org."""

from __future__ import annotations

import os
import shlex
import sys
from pathlib import Path

from pkmcal.files.atomic import write_whole

_ENTRY = """[Desktop Entry]
Type=Application
Name=pkmcal
Comment=Calibrate printers, hexapods, arms and other machines
Exec={command}
Terminal=true
Categories=Science;Engineering;
"""


def install(data: Path | None = None) -> Path:
    """Write ``pkmcal.desktop`` for this user, and return where.

    Parameters
    ----------
    data : Path, optional
        The folder of the user's data; by default what XDG_DATA_HOME says, or ~/.local/share.
    """
    home = os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share"
    folder = (Path(home) if data is None else data) / "applications"
    folder.mkdir(parents=True, exist_ok=True)
    project = Path.home() / "pkmcal-project"
    command = shlex.join([sys.executable, "-m", "pkmcal", "app", str(project)])
    path = folder / "pkmcal.desktop"
    write_whole(path, _ENTRY.format(command=command.replace("%", "%%")))
    return path
