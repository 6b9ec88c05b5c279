"""Words of RepRapFirmware, after the G-code dictionary of its makers (docs.duet3d.com, 3.5).

A line may have several commands; behind one that runs a macro others are executed by some versions
and not by others. M82 and M83 alone say whether E is relative; what is extruded relatively counts
in later absolute numbers in some versions and not in others. A number that it has not, and so is
not here, runs a macro of that name. M109 selects a tool if none is, and M291 with axes lets them be
moved by hand. M37 simulates what follows. It passes over carriage returns. A file name or another
text that is not in quotes goes on to the end of the line, whatever commands may be in it. Of a line
its small boards read 100 characters, others 160 or 255.
"""

from pkmcal.compensation.gcode_dialect import AXES, OFFSETS, Dialect, Meaning, table
from pkmcal.compensation.words_of_printers import PRINTERS

_UNQUOTED = frozenset({
    "M20", "M30", "M36", "M36.1", "M39", "M98", "M118", "M374", "M408", "M409", "M470", "M471",
    "M472", "M505", "M550", "M551", "M586", "M587", "M588", "M589", "M929", "M955", "M956",
})  # fmt: skip
REPRAP = Dialect(
    title="RepRapFirmware",
    several=True,
    newlines=True,
    letters=frozenset("EF"),
    extrusion=("M82 M83",),
    adds_relative=False,
    texts=frozenset({"M117"}),
    unquoted=_UNQUOTED,
    remark=r'"[^"]*"?|;.*',
    rapid_lines=True,
    longest=100,
    takes_unseen=frozenset({"M109"}),
    by_letters={"G10": OFFSETS, "M291": (AXES, Meaning.MOVES)},
    words=table(
        PRINTERS,
        followed="G0 G1 G20 G21 G90 G91 G92 G94 M82 M83",
        homes="G28",
        harmless="""
            G54 G69 M36 M36.1 M39 M101 M103 M144 M201.1 M291 M292 M307 M374 M408 M409
            M450-M453 M470-M472 M505 M550 M551 M555 M557 M558 M561 M562 M564 M566-M568
            M570-M572 M576 M577 M581 M586-M589 M591 M595 M597-M599 M670 M671 M905 M915 M917
            M918 M929 M950 M952-M956 ECHO GLOBAL SET VAR
        """,
        moves="M0-M2 M98 M109 M226 M582 M585 M601 M673 M675 M703 M957",
        curve="G81-G89",
        origin="G31 G68 M556 M579 M594",
        bed="M375 M376",
        numbers="G32 M563 M569 M574 M584 M667 M669 M674",
        motor="M596",
        modes="M121",
        flow="M26 M99 ABORT BREAK CONTINUE ELIF ELSE IF SKIP WHILE",
        program="M37 M559 M560 M606 M916",
        times="G93",
    ),
)
