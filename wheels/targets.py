"""The systems and processors that wheels are built for."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Target:
    """A system on a processor.

    Attributes
    ----------
    triple : str
        As zig calls it, with the oldest version of the system that the wheel runs on.
    tag : str
        As wheels call it.
    extension : str
        The file of the compiled core, which Python finds by its name.
    link : tuple of str
        What the linker is told beside the objects.
    runner : tuple of str or None
        What runs a program of it here; None where nothing does.
    """

    triple: str
    tag: str
    extension: str = "_core.abi3.so"
    link: tuple[str, ...] = ()
    runner: tuple[str, ...] | None = None

    @property
    def processor(self) -> str:
        """The first word of the triple."""
        return self.triple.partition("-")[0]

    @property
    def system(self) -> str:
        """The second one, without its version."""
        return self.triple.split("-")[1].partition(".")[0]


_MAC = ("-Wl,-undefined,dynamic_lookup",)  # what Python gives is found when it is loaded
TARGETS = {
    "linux-x86_64": Target(
        "x86_64-linux-gnu.2.17", "manylinux_2_17_x86_64.manylinux2014_x86_64", runner=()
    ),
    "linux-aarch64": Target(
        "aarch64-linux-gnu.2.17",
        "manylinux_2_17_aarch64.manylinux2014_aarch64",
        runner=("qemu-aarch64",),
    ),
    "windows-x86_64": Target("x86_64-windows-gnu", "win_amd64", "_core.pyd", runner=("wine64",)),
    "macos-x86_64": Target("x86_64-macos.11.0", "macosx_11_0_x86_64", link=_MAC),
    "macos-arm64": Target("aarch64-macos.11.0", "macosx_11_0_arm64", link=_MAC),
}
