"""Look into wheels: what they carry, and what their extensions ask of a system.

    python -m wheels.check dist/*.whl

Each file has the checksum that RECORD states, all wheels carry the same but the extension, and that
is of its processor, offers Python one function, and asks for nothing but Python, the C library, and
systems as old as its tag says. `abi3audit` looks whether Python's stable ABI has what it asks for.
"""

from __future__ import annotations

import base64
import csv
import hashlib
import io
import re
import struct
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wheels.targets import TARGETS, Target

OFFERED = {"PyInit__core"}
_LINKERS = {"_mh_dylib_header", "__dso_handle"}  # names that linkers of macOS add
LIBRARIES = {  # that systems have
    "linux": r"lib(c|m|pthread|dl)\.so\.[0-9]|ld-linux.*",
    "windows": r"python3\.dll|KERNEL32\.dll|ntdll\.dll|api-ms-win-crt-[a-z]+-l1-1-0\.dll",
    "macos": r"/usr/lib/libSystem\.B\.dylib",
}
OLDEST = {"linux": (2, 17), "macos": (11, 0)}  # glibc, macOS
_PROCESSORS = {"x86_64": (62, 0x8664, 0x01000007), "aarch64": (183, 0xAA64, 0x0100000C)}
_BUILD_VERSION, _LOAD_DYLIB, _SYMTAB, _SIGNATURE = 0x32, 0xC, 0x2, 0x1D  # of Mach-O


@dataclass(frozen=True)
class Extension:
    """What an extension says of itself: processor, libraries, names offered, oldest system."""

    processor: int
    libraries: frozenset[str]
    offered: frozenset[str]
    system: tuple[int, int] | None
    signed: bool = True


def main(paths: list[Path]) -> None:
    """Check these wheels; AssertionError where one is not as it should be."""
    others: dict[str, set[str]] = {}
    for path in paths:
        target = next(t for t in TARGETS.values() if path.stem.endswith(t.tag))
        contents = recorded(path)
        extension = f"pkmcal/{target.extension}"
        binaries = {name for name in contents if re.search(r"\.(so|pyd|dll|dylib|o|a)$", name)}
        assert binaries == {extension}, f"{path}: {binaries}"
        strays = [name for name in contents if re.search(r"__pycache__|\.py[co]$|^tests/", name)]
        assert not strays, f"{path}: {strays}"
        others[path.name] = set(contents) - {extension}
        told = looked_at(path, target, contents[extension])
        print(f"{path.name}: {len(contents)} files, {path.stat().st_size / 1e6:.1f} MB; {told}")
    assert len({frozenset(names) for names in others.values()}) == 1, "they carry different files"
    audit = [str(Path(sys.executable).with_name("abi3audit")), "--strict"]
    subprocess.run([*audit, *map(str, paths)], check=True)


def recorded(path: Path) -> dict[str, bytes]:
    """The files of a wheel, each as RECORD states it."""
    with zipfile.ZipFile(path) as packed:
        contents = {name: packed.read(name) for name in packed.namelist()}
    (record,) = (name for name in contents if name.endswith(".dist-info/RECORD"))
    rows = list(csv.reader(io.StringIO(contents[record].decode())))
    assert {row[0] for row in rows} == set(contents), f"{path}: RECORD names other files"
    for name, stated, size in rows:
        if name != record:
            digest = base64.urlsafe_b64encode(hashlib.sha256(contents[name]).digest())
            assert stated == f"sha256={digest.rstrip(b'=').decode()}", f"{path}: {name}"
            assert int(size) == len(contents[name]), f"{path}: {name}"
    return contents


def looked_at(path: Path, target: Target, content: bytes) -> str:
    """Compare an extension with what its target allows; what it asks for, in words."""
    read, place = {"linux": (elf, 0), "windows": (pe, 1), "macos": (macho, 2)}[target.system]
    found = read(content)
    assert found.processor == _PROCESSORS[target.processor][place], f"{path}: another processor"
    assert found.offered == OFFERED, f"{path}: offers {sorted(found.offered)}"
    strange = [n for n in found.libraries if not re.fullmatch(LIBRARIES[target.system], n)]
    assert not strange, f"{path}: asks for {strange}"
    oldest = OLDEST.get(target.system)
    assert oldest is None or (found.system is not None and found.system <= oldest), path
    assert found.signed, f"{path}: macOS on ARM loads nothing without a signature"
    since = f"from {found.system[0]}.{found.system[1]} on, " if found.system else ""
    return f"{since}asks for {', '.join(sorted(found.libraries))}"


def elf(content: bytes) -> Extension:
    """An extension of Linux."""
    from elftools.elf.dynamic import DynamicSection
    from elftools.elf.elffile import ELFFile

    file: Any = ELFFile(io.BytesIO(content))
    dynamic = next(s for s in file.iter_sections() if isinstance(s, DynamicSection))
    asked = frozenset(str(vars(tag)["needed"]) for tag in dynamic.iter_tags("DT_NEEDED"))
    symbols = list(file.get_section_by_name(".dynsym").iter_symbols())
    offered = {
        s.name
        for s in symbols
        if s["st_shndx"] != "SHN_UNDEF" and s["st_info"]["bind"] != "STB_LOCAL"
    }
    versions = [
        (int(major), int(minor))
        for _, needed in file.get_section_by_name(".gnu.version_r").iter_versions()
        for each in needed
        for major, minor in re.findall(r"^GLIBC_([0-9]+)\.([0-9]+)", each.name)
    ]
    (processor,) = struct.unpack_from("<H", content, 18)
    return Extension(processor, asked, frozenset(offered), max(versions))


def pe(content: bytes) -> Extension:
    """An extension of Windows."""
    import pefile

    file = pefile.PE(data=content)
    libraries = frozenset(each.dll.decode() for each in file.DIRECTORY_ENTRY_IMPORT)
    offered = frozenset(each.name.decode() for each in file.DIRECTORY_ENTRY_EXPORT.symbols)
    return Extension(file.FILE_HEADER.Machine, libraries, offered, None)


def macho(content: bytes) -> Extension:
    """An extension of macOS."""
    magic, processor, _, _, count, _, _, _ = struct.unpack_from("<8I", content)
    assert magic == 0xFEEDFACF, "no Mach-O file of 64 bits"
    libraries, offered, oldest, signed = set[str](), set[str](), None, False
    for command, at in _commands(content, count):
        if command == _LOAD_DYLIB:
            (name,) = struct.unpack_from("<I", content, at + 8)
            libraries.add(content[at + name :].split(b"\0", 1)[0].decode())
        elif command == _BUILD_VERSION:
            (version,) = struct.unpack_from("<I", content, at + 12)
            oldest = version >> 16, version >> 8 & 255
        elif command == _SYMTAB:
            offered = set(_macho_offered(content, *struct.unpack_from("<4I", content, at + 8)))
        signed = signed or command == _SIGNATURE
    needs_none = processor == _PROCESSORS["x86_64"][2]
    return Extension(
        processor, frozenset(libraries), frozenset(offered), oldest, signed or needs_none
    )


def _commands(content: bytes, count: int) -> Iterator[tuple[int, int]]:
    """The load commands of a Mach-O file, and where they are."""
    at = 32
    for _ in range(count):
        command, size = struct.unpack_from("<2I", content, at)
        yield command & 0x7FFFFFFF, at
        at += size


def _macho_offered(content: bytes, table: int, count: int, names: int, _: int) -> Iterator[str]:
    """Names that are defined and seen from outside."""
    for k in range(count):
        name, kind, _, _, _ = struct.unpack_from("<IBBHQ", content, table + 16 * k)
        if kind & 0x1 and not kind & 0x10 and kind & 0xE == 0xE and not kind & 0xE0:
            text = content[names + name :].split(b"\0", 1)[0].decode().removeprefix("_")
            if text not in _LINKERS:
                yield text


if __name__ == "__main__":
    main([Path(each) for each in sys.argv[1:]])
