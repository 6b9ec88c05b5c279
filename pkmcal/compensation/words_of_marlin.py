"""Words of Marlin, after its list of G-codes (marlinfw.org/meta/gcode, 2.1).

It reads one command a line. In Marlin 2 the last of G90, G91, M82 and M83 says whether E is
relative; in Marlin 1 it is with G91 or M83. Parentheses and lower case are read only where it was
built so. G80 maps the bed in some of its descendants.
"""

from pkmcal.compensation.gcode_dialect import Dialect, table

MARLIN = Dialect(
    title="Marlin",
    letters=frozenset("EFS"),
    extrusion=("either", "last"),
    capitals=True,
    texts=frozenset({"M16", "M23", "M28", "M30", "M32", "M33", "M117", "M118", "M928"}),
    words=table(
        followed="G0 G1 G20 G21 G90 G91 G92 M82 M83",
        harmless="""
            G4 G10 G11 G17-G19 G60 M0 M1 M3-M5 M7-M11 M16 M17 M20-M22 M25-M27 M30 M31 M42
            M43 M73 M75-M81 M85-M87 M100 M102 M104-M119 M120-M123 M126-M129 M140 M141 M143 M145
            M149 M150 M154 M155 M163-M166 M190-M193 M200-M205 M207-M211 M217 M220-M222 M226 M240
            M250 M255 M256 M260 M261 M280-M282 M300-M310 M351 M355 M380 M381 M400 M403-M407 M412
            M413 M430 M486 M500 M503-M505 M510-M512 M540 M569 M571-M575 M592 M593 M672 M710
            M862.1 M862.2 M862.3 M862.4 M862.5 M862.6 M900 M905-M919 M928 M951 M993-M995 M7219
        """,
        homes="G28",
        moves="""
            G12 G26 G27 G30-G32 G34 G35 G42 G61 G76 G425 M18 M48 M84 M125 M401 M402 M410 M524
            M600 M701 M702 M871 M997 M999 T
        """,
        curve="G2 G3 G5 G6 G38.2 G38.3 G38.4 G38.5",
        origin="G53-G59 G59.1 G59.2 G59.3 G92.1 G92.9 M206 M218 M290 M422 M425 M428 M851 M852",
        bed="G29 G80 M420 M421 M423",
        numbers="G33 M92 M350 M364 M501 M502 M665 M666",
        motor="M360-M363 M605",
        flow="M808 M810-M819",
        program="M23 M24 M28 M29 M32 M33",
    ),
)
