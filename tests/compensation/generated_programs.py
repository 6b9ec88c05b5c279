"""Programs by chance, for each firmware: usual words, and words that mean something else."""

from __future__ import annotations

import random

HARMLESS = {
    "linuxcnc": """
        G4 P0.1 | M3 S200 | M5 | M8 | G64 P0.01 | G17 G40 G49 | (note X5) | ; G1 X9 | G91.1 |
        S300 | T2 | M64 P1
    """,
    "marlin": """
        G4 P20 | M106 S255 | M107 | M117 Hello (X5) G1 X9 | M204 P500 T500 | M73 P5 | ; G1 X9 |
        M104 S200 T0 | M207 S1 F2700 | G11 | M400 | (note) | M203 X500 Y500 | M900 K0.05 | %
    """,
    "reprap": """
        G4 P20 | M106 S255 | M117 Hello X5 | M204 P500 T500 | ; G1 X9 | M104 S200 |
        M207 S1 F2700 | G10 P0 S195 | M291 P"G1 X9" S2 | M400 | M120 | M566 X500 Y500 | (note) |
        echo "X5" | G11
    """,
    "klipper": """
        G4 P20 | M106 S255 | M117 Hello (X5) | M204 S500 | ; G1 X9 | M104 S200 | G10 | M400 |
        SET_PIN PIN=a VALUE=1 | EXCLUDE_OBJECT_START NAME=x_1 | SET_VELOCITY_LIMIT ACCEL=500 |
        BED_MESH_CLEAR | RESPOND MSG="X5" | G17 | M73
    """,
}
ELSEWHERE = {
    "linuxcnc": """
        G28 | G30 | T1 M6 | M101 | M150 P3
    """,
    "marlin": """
        G30 | T1 | M600 | M84 | G27 | G61 | PARK_HEAD | M401 | G12
    """,
    "reprap": """
        G30 | T1 | M98 P"a.g" | M84 | M401 | M600 | M1
    """,
    "klipper": """
        PARK_HEAD | T1 | START_PRINT BED=60 | M84 | M600 | NOZZLE_WIPE
    """,
}
ODD = {
    "linuxcnc": """
        G53 G0 Z50 | % | % |
        G1 X\u0663 | G1\u00a0X5 | G1 X5 ; (a) G1 Y5 | (a;b) X5 | G0 F-3 | T1 G1 X5 |
        G1 X6 G4 P1 | M62 P0 X3 | F0 | G90.1 G1 X3 | G1 X3 G91.1 | O77 | O77 G1 X5 | n4 | G61.1 X5 |
        G2 X1 Y1 I1 J0 | G81 X1 Y1 Z1 R2 | G92 X0 | G92.3 | G55 | G10 L2 P1 X1 | G10 L20 P1 X0 |
        G53 G0 X1 | G43 H1 | G52 X5 | G93 | G93 G1 X3 F2 | M72 | M98 P1 | G28 X0 Y0 | X1 G30 |
        G4 P0.5 G1 X20 F100 | M64 P1 X10 | G1 X#1 | /G1 X1 | G1 X[1] | o100 sub | G1 X1e-05 |
        G1 X5 G91 | G91 X3 | G90 | G20 | G21 | G95 | G94 | G1 Y3 M1 | G80 | X4 | G38.2 X1 |
        G1 X5 X6 | G0 G1 X2 | % | G1 (a (b) X5 | M30 | G64 | (G1 X5 | G1 X5 ; (a | N5 X3 |
        n9g1x4y5 | g 1 x 4 | G1.0 X3 | T3 M6 X5 | G28 Z5 | M429 | G5 X1 Y1 P1 Q1 | G41 D1 |
        M6 G1 X5 F90 | G70 | G71 Q100 X4 | G72.1 Q1 | G74 X1 |
        ;py,self.execute("G0 X9") | (pyrun,a.py) | ; PY,f(1) X3 | (pyramid) | G43.4 | G92.9 |
        F250 | G1 F333 | G1 X5 H3 | G1 X5 P2 | G7 | G33 Z-1 K1
    """,
    "marlin": """
        G1 X\u0663 |
        G1\u00a0X5 | M117 "a" G1 X5 | M118 ;G1 X5 | @pause | G1 X5 E | G1 X | M104 S1 G1 X5 |
        G10 L2 X1 | M82 G1 X5 | G91 X5 | T1 G1 X5 | N4 | G1 X5 // a | M203 X5 G1 X6 | m82 | g91 |
        G2 X1 Y1 I1 | G92 X0 | G92 | M206 X1 | M218 T1 X5 | M290 Z0.1 | M665 L360 | M92 X80 |
        M501 | M502 | M420 S1 | M808 L5 | M808 | M23 a.g | M24 | M32 a.g | G29 | G80 | G33 |
        G53 | G55 |
        G91.1 | G90.1 | g1 x9 | G1 X5 Y5 Z5 e3 | G1 X5 G91 | G90 G20 | G20 | G21 | M82 | M83 |
        G90 | G91 | X9 | G1 X1e-05 | G1X5Y6 | G01 X7 | G 1 X7 | N7 G1 X6 | N8G1 X6 | G1 X6*77 |
        G1 X5 (Z3) | (G1 X5) | G1 X5 X6 | G4 P5 G1 X20 | M999 X5 | FOO X5 | M605 S2 | M851 Z1 |
        M852 I1 | M360 | M810 G1 X5 | G28 X | G28 X0 Y0 | G92 E0 | G92 E5 | G42 I1 J1 |
        M207 S1 F100 | F500 | G1 F700 | G1 X5 H2 | G1 X4 S200 | M211 S0 | M350 X16 | G92 E0 X5 |
        G1 X\t5 Y5 | \tG1 X5 | N5\tG1 X5 | n5 G1 X5 | N 5 G1 X5 | G1 Y0X10 | G1 Y-0X9 Z3 |
        G1 Y10X3 | M117 a\\ | ; C:\\ | G1 X5 ; \\ | M665.1 L215 | M92.1 X80 | M306 T | G 91 |
        G1                                                                       X5 Y5 Z45 F700 |
        G54 | G60 | G5 X1 Y2 | T0 X5 | % | M26 S0 | M351 S1 X1 | M240 | M240 X5 | M915 | M916 X |
        M862.3 P "a" | M25 | M704 | G0 X20 Y-9 S90 | M81 | M43 T
    """,
    "reprap": """
        GG1 X5 | MG90 | TG91 |
        M98 P"a;b" G1 X5 | M30 "a" G1 X6 | M117 "x" G1 X7 | M118 S"a" G1 X4 | M117 a" ; G1 X8 |
        M291 P"a" S1 G1 X3 | G1 X5 T1 | T1 G1 X5 | M582 T1 | M118 G1 X9 | M36 "b" G1 X2 ; "G1 |
        G1 X\u0663 | G1\u00a0X5 | M117 x ; "y" G1 X5 | G1 X5 ; "a" G1 Y5 | M106 S1 M107 G1 X3 |
        G2 X1 Y1 I1 | G92 X0 | G92 | M206 X1 | M290 S0.1 | M665 R100 | M92 X80 | M501 | M502 |
        M375 | M376 H5 | M584 X0 | M32 "a" | M23 a | M24 | G29 | G29 S1 | G32 | G53 | G55 |
        G68 R5 | G1 H2 X5 | G1 H1 Z-9 | G1 R2 X0 Y0 Z5 | G1 S2 X5 | G1 P1 X5 | G91.1 | M121 |
        if x | while true | M579 X1.01 | M556 S100 X1 | G1 X1e-05 | G1 X5E3 | G1 X1E-5 |
        G28 G1 X20 | G28 G1 X2 Y3 Z40 | G1 X5 G91 | G90 G21 | M106 S9 G1 X7 | G1 X3 M107 |
        G1 X5 G1 X6 | G4 P5 G1 X20 | M64 P1 X10 | G20 | G21 | M82 | M83 | G90 | G91 | X9 |
        G1 X{1+2} | G1 X5 (Z3) | (a) G1 X5 | g1 x5 | G1 'x5 | N3 G1 X5 | G92 E0 | G92 E4 |
        G10 L2 P1 X5 | G10 P1 X5 | G10 L20 P1 Z0 | G31 Z2 | M98 P"X5" | M999 X5 | G28 X |
        G28 X0 Y0 | G1 F900 | F900 | G60 | G61 | M669 K1 | G01 X4 | G1.1 X4 | M569 P0 S1 | G93 |
        M42 X5 | M600 X5 | G30 P0 X1 Y1 | M291 P"a" S3 X1 | M109 S200 | M226 | M7 | G80 | G40 |
        M560 P"a" | M596 P1 | M594 P1 | M916 | G38.2 Z-5 | G28 M106 S1 | M98 P"a" G1 X3 Y2 Z40 |
        G 1 X7 | M 83 | N 3 G1 X5 | M37 S1 | M37 P"a" | M26 S0 | M665.1 R5 | (G1 X5) |
        M651 | M601 | M957 E"a" | M81 | M106 S1 (G91) | M106 S1 (a ; b) G91 | M107 (G20
    """,
    "klipper": """
        G2 X1 Y1 I1 | G92 X0 | G92 | SET_GCODE_OFFSET Z=0.1 | SET_KINEMATIC_POSITION X=10 |
        SET_SKEW XY=1,2,3 | SKEW_PROFILE LOAD=a | BED_MESH_PROFILE LOAD=a |
        RESTORE_GCODE_STATE NAME=a | FORCE_MOVE STEPPER=x DISTANCE=1 |
        MANUAL_STEPPER STEPPER=a MOVE=1 | SET_DUAL_CARRIAGE CARRIAGE=1 | G01 X5 | g1 x5 |
        G1 X5 G91 | G90 G21 | G20 | G21 | M82 | M83 | G90 | G91 | X9 | G1 X1e-05 | G1X5Y6E1 |
        G1 X5 (Z3) | (G1 X5) | ( G28 X ) | G4 P5 G1 X20 | PARK X=5 | park x=5 | M999 X5 | G28 X0 |
        G92 E0 | G92 E4 | SDCARD_PRINT_FILE FILENAME=a | M23 a | M24 | G1 X5 X6 | N3 G1 X5 |
        N3G1 X5 | G91.1 | G1 F900 | F900 | G1 X5 R2 | DELTA_CALIBRATE | save_gcode_state |
        G 1 X7 | M 83 | N 3 G1 X7 | # G1 X5 | G1 X 7 | SET_TMC_FIELD STEPPER=a FIELD=MRES VALUE=3 |
        M600 X5 | G92.1 | G1 X5*3 | set_skew xy=1 | SAVE_GCODE_STATE NAME=X | T0 X5 | G1.0 X5 |
        M25 | M81
    """,
}


def words(text: str) -> list[str]:
    """The words of one of the texts above."""
    return [each.strip() for each in text.split("|")]


def _one(text: str, rng: random.Random) -> str:
    return rng.choice(words(text))


def with_word(firmware: str, word: str, named: bool) -> str:
    """A program with a word in its middle; the move behind it may name all axes."""
    behind = "G1 X-30 Y4 Z45" if named else "G1 X-30"
    if firmware == "linuxcnc":
        begin, e = ["G21 G90 G94", "G0 X10 Y5 Z40 F1200"], [""] * 3
    else:
        begin = ["G28", "G21", "G90", "M82", "G92 E0", "G1 X10 Y5 Z40 F1200"]
        e = [" E5", " E9", " E12"]
    moves = [behind + e[0], "G1 X30 Y-20 F900" + e[1], "G0 Z30", "G1 X-30 Z50" + e[2]]
    return "\n".join([*begin, word, *moves]) + "\n"


def with_modes(modes: tuple[str, ...]) -> str:
    """A printer's program with modes in its middle; its moves stay in reach, relative or not."""
    begin = ["G28", "G21", "G90", "M82", "G92 E0", "G1 X1 Y5 Z40 F1200"]
    moves = ["G1 X-30 E5", "G1 X30 Y-2 E9", "G90", "M82", "G1 X-30 Z50 E12"]
    return "\n".join([*begin, *modes, *moves]) + "\n"


def program(firmware: str, rng: random.Random, odd: int = 0, joints: bool = False) -> str:
    """A program; with so many words that mean something else."""
    lines = ["G90 G21 G94"] if joints else [each for each in _begin(firmware, rng) if each]
    unit = 25.4 if "G20" in lines else 1.0
    relative = False
    lines.append(_move(firmware, rng, unit, relative, "XYZ", rapid=joints))
    for _ in range(rng.randrange(3, 12)):
        kind = rng.random()
        if kind < 0.55:
            axes = rng.choice(["X", "XY", "XYZ", "Z", "Y", "X" if joints else ""])
            lines.append(_move(firmware, rng, unit, relative, axes))
        elif kind < 0.75:
            lines.append(_one(HARMLESS[firmware], rng))
        elif kind < 0.85 and not joints:
            relative = not relative
            lines += _mode(firmware, rng, relative)
        elif kind < 0.93:
            home = firmware != "linuxcnc" and rng.random() < 0.3
            lines.append("G28" if home else _one(ELSEWHERE[firmware], rng))
            if relative:
                relative = False
                lines += _mode(firmware, rng, False)
            if firmware != "linuxcnc":
                lines.append("G92 E0")
            lines.append(_move(firmware, rng, unit, relative, "XYZ", rapid=joints))
    for _ in range(odd):
        lines.insert(rng.randrange(len(lines) + 1), _one(ODD[firmware], rng))
    if firmware == "linuxcnc":
        lines += rng.choice([[], ["M2"], ["M30"], ["G0 Z45 M30"]])
        if rng.random() < 0.4:
            lines = ["%", *rng.choice([[], ["O1000"], ["(PART 7)"]]), *lines, "%"]
            lines += rng.choice([[], ["G1 X9 Y9"]])
    end = rng.choice(["\n", "\r\n", "\r"] if firmware == "marlin" else ["\n", "\r\n"])
    mark = rng.choice(["", "", "\ufeff"])
    if mark and (not odd or rng.random() < 0.7):
        lines.insert(0, "" if lines[0] == "%" else rng.choice(["", "; made by hand"]))
    return mark + end.join(lines) + rng.choice(["", end])


def _begin(firmware: str, rng: random.Random) -> list[str]:
    if firmware == "linuxcnc":
        known = ["G21 G90 G94 G17"], ["G90", "G21"], ["G17 G40 G49 G80 G90 G94"], ["G20"]
        return rng.choice(known)
    inch = "G21" if firmware == "klipper" else "G20"
    units = rng.choice(["G21", "G21", "", inch])
    return ["G28", units, "G90", *rng.choice([["M82", "G92 E0"], ["M83"]])]


def _mode(firmware: str, rng: random.Random, relative: bool) -> list[str]:
    """G90 or G91, and for E what makes it certain."""
    if firmware == "linuxcnc":
        return ["G91" if relative else "G90"]
    e = rng.choice(["M82", "M83"]) if not relative else "M83"
    return ["G91" if relative else "G90", e, *(["G92 E0"] if e == "M82" else [])]


def _move(
    firmware: str,
    rng: random.Random,
    unit: float,
    relative: bool,
    axes: str,
    rapid: bool | None = None,
) -> str:
    """A G0 or G1; targets stay where the machine of the tests reaches."""
    words = []
    for axis in axes:
        low, high = {"X": (-35, 35), "Y": (-35, 35), "Z": (20, 60)}[axis]
        low, high = (-2, 2) if relative else (low, high)
        digits = rng.choice([0, 1, 3, 4])
        text = f"{rng.uniform(low, high) / unit:.{digits}f}"
        text = text.replace("0.", ".", 1) if rng.random() < 0.2 and text.startswith("0.") else text
        words.append(axis + text)
    straight = not rapid and (rng.random() < 0.75 or rapid is False)
    if firmware != "linuxcnc" and straight and rng.random() < 0.5:
        words.append(f"E{rng.uniform(-2, 5):.3f}")
    if rapid is not None or rng.random() < 0.4:
        words.insert(rng.randrange(len(words) + 1), f"F{rng.choice([300, 1200, 2400.5])}")
    rng.shuffle(words)
    code = "G1" if straight else "G0"
    if firmware in ("linuxcnc", "reprap", "marlin") and rng.random() < 0.2:
        code = code.replace("G", "G0")
    number = f"N{rng.randrange(1, 900)} " if rng.random() < 0.15 else ""
    gap = rng.choice([" ", " ", "  ", "\t"]) if firmware != "marlin" else rng.choice([" ", "  "])
    text = number + gap.join([code, *words]) + rng.choice(["", "", " ; note X9", ";(X3)"])
    if firmware == "linuxcnc":
        text = text.lower() if rng.random() < 0.1 else text
        text = text.replace(" ", "") if rng.random() < 0.1 and ";" not in text else text
        text = text + rng.choice(["", " (at X1)", " M8", " S400"]) if ";" not in text else text
    return text
