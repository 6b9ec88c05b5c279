"""A wheel says what it holds, and `wheels.check` sees where it does not."""

from __future__ import annotations

import struct
import zipfile
from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import pytest

pytest.importorskip("elftools", reason="needs pyelftools, as make wheels installs it")
build = pytest.importorskip("wheels.build", reason="needs the folder of the sources")
check = pytest.importorskip("wheels.check")
CORE = Path(find_spec("pkmcal._core").origin)  # type: ignore[union-attr, arg-type]
LINUX = next(t for t in build.TARGETS.values() if t.system == "linux" and t.processor == "x86_64")


@pytest.fixture
def packed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[bytes], Path]:
    """Return a function that packs a wheel of one module and an extension."""
    pure = tmp_path / "pure"
    for name, text in {
        "pkmcal/__init__.py": "",
        "pkmcal-1.dist-info/METADATA": "Name: pkmcal\n",
    }.items():
        (pure / name).parent.mkdir(parents=True, exist_ok=True)
        (pure / name).write_text(text)
    monkeypatch.setattr(build, "DIST", tmp_path / "dist")

    def pack(content: bytes) -> Path:
        (tmp_path / "core").write_bytes(content)
        return build.wheel(LINUX, pure, tmp_path / "core")

    return pack


def test_a_wheel_records_its_files_and_is_the_same_again(packed: Callable[[bytes], Path]) -> None:
    made = packed(b"core")
    first = made.read_bytes()
    contents = check.recorded(made)
    assert contents["pkmcal/_core.abi3.so"] == b"core"
    assert (
        f"Tag: cp310-abi3-{LINUX.tag.split('.')[0]}"
        in contents["pkmcal-1.dist-info/WHEEL"].decode()
    )
    assert packed(b"core").read_bytes() == first


def test_a_file_that_was_changed_or_added_is_seen(packed: Callable[[bytes], Path]) -> None:
    made = packed(b"core")
    with zipfile.ZipFile(made) as whole:
        contents = {name: whole.read(name) for name in whole.namelist()}
    for changed in ({"pkmcal/_core.abi3.so": b"cure"}, {"pkmcal/more.py": b""}):
        with zipfile.ZipFile(made, "w") as other:
            for name, content in (contents | changed).items():
                other.writestr(name, content)
        with pytest.raises(AssertionError):
            check.recorded(made)


def test_what_an_extension_asks_of_its_system_is_read() -> None:
    """Of the one that runs here; built on this system it may ask for a newer one than a wheel."""
    found = check.elf(CORE.read_bytes())
    assert found.offered == check.OFFERED
    assert any(name.startswith("libc.so") for name in found.libraries)
    assert found.system is not None and found.system >= (2, 2)


@pytest.mark.parametrize("oldest", [(2, 2), (2, 99)])
def test_an_extension_for_newer_systems_than_its_tag_says_is_seen(
    oldest: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    found = replace(check.elf(CORE.read_bytes()), processor=62, system=(2, 34))
    monkeypatch.setattr(check, "elf", lambda content: found)
    monkeypatch.setitem(check.OLDEST, "linux", oldest)
    if oldest < (2, 34):
        with pytest.raises(AssertionError):
            check.looked_at(Path("a.whl"), LINUX, b"")
    else:
        assert "from 2.34 on" in check.looked_at(Path("a.whl"), LINUX, b"")


def test_a_file_of_macos_is_read_as_it_is_laid_out() -> None:
    """Written here after Apple's loader.h: header, three commands, symbols and their names."""
    library, names = (
        b"/usr/lib/libSystem.B.dylib\0".ljust(32, b"\0"),
        b"\0_PyInit__core\0_own\0_free\0",
    )
    version = struct.pack("<6I", 0x32, 24, 1, 11 << 16, 0, 0)
    load = struct.pack("<6I", 0xC, 24 + len(library), 24, 0, 0, 0) + library
    after = 32 + len(version) + len(load) + 24
    kinds = (0x0F, 0x0E, 0x01)  # defined and seen, defined and hidden, asked for
    symbols = b"".join(
        struct.pack("<IBBHQ", names.index(name), kind, 0, 0, 0)
        for name, kind in zip((b"_PyInit", b"_own", b"_free"), kinds, strict=True)
    )
    table = struct.pack("<6I", 0x2, 24, after, 3, after + len(symbols), len(names))
    header = struct.pack("<8I", 0xFEEDFACF, 0x0100000C, 0, 6, 3, 0, 0, 0)
    found = check.macho(header + version + load + table + symbols + names)
    assert found == check.Extension(
        0x0100000C,
        frozenset({"/usr/lib/libSystem.B.dylib"}),
        frozenset({"PyInit__core"}),
        (11, 0),
        signed=False,
    )
