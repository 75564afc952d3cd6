"""What the tests know of KRL, by its manuals."""

from tests.programs.controllers import NUMBER, DialectFacts, Language

# KUKA, system variables of the KSS: $OV_PRO is the override of the pendant; others are $OV_JOG, $OV_ROB, $OV_APPL
OVERRIDE = Language(
    motion=r"(?:PTP|CIRC) .*",
    circle="CIRC .*",
    modal={rf"BAS ?\(#VEL_PTP,{NUMBER} ?\)": 100.0, rf"\$RED_VEL={NUMBER}": 100.0, rf"\$VEL\.CP={NUMBER}": 2.0},
    of_circle=((rf"\$VEL\.CP={NUMBER}",), (rf"BAS ?\(#VEL_PTP,{NUMBER} ?\)",)),
    knob=r"\$OV_PRO ?= ?(?P<value>.*)",
    forbidden=r"\$OV_(PRO|JOG|ROB|APPL)",
)
REFUSED = [
    "$OUT[9]=TRUE",
    "ASYPTP {E1 5}",
    "LIN {X 5}",
    "BAS (#TOOL,-5 )",
    "$TOOL=$NULLFRAME",
    "OTHER ( )",
    "IF TRUE THEN",
    "PULSE ($OUT[9],TRUE,1)",
    "$VEL.CP=3",
    "CWRITE(1,2)",
    "INTERRUPT ON 9",
    "DECL INT X=5",
]
DIALECTS = {
    "krl": DialectFacts(
        given_back=r"BAS ?\(#(INITMOV|ACC_PTP|VEL_PTP|TOOL|BASE)|\$(ADVANCE|APO\.\w+|VEL\.CP|ORI_TYPE|CIRC_TYPE"
        r"|TOOL|BASE|LOAD)"
        r"|\$OUT\[5\]|PULSE|INTERRUPT \w+|DISTANCE|DELAY|PRIO|\$RED_VEL",
        stop=r"^HALT$",
        wait=r"^WAIT FOR \$IN\[7\]$",
        shown="; pose 3 of 4: read the gauge, then press Start",
    ),
}
