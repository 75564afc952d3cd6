"""What the tests know of FANUC TP, by its manuals."""

from tests.programs.controllers import DialectFacts, Language

# FANUC, R-30iB basic operator's manual: OVERRIDE=...% ; system variables $MCR.$GENOVERRIDE, $MCR_GRP[].$PRGOVERRIDE
OVERRIDE = Language(
    motion=r"\s*\d+:J P\[\d+\] (?:(?P<t>[\d.]+)sec|(?P<v>\d+)%).*",
    knob=r"\s*\d+:\s*OVERRIDE=(?P<value>\d+)%",
    comment=r"!.*",
    forbidden=r"OVERRIDE|\$MCR|\$SCR",
)
REFUSED = [
    "DO[9]=ON",
    "CALL OTHER",
    "L P[1] 100mm/sec FINE",
    "J P[1] 9sec CNT5 ACC150",
    "OVERRIDE=100%",
    "JMP LBL[1]",
    "RUN OTHER",
    "P[1]{",
    "R[99]=5",
    "UTOOL_NUM=7",
    "WAIT DI[9]=ON",
    "/POS",
]
DIALECTS = {
    "fanuc-tp": DialectFacts(
        given_back=r"(UFRAME|UTOOL)_NUM|PAYLOAD|R\[99\]|DO\[5\]|DI\[7\]|COMMENT|PROTECT|DEFAULT_GROUP|CONTROL_CODE|J\d",
        stop=r"^ *\d+:  PAUSE ;$",
        wait=r"WAIT DI\[7\]=ON",
        shown="MESSAGE[pose 3 of 4: read the]",
    ),
}
