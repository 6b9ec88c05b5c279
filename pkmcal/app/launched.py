"""Processes of the window, which work in the user's folder and run nothing that lies in it."""

from __future__ import annotations

import asyncio
import os
import sys
from pathlib import Path
from typing import Any


async def launched(module: str, folder: Path, **options: Any) -> asyncio.subprocess.Process:
    """Start a process that calls `main` of a module, spoken with by its standard streams.

    No file of the folder may be taken for a module: Python looks there first (-P, which says the
    same, is not known to Python 3.10).

    Parameters
    ----------
    module : str
        Such as ``pkmcal.app.worker``.
    folder : Path
        The project, in which the process works.
    **options
        For `asyncio.create_subprocess_exec`.
    """
    threads = {"OPENBLAS_NUM_THREADS": "1", **os.environ}  # as the command line has it
    return await asyncio.create_subprocess_exec(
        sys.executable, "-c",
        f"import sys; sys.path[:] = filter(None, sys.path); from {module} import main; main()",
        stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE, cwd=folder,
        env={**threads, "PYTHONUTF8": "1"}, **options,
    )  # fmt: skip
