"""Words of Marlin, after its list of G-codes (marlinfw.org/meta/gcode, 2.1).

It reads one command a line, of 95 characters. In Marlin 2 the last of G90, G91, M82 and M83 says
whether E is relative; in Marlin 1 it is with G91 or M83. Parentheses and lower case are read only
where it was built so. G80 maps the bed in some of its descendants.
"""

from pkmcal.compensation.gcode_dialect import Dialect, table
from pkmcal.compensation.words_of_printers import PRINTERS

MARLIN = Dialect(
    title="Marlin",
    letters=frozenset("EFS"),
    extrusion=("either", "last"),
    capitals=True,
    texts=frozenset({"M16", "M23", "M28", "M30", "M32", "M33", "M117", "M118", "M928"}),
    rapid_lines=True,
    repeated=frozenset("S"),
    longest=95,
    unclear={
        r"^[^;]*\t": "a tab is no space to Marlin, which passes over what is beside it",
        r"\\$": "some versions read on behind a \\ that ends a line, also that of a comment",
        r"^[^;]*G0*[01](?!\d).*[A-Z] *[-+.\d]+X": "X right behind a number may be read with it, in"
        " base 16: put a space before it",
    },
    words=table(
        PRINTERS,
        followed="G0 G1 G20 G21 G90 G91 G92 M82 M83",
        homes="G28",
        harmless="""
            M0 M1 M7-M11 M16 M31 M34 M75-M79 M86 M87 M100 M109 M113 M121 M123 M126-M129
            M145 M149 M154 M155 M163-M166 M192 M193 M202 M209 M211 M217 M222 M226 M250 M255
            M256 M281 M282 M310 M355 M380 M381 M403 M405 M406 M412-M414 M430 M485 M504
            M510-M512 M569 M603 M710 M876 M900 M907-M910 M914 M919 M928 M993-M995 M7219
        """,
        moves="""
            G12 G26 G27 G31 G32 G34 G35 G42 G61 G76 G425 M43 M48 M240 M306 M410 M524 M704-M706
            M862.1 M862.2 M862.3 M862.4 M862.5 M862.6 M871 M915-M918
        """,
        curve="G6",
        origin="G54 G92.1 G92.9 M218 M422 M428 M852",
        bed="G80 M420 M421 M423",
        numbers="G33 M351 M364",
        motor="M360-M363 M605",
        flow="M26 M808 M810-M819",
        program="M33",
    ),
)
