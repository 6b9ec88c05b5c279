"""Words of LinuxCNC, after its documents: G-codes, M-codes, Order of Execution (2.9).

User-defined codes, M100 to M199, are programs that nobody here knows. It stops at a line of more
than 252 characters with those of its comments, of which one may be a carriage return.
"""

from pkmcal.compensation.gcode_dialect import Dialect, table

LINUXCNC = Dialect(
    title="LinuxCNC",
    block=True,
    newlines=True,
    behind=frozenset({"M0", "M1", "M2", "M30", "M60"}),
    remark=r"\([^()]*\)|;.*",
    letters=frozenset("FS"),
    inverse_time=True,
    longest=251,
    unclear={r"(?i)[(;][ \t]*py(,|run|reload)": "a comment that runs Python may move the machine"},
    takes="M6",
    takes_unseen=frozenset({"M61"}),
    words=table(
        followed="G0 G1 G20 G21 G80 G90 G91 G94 G95 M2 M30",
        harmless="""
            G4 G8 G17 G17.1 G18 G18.1 G19 G19.1 G28.1 G30.1 G40 G49 G54 G61 G61.1 G64 G69 G90.1
            G91.1 G92.1 G92.2 G96 G97 G98 G99 M0 M1 M3-M5 M7-M9 M19 M48-M53 M60-M68 M70 M71 T
        """,
        moves="G28 G30 M6 M100-M199",
        curve="""
            G2 G3 G5 G5.1 G5.2 G5.3 G33 G33.1 G38.2 G38.3 G38.4 G38.5 G41 G41.1 G42 G42.1
            G70-G74 G71.1 G71.2 G72.1 G72.2 G76 G81-G89
        """,
        origin="G7 G10 G43 G43.1 G43.2 G52 G53 G55-G59 G59.1 G59.2 G59.3 G92 G92.3",
        numbers="M428-M430",
        modes="M72 M73",
        flow="M98 M99",
        times="G93",
    ),
)
