"""Options of what a machine that yields carries, and what yields where its file does not say."""

from __future__ import annotations

from typing import Annotated

import typer

Payload = Annotated[
    str | None,
    typer.Option(
        metavar="MASS",
        help="What a machine that yields carries, 5kg, in place of the payload its file states.",
    ),
]
PayloadAt = Annotated[
    str | None,
    typer.Option(metavar="X,Y,Z", help="Its centre of mass in the frame of the tool, mm."),
]
ToolForce = Annotated[
    str | None,
    typer.Option(metavar="X,Y,Z", help="What pulls at the tool, N, in the axes of the base."),
]
ToolLoads = Annotated[
    list[str] | None,
    typer.Option(
        "--load",
        metavar="TOOL=MASS",
        help="Of a program, what the machine carries with a tool: 'T1=0.8kg', or with its centre"
        " of mass in the frame of the tool 'T1=0.8kg,0,0,40'.",
    ),
]
Yielding = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME=C",
        help="What yields where the robot file does not say: 'offset*=5e-5', mm/N or rad/(N mm).",
    ),
]
