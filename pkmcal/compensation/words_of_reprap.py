"""Words of RepRapFirmware, after the G-code dictionary of its makers (docs.duet3d.com, 3.5).

A line may have several commands. M82 and M83 alone say whether E is relative; what is extruded
relatively counts in later absolute numbers in some versions and not in others.
"""

from pkmcal.compensation.gcode_dialect import Dialect, table

REPRAP = Dialect(
    title="RepRapFirmware",
    several=True,
    letters=frozenset("EF"),
    extrusion=("M82 M83",),
    adds_relative=False,
    texts=frozenset({"M117"}),
    remark=r'"[^"]*"?|;.*',
    words=table(
        followed="G0 G1 G20 G21 G90 G91 G92 G94 M82 M83",
        harmless="""
            G4 G10 G11 G17-G19 G40 G54 G60 G69 G80 M3-M5 M7-M9 M17 M20-M22 M25-M27 M30 M36-M39
            M42 M73 M80 M81 M85 M104-M120 M122 M135 M140-M144 M150 M155 M190 M191 M200-M205 M207
            M208 M220 M221 M226 M250 M260 M261 M280 M291-M293 M300-M309 M374 M400 M404-M409 M430
            M451-M453 M470-M472 M486 M500 M503 M505 M540 M550-M555 M557-M561 M564 M566-M568
            M570-M573 M575-M578 M580 M581 M583 M586-M589 M591-M593 M595-M599 M650 M651 M671 M672
            M710 M750-M756 M905-M907 M911 M913 M915-M918 M929 M950-M954 M956-M959 ECHO GLOBAL
            SET VAR
        """,
        homes="G28",
        moves="""
            G27 G30 M0-M2 G38.2 G38.3 G38.4 G38.5 M18 M84 M98 M125 M401 M402 M582 M585 M600 M673
            M675 M701-M703 M914 M997 M999 T
        """,
        curve="G2 G3 G5 G81-G89",
        origin="G31 G53 G55-G59 G59.1 G59.2 G59.3 G68 M206 M290 M425 M556 M579 M851",
        bed="G29 M375 M376",
        numbers="G32 M92 M350 M501 M502 M562 M563 M569 M574 M584 M665-M667 M669 M674",
        modes="M121",
        flow="M99 IF ELIF ELSE WHILE BREAK CONTINUE ABORT SKIP",
        program="M23 M24 M28 M29 M32 M606",
        times="G93",
    ),
)
