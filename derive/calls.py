"""The calls of the core that are one formula a row: prototype, loop and binding from a declaration.

A declaration names what goes in and what comes out, with the width of a row, and the function of a
block of lanes between them: one that is derived here, or one of csrc/. From it follow the prototype
in ``row_calls.h``, the loop in ``row_loops.h`` and the line of `table` by which Python calls it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import prod
from typing import Literal

from . import frames, laws, limb_functions, limbs, measured, pulleys, tpr2tps
from .emit import Function

Given = Literal["each", "either", "shared"]
MARK: dict[Given, str] = {"each": "", "either": "*", "shared": "!"}


@dataclass(frozen=True)
class Input:
    """An array the call reads.

    Attributes
    ----------
    name : str
        In C.
    width : int
        Numbers of a row.
    given : {"each", "either", "shared"}
        A row for each row of the call, or one for all, or either, by a stride.
    used : int or None
        How many of them the formula takes, all by default.
    scalar : bool
        Whether the formula takes the number itself, and no array of one.
    """

    name: str
    width: int
    given: Given = "each"
    used: int | None = None
    scalar: bool = False


@dataclass(frozen=True)
class Output:
    """An array the call writes, and the shape of a row; () is a number."""

    name: str
    shape: tuple[int, ...]

    @property
    def width(self) -> int:
        """Numbers of a row."""
        return prod(self.shape)


@dataclass(frozen=True)
class Call:
    """A call that is one formula a row."""

    name: str
    doc: str
    lanes: str
    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...]

    def prototype(self) -> str:
        """How C declares it."""
        parts = ["ptrdiff_t n"]
        for each in self.inputs:
            parts.append(f"const double *{each.name}")
            if each.given == "either":
                parts.append(f"ptrdiff_t {each.name}_stride")
        parts += [f"double *{each.name}" for each in self.outputs]
        return _wrapped(f"int CALL({self.name})(", parts, ")")

    def loop(self) -> str:
        """The call: rows gathered, the formula, its results scattered."""
        shared = [each for each in self.inputs if each.given == "shared"]
        by_row = [each for each in self.inputs if each.given != "shared"]
        lines = [self.prototype(), "{"]
        for each in shared:
            count = each.used or each.width
            lines.append(f"    real lane_{each.name}[{count}];")
            lines.append(
                f"    for (int k = 0; k < {count}; k++) lane_{each.name}[k] = fill({each.name}[k]);"
            )
        own = [f"lane_{each.name}[{each.used or each.width}]" for each in by_row]
        own += [f"lane_{out.name}[{out.width}]" for out in self.outputs]
        lines += [
            "    for (ptrdiff_t first = 0; first < n; first += LANES) {",
            "        ptrdiff_t row[LANES];",
            _wrapped("        real ", own, ";"),
            "        const int count = block_rows(first, n, row);",
        ]
        for each in by_row:
            stride = f"{each.name}_stride" if each.given == "either" else str(each.width)
            used = each.used or each.width
            lines.append(
                f"        gather_row({each.name}, {stride}, {used}, row, lane_{each.name});"
            )
        passed = [f"lane_{each.name}" + "[0]" * each.scalar for each in self.inputs]
        passed += [f"lane_{out.name}" for out in self.outputs]
        lines.append(_wrapped(f"        {self.lanes}(", passed, ");"))
        for out in self.outputs:
            width = out.width
            lines.append(
                f"        scatter_row(lane_{out.name}, {width}, {out.name}, {width}, row, count);"
            )
        return "\n".join([*lines, "    }", "    return 0;", "}", ""])

    def entry(self) -> str:
        """Its line of the table that Python reads."""
        inputs = " ".join(f"{each.name}:{each.width}{MARK[each.given]}" for each in self.inputs)
        outputs = " ".join(f"{each.name}:{','.join(map(str, each.shape))}" for each in self.outputs)
        return f"{self.name} {inputs} -> {outputs}"


def formula(
    name: str,
    doc: str,
    function: Callable[[], Function],
    names: str,
    shapes: tuple[tuple[int, ...], ...],
    given: dict[str, Given] | None = None,
) -> Call:
    """A call of a derived function; `names` are its arguments' in C, in their order."""
    made = function()
    called = names.split()
    inputs = [
        Input(own, argument.size or 1, (given or {}).get(own, "each"), scalar=not argument.size)
        for own, argument in zip(called, made.inputs, strict=False)
    ]
    outputs = [Output(own, shape) for own, shape in zip(called[len(inputs) :], shapes, strict=True)]
    for output, (argument, _) in zip(outputs, made.outputs, strict=True):
        if output.width != (argument.size or 1):
            raise ValueError(f"{name}: {output.name} is no array of {argument.size} numbers")
    return Call(name, doc, f"FN({made.name})", tuple(inputs), tuple(outputs))


def calls() -> list[Call]:
    """Every call that is one formula a row."""
    matrix = Input("motion", 16, used=12)
    return [
        formula("compose", "A followed by B", frames.compose, "a b out", ((6,),),
                {"a": "either", "b": "either"}),
        formula("invert", "the inverse of A", frames.invert, "a out", ((6,),)),
        formula("compose_rates", "rates of A T C by those of T", frames.rates,
                "a pose c composed rates", ((6, 6),), {"a": "shared", "c": "either"}),
        formula("compose_twists", "twists of A T C by those of T", frames.twists,
                "a pose c twists", ((6, 6),), {"a": "shared", "c": "shared"}),
        formula("points", "targets of the platform as points of the base, with their derivatives by"
                " the twist and by the target", measured.point,
                "pose target point by_twist by_target", ((3,), (3, 6), (3, 3)),
                {"target": "either"}),
        formula("seen_points", "points of the base in a frame, with their derivatives by the frame"
                " and by the point", measured.seen,
                "frame point seen by_frame by_point", ((3,), (3, 6), (3, 3)), {"frame": "shared"}),
        formula("distances", "distances from anchors of the base to targets of the platform less a"
                " zero, with their derivatives by the twist, the target and the anchor",
                measured.distance,
                "pose target anchor zero distance by_twist by_target by_anchor",
                ((), (6,), (3,), (3,)),
                {"target": "either", "anchor": "either", "zero": "either"}),
        formula("between", "distances between two places of a target of the platform, with their"
                " derivatives by both twists and by the target", measured.between,
                "pose other target distance by_twist by_other by_target",
                ((), (6,), (6,), (3,)), {"target": "either"}),
        formula("touched_points", "points of the base in the axes of artefacts, with their"
                " derivatives by the artefact and by the point", measured.touched,
                "artefact point inside by_artefact by_point", ((3,), (3, 6), (3, 3)),
                {"artefact": "either"}),
        formula("tilts", "how far the axes of sensors point up, with the derivatives by the"
                " turning, the mounting and the vertical", measured.tilt,
                "pose mounting up tilt by_turn by_mounting by_up",
                ((2,), (2, 3), (2, 3), (2, 3)), {"mounting": "either", "up": "either"}),
        formula("pixels", "where cameras see corners of boards, with the derivatives by the board's"
                " twist at the camera, by the lens and by the size of the board, and how far"
                " before the camera they are", measured.pixel,
                "board corner lens size seen by_twist by_lens by_size depth",
                ((2,), (2, 6), (2, 9), (2,), ()), {"lens": "either", "size": "either"}),
        formula("law_drive", "the way of drives without corrections, with its derivatives by"
                " q, gain, quadratic, spool, buildup, and twice by q", laws.drive,
                "x way by_x bend", ((), (5,), ())),
        formula("law_drive_inverse", "the reading of drives at a way, without corrections",
                laws.drive_inverse, "x q", ((),)),
        formula("law_harmonic", "errors with a period, with their derivatives by q, cos, sin, and"
                " twice by q", laws.harmonic, "x error by_x bend", ((), (3,), ())),
        formula("law_segment", "corrections of a table, with their derivatives by q and by the two"
                " numbers beside", laws.segment, "x error by_x", ((), (3,))),
        formula("pulley", "cables over swivelling pulleys: their lengths, by the end and by radius"
                " and tilts, twice by the end; and the swivel angles, by the same", pulleys.pulley,
                "own frame joint length by_joint by_own bend swivel swivel_by_joint swivel_by_own",
                ((), (3,), (3,), (3, 3), (), (3,), (3,)), {"own": "either", "frame": "either"}),
        formula("strand", "straight parts of cables: their lengths, by the end and twice by it",
                pulleys.strand, "joint length by_joint bend", ((), (3,), (3, 3))),
        *(_work_at_anchor(driver) for driver in limbs.DRIVERS if driver.moves),
        formula("tpr2tps_lengths", "2TPR&2TPS: eq. 8", tpr2tps.lengths, "size free lengths",
                ((4,),), {"size": "shared"}),
        formula("tpr2tps_jacobian", "2TPR&2TPS: eq. 12", tpr2tps.by_free, "size free jacobian",
                ((4, 4),), {"size": "shared"}),
        Call("exp", "the motion by a twist (omega, v)", "exp_row",
             (Input("twist", 6),), (Output("motion", (4, 4)),)),
        Call("log", "the twist of a motion", "log_row", (matrix,), (Output("twist", (6,)),)),
        Call("adjoint", "how twists move along", "adjoint_row", (matrix,),
             (Output("adjoint", (6, 6)),)),
        Call("motion_pose", "x y z alpha beta gamma of a motion", "motion_pose_row", (matrix,),
             (Output("pose", (6,)),)),
        Call("exp_jacobian", "dT T^-1 by dtwist, at the twist", "exp_jacobian_row",
             (Input("twist", 6),), (Output("jacobian", (6, 6)),)),
        Call("log_jacobian", "dtwist by dT T^-1, at the twist", "log_jacobian_row",
             (Input("twist", 6),), (Output("jacobian", (6, 6)),)),
        Call("joint_motions", "the motion by joint errors dx dy dz dphi dtheta dpsi at a point",
             "joint_motion_row", (Input("error", 6), Input("point", 3)),
             (Output("motion", (4, 4)),)),
    ]  # fmt: skip


def _work_at_anchor(driver: limbs.Driver) -> Call:
    """What a force at the anchor of a limb does as its numbers change."""
    return formula(
        f"{driver.name}_work", f"work of forces at the anchors of a limb with a {driver.name}, by"
        " the actuator and by the limb's numbers",
        lambda: limb_functions.carry(driver), "q numbers force frame by_q by_number",
        ((), (len(limbs.SLOTS),)), {"numbers": "either", "frame": "shared"},
    )  # fmt: skip


def prototypes() -> str:
    """What calls.h includes."""
    return "\n".join(f"/* {_comment(each)} */\n{each.prototype()};\n" for each in calls())


def loops() -> str:
    """What core.h includes."""
    return "\n".join(each.loop() for each in calls())


def table() -> str:
    """The binding: a line for each call, its inputs and outputs with the width of a row.

    ``name:3`` is an array with a row for each row of the call, ``name:3*`` one with a stride, which
    may be a row for all, and ``name:3!`` a row for all; of an output ``name:3,6`` is the shape.
    """
    lines = [each.entry() for each in calls()]
    return "#define ROW_CALLS \\\n" + " \\\n".join(f'    "{line}\\n"' for line in lines) + "\n"


def _comment(call: Call) -> str:
    inputs = ", ".join(f"{each.name} {_shape(each)}" for each in call.inputs)
    outputs = ", ".join(
        f"{each.name} ({', '.join(['n', *map(str, each.shape)])})" for each in call.outputs
    )
    words = f"{inputs} -> {outputs}: {call.doc}.".split(" ")
    lines, line = [], ""
    for word in words:
        if len(line) + len(word) > 92:
            lines.append(line)
            line = ""
        line += (" " if line else "") + word
    return "\n * ".join([*lines, line])


def _shape(each: Input) -> str:
    if each.given == "shared":
        return f"({each.width})"
    return f"(n, {each.width})" + (f" or ({each.width})" if each.given == "either" else "")


def _wrapped(head: str, parts: list[str], tail: str) -> str:
    """`head`, the parts with commas, `tail`, broken at 100 characters and indented."""
    lines = [head]
    for i, part in enumerate(parts):
        piece = part + (tail if i == len(parts) - 1 else ",")
        if len(lines[-1]) + 1 + len(piece) > 100:
            lines.append(" " * len(head) + piece)
        else:
            lines[-1] += ("" if lines[-1] == head else " ") + piece
    return "\n".join(lines)
