"""The firmware from which a robot's numbers came, and to which they go: `[controller]`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from shlex import quote

from pkmcal.files.toml_table import Table

FIRMWARES = ("klipper", "reprap", "marlin", "hangprinter", "maslow")


@dataclass(frozen=True)
class Controller:
    """Statements of a robot file about its controller.

    Attributes
    ----------
    firmware : str
        One of `FIRMWARES`.
    file : str
        Name of the configuration into which numbers are written; "" where they are entered.
    """

    firmware: str
    file: str = ""

    def command(self, robot: str) -> str:
        """Return the options that write a robot file for the controller."""
        config = f" --config {quote(self.file)}" if self.file else ""
        out = quote(self.new)
        return f"pkmcal export {quote(robot)} --as {self.firmware}{config} --out {out}"

    @property
    def new(self) -> str:
        """Name of the configuration with the changed numbers."""
        return f"new{Path(self.file).suffix or '.g'}"


def read_controller(table: Table) -> Controller:
    """Read a table ``[controller]``."""
    table.only(("firmware", "file"))
    firmware = table.choice("firmware", FIRMWARES, "firmware")
    return Controller(firmware, table.text("file") if "file" in table else "")


def controller_table(controller: Controller) -> dict[str, str]:
    """The ``[controller]`` table of a robot file."""
    return {"firmware": controller.firmware} | (
        {"file": controller.file} if controller.file else {}
    )
