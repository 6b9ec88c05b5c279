"""Build the wheels of all systems on this one, with the C compiler zig: `make wheels`.

    python -m wheels.build                 # every target, into dist/
    python -m wheels.build windows-x86_64  # one

zig is clang with the headers and libraries of the systems; the PyPI package `ziglang` has it.
Python's own headers are those of the Python that runs this, but for pyconfig.h, which is of a
system: that of `include/` states what extensions of the stable ABI need. Windows wants to know at
linking time what python3.dll offers: the names are those of the PyPI package `abi3info`, a reading
of CPython's Misc/stable_abi.toml.
"""

from __future__ import annotations

import base64
import hashlib
import os
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from csrc import build as core
from wheels.targets import TARGETS, Target

ROOT = Path(__file__).resolve().parents[1]
BUILT = ROOT / "build" / "wheels"
DIST = ROOT / "dist"
ZIG = (Path(sys.executable).as_posix(), "-m", "ziglang")  # as shells take it
PYTHON = "cp310-abi3"
# zig states each feature that its processor lacks, which outweighs what the sources ask for.
WIDE = {
    "core_v3": ("-mcpu=x86_64_v3",),
    "core_v4": ("-mcpu=x86_64_v4", "-mprefer-vector-width=512"),
}
_TIME = (1980, 1, 1, 0, 0, 0)  # of the files in a wheel: the same sources give the same bytes


def main(names: list[str]) -> None:
    """Build these targets, or all."""
    os.chdir(ROOT)
    files = pure()
    for name in names or TARGETS:
        target = TARGETS[name]
        made = wheel(target, files, extension(name, target))
        print(made.relative_to(ROOT), f"{made.stat().st_size / 1e6:.1f} MB", flush=True)


def pure() -> Path:
    """A folder with all of the wheel but the extension: the package and what is said of it."""
    folder = BUILT / "pure"
    shutil.rmtree(folder, ignore_errors=True)
    for command in (("build_py", "--build-lib"), ("dist_info", "--output-dir")):
        subprocess.run(
            [sys.executable, "setup.py", "-q", *command, str(folder)], check=True, cwd=ROOT
        )
    return folder


def objects(name: str, target: Target) -> list[Path]:
    """The core of `csrc/`, compiled for a target; what is newer than its sources is kept."""
    folder = BUILT / name
    folder.mkdir(parents=True, exist_ok=True)
    os.environ["CC"] = " ".join([*ZIG, "cc", "-target", target.triple])  # whose flags are asked for
    flags = [*core.flags(), "-fPIC", "-fno-sanitize=all", "-Icsrc", "-Igenerated"]
    if len(core.isas()) != (3 if target.processor == "x86_64" else 1):
        raise SystemExit(f"{name}: {os.environ['CC']} compiles nothing: pip install ziglang")
    newest = max(path.stat().st_mtime for path in _sources())
    wide = WIDE if target.processor == "x86_64" else {}
    used, said = folder / "flags", f"{' '.join(flags)} {wide}"
    if not used.exists() or used.read_text() != said:
        for old in folder.glob("*.o"):
            old.unlink()
        used.write_text(said)
    jobs = []
    for source in sorted(core.CSRC.glob("*.c")):
        made = folder / f"{source.stem}.o"
        if not made.exists() or made.stat().st_mtime < newest:
            jobs.append(_compiled(target, [*flags, *wide.get(source.stem, ())], source, made))
    _at_once(jobs)
    return [folder / f"{source.stem}.o" for source in sorted(core.CSRC.glob("*.c"))]


def extension(name: str, target: Target) -> Path:
    """The extension `pkmcal._core` of a target."""
    compiled = objects(name, target)
    folder = BUILT / name
    binding, made = folder / "binding.c", folder / target.extension
    core.ffibuilder().emit_c_code(str(binding))
    flags = ["-O2", "-g0", "-fPIC", "-fno-sanitize=all", "-fvisibility=hidden", "-w"]
    flags += ["-Icsrc", "-Igenerated", f"-I{_headers()}"]
    _at_once([_compiled(target, flags, binding, folder / "binding.o")])
    link = [*target.link, *([str(_offered(folder))] if target.system == "windows" else [])]
    link += ["-Wl,-install_name,@rpath/_core.abi3.so"] if target.system == "macos" else []
    command = [*ZIG, "cc", "-target", target.triple, "-shared", "-s", "-o", str(made)]
    subprocess.run([*command, str(folder / "binding.o"), *map(str, compiled), *link], check=True)
    return made


def wheel(target: Target, files: Path, compiled: Path) -> Path:
    """Pack a wheel: the files of all targets, and the extension of one."""
    (info,) = files.glob("*.dist-info")
    contents = {
        path.relative_to(files).as_posix(): path.read_bytes()
        for path in sorted(files.rglob("*"))
        if path.is_file()
    }
    contents[f"pkmcal/{target.extension}"] = compiled.read_bytes()
    tags = "".join(f"Tag: {PYTHON}-{tag}\n" for tag in target.tag.split("."))
    contents[f"{info.name}/WHEEL"] = (
        f"Wheel-Version: 1.0\nGenerator: pkmcal\nRoot-Is-Purelib: false\n{tags}"
    ).encode()
    record = "".join(
        f"{name},sha256={_digest(content)},{len(content)}\n" for name, content in contents.items()
    )
    contents[f"{info.name}/RECORD"] = (record + f"{info.name}/RECORD,,\n").encode()
    DIST.mkdir(exist_ok=True)
    made = DIST / f"{info.name.removesuffix('.dist-info')}-{PYTHON}-{target.tag}.whl"
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, content in contents.items():
            entry = zipfile.ZipInfo(name, _TIME)
            entry.external_attr = (0o755 if name.endswith((".so", ".pyd")) else 0o644) << 16
            packed.writestr(entry, content, zipfile.ZIP_DEFLATED)
    return made


def _compiled(target: Target, flags: list[str], source: Path, made: Path) -> list[str]:
    """The command that compiles one file."""
    return [*ZIG, "cc", "-target", target.triple, *flags, "-c", str(source), "-o", str(made)]


def _at_once(commands: list[list[str]]) -> None:
    """Run commands beside each other, as many as there are processors."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for _ in pool.map(lambda command: subprocess.run(command, check=True), commands):
            pass


def _sources() -> list[Path]:
    return [path for folder in (core.CSRC, core.GENERATED) for path in folder.glob("*.[ch]")]


def _headers() -> Path:
    """Python's headers with the pyconfig.h of `include/`, which theirs would hide."""
    folder = BUILT / "include"
    shutil.copytree(sysconfig.get_paths()["include"], folder, dirs_exist_ok=True)
    return Path(shutil.copy(ROOT / "wheels" / "include" / "pyconfig.h", folder)).parent


def _offered(folder: Path) -> Path:
    """What python3.dll offers, as a library to link with."""
    from abi3info import DATAS, FUNCTIONS  # of the build alone

    names = sorted(str(symbol.name) for symbol in FUNCTIONS)
    data = sorted(f"{symbol.name} DATA" for symbol in DATAS)
    (folder / "python3.def").write_text(
        "\n".join(["LIBRARY python3.dll", "EXPORTS", *names, *data])
    )
    made = folder / "python3.lib"
    command = [*ZIG, "dlltool", "-m", "i386:x86-64", "-D", "python3.dll"]
    subprocess.run([*command, "-d", str(folder / "python3.def"), "-l", str(made)], check=True)
    return made


def _digest(content: bytes) -> str:
    return base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()


if __name__ == "__main__":
    main(sys.argv[1:])
