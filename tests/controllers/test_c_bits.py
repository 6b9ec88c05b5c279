"""One header, 1001 solves, the same bits from every compiler and processor."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest

import pkmcal as pk

from .c_headers import needed
from .test_c_header import eight, geared, lawful, pulleys_and_legs

# Poses from integers, so that they are exact; the hash (FNV-1a) of the bits of q and pose.
_PROGRAM = """\
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include "robot.h"
static uint64_t hash = UINT64_C(14695981039346656037);
static void add(const double *x, int count)
{
    unsigned char byte[8];
    int i, k;
    for (i = 0; i < count; i++) {
        uint64_t bits;
        memcpy(&bits, &x[i], 8);
        for (k = 0; k < 8; k++) byte[k] = (unsigned char)(bits >> 8 * k);
        for (k = 0; k < 8; k++) hash = (hash ^ byte[k]) * UINT64_C(1099511628211);
    }
}
int main(void)
{
    uint32_t seed = 1;
    int row, k, solved = 0;
    for (row = 0; row < 1001; row++) {
        double pose[6], q[SIZE] = {0};
        for (k = 0; k < 6; k++) {
            seed = seed * 1664525u + 1013904223u;
            pose[k] = (double)(seed >> 16) - 32768.0;
            pose[k] = robot_home[k] + pose[k] / (k < 3 ? 1024.0 : 262144.0);
        }
        if (robot_inverse(pose, q)) continue;
        add(q, SIZE);
        for (k = 0; k < 6; k++) pose[k] = robot_home[k];
        solved += !robot_forward(q, pose);
        add(pose, 6);
    }
    printf("%08lx%08lx %d\\n", (unsigned long)(hash >> 32), (unsigned long)(hash & 0xffffffffu),
           solved);
    return 0;
}
"""
# What a Cortex-M needs to start: a vector table and its floating-point unit switched on.
_START = """\
#include <stdint.h>
extern void _start(void);
extern uint32_t __stack_top;
void reset(void);
void fault(void);
void reset(void)
{
    *(volatile uint32_t *)0xE000ED88 |= 0xF << 20;
    __asm volatile("dsb\\n isb");
    _start();
    for (;;) {}
}
void fault(void) { for (;;) {} }
__attribute__((section(".vectors"), used)) void *const vectors[7] = {
    &__stack_top, reset, fault, fault, fault, fault, fault };
"""
_LINKER = """\
ENTRY(reset)
MEMORY { FLASH (rx) : ORIGIN = 0, LENGTH = 4M  RAM (rwx) : ORIGIN = 0x20000000, LENGTH = 4M }
SECTIONS {
  .text : { KEEP(*(.vectors)) *(.text*) *(.rodata*) KEEP(*(.init)) KEEP(*(.fini)) } > FLASH
  .ARM.exidx : { *(.ARM.exidx*) } > FLASH
  .init_array : { __preinit_array_start = .; KEEP(*(.preinit_array)) __preinit_array_end = .;
    __init_array_start = .; KEEP(*(.init_array*)) __init_array_end = .;
    __fini_array_start = .; KEEP(*(.fini_array*)) __fini_array_end = .; } > FLASH
  .data : { *(.data*) } > RAM
  .bss : { __bss_start__ = .; *(.bss*) *(COMMON) __bss_end__ = .; end = .; __end__ = .; } > RAM
  __stack_top = ORIGIN(RAM) + LENGTH(RAM);
}
"""
# WebAssembly has no library here: what the program needs of it.
_WASM_HEADERS = {
    "math.h": "#define sqrt __builtin_sqrt\n#define fabs __builtin_fabs\n"
    '#define NAN __builtin_nanf("")\n',
    "string.h": "#define memcpy __builtin_memcpy\n",
    "stdio.h": "void report(unsigned long, unsigned long, int);\n"
    "#define printf(format, high, low, solved) report(high, low, solved)\n",
}
_WASM_START = """\
const fs = require("fs");
const hex = (word) => (word >>> 0).toString(16).padStart(8, "0");
const report = (high, low, solved) => console.log(hex(high) + hex(low) + " " + solved);
WebAssembly.instantiate(fs.readFileSync("program"), { env: { report } })
    .then((made) => made.instance.exports.run());
"""
_WASM = "clang --target=wasm32 -O2 -std=c99 -fno-math-errno -mbulk-memory -nostdlib -isystem wasm"
_WASM += " -Dmain=run -Wl,--no-entry,--export=run,--allow-undefined"
_M7 = (
    "-mcpu=cortex-m7 -mthumb -mfpu=fpv5-d16 -mfloat-abi=hard --specs=rdimon.specs -T m7.ld start.c"
)
_QEMU_M7 = "qemu-system-arm -M mps2-an500 -nographic -monitor none -serial none"
_QEMU_M7 += " -semihosting-config enable=on,target=native -kernel program"
TARGETS = {
    "x86 gcc -O3": ("gcc -std=c99 -O3 -march=native", "./program"),
    "x86 gcc, GNU C": ("gcc -O2 -march=native", "./program"),
    "x86 clang": ("clang -std=c99 -O2 -march=native", "./program"),
    "aarch64": ("aarch64-linux-gnu-gcc -O2 -static", "qemu-aarch64 ./program"),
    "armhf": ("arm-linux-gnueabihf-gcc -O2 -static", "qemu-arm ./program"),
    "WebAssembly": (_WASM, "node wasm.js"),
    "Cortex-M7": (f"arm-none-eabi-gcc -O2 {_M7}", _QEMU_M7),
}


def printed(machine: str, build: str, start: str, folder: Path) -> str:
    """What the program prints when it is built and started so."""
    needed(build.split()[0], start.split()[0] if not start.startswith("./") else "gcc")
    robot = MACHINES[machine]()
    pk.export.c_header(robot, folder / "robot.h")
    (folder / "program.c").write_text(_PROGRAM.replace("SIZE", str(robot.n_actuators)))
    (folder / "start.c").write_text(_START)
    (folder / "m7.ld").write_text(_LINKER)
    (folder / "wasm.js").write_text(_WASM_START)
    (folder / "wasm").mkdir(exist_ok=True)
    for name, text in _WASM_HEADERS.items():
        (folder / "wasm" / name).write_text(text)
    command = [*build.split(), "-o", "program", "program.c"]
    if build == _WASM:
        needed("wasm-ld")
    else:
        command.append("-lm")
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    done = subprocess.run(start.split(), cwd=folder, check=True, capture_output=True, text=True)
    return done.stdout.strip()


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], str]:
    """Return a function that gives what x86 without optimization prints for a machine."""

    @cache
    def of_machine(machine: str) -> str:
        return printed(machine, "gcc -std=c99 -O0", "./program", tmp_path_factory.mktemp("x86"))

    return of_machine


# everything of its own, sine to arctangent; constraints; laws and their Newton's method; turns that
# suit two limbs; pulleys; chains
MACHINES = {
    "6-rus": lambda: pk.load("6-rus"),
    "3prs": lambda: pk.load("3prs"),
    "laws": lawful,
    "geared": lambda: geared(0.5),
    "pulleys": pulleys_and_legs,
    "least squares": eight,
    "chains": lambda: pk.load("trivariant"),
}
SOLVED = {"geared": 500}  # how many poses at least: most of these it cannot take


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize("target", TARGETS)
def test_bits_are_the_same(
    target: str, machine: str, reference: Callable[[str], str], tmp_path: Path
) -> None:
    want = reference(machine)
    assert int(want.split()[1]) > SOLVED.get(machine, 900)
    assert printed(machine, *TARGETS[target], tmp_path) == want


# processors with half precision: in gcc's GNU mode FLT_EVAL_METHOD is 16 for them
HALF = {
    "x86": "gcc -O2 -mavx512fp16",
    "aarch64": "aarch64-linux-gnu-gcc -O2 -mcpu=cortex-a76",
}


@pytest.mark.parametrize("number", ["double", "float"])
@pytest.mark.parametrize("build", HALF.values(), ids=HALF)
def test_compiles_for_processors_with_half_precision(
    build: str, number: Any, tmp_path: Path
) -> None:
    compiler, *options = build.split()
    needed(compiler)
    folder = {"cwd": tmp_path, "capture_output": True, "text": True, "check": False}
    (tmp_path / "empty.c").write_text("")
    ask = [compiler, *options, "-dM", "-E", "-include", "float.h", "empty.c"]
    macros = subprocess.run(ask, **folder)
    if macros.returncode:
        pytest.skip(f"{compiler} does not know {options[-1]}")
    if "#define FLT_EVAL_METHOD __FLT_EVAL_METHOD__" in macros.stdout:
        assert "#define __FLT_EVAL_METHOD__ 16" in macros.stdout
    pk.export.c_header(pk.load("6-rus"), tmp_path / "robot.h", number)
    (tmp_path / "robot.c").write_text('#include "robot.h"\n')
    done = subprocess.run([compiler, *options, "-c", "robot.c"], **folder)
    assert (done.returncode, done.stderr) == (0, "")
