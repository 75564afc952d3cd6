"""What the tests know of PDL2, by its manuals."""

from tests.programs.controllers import DialectFacts, Language

# Comau, PDL2 predefined variables: $GEN_OVR is the general override of the pendant ($ARM_OVR, $ARM_SPD_OVR may
# be given for one move by WITH, an assignment stays); SYS_CALL 'SAG' sets the general override
OVERRIDE = Language(
    motion=r"MOVE(?:FLY)?\b.*",
    knob=r"\$GEN_OVR := (?P<value>.*)",
    comment=r"--[^\r\n]*",
    forbidden=r"\$GEN_OVR|\$ARM_(SPD_|ACC_|DEC_)?OVR(\[\d+\])? *:=|SYS_CALL",
)
REFUSED = [
    "$DOUT[9] := TRUE",
    "other",
    "MOVE TO p1",
    "PULSE $DOUT[9] FOR 5",
    "$TOOL := t",
    "WAIT FOR $DIN[9]",
    "CALL other",
]
DIALECTS = {
    "pdl2": DialectFacts(
        given_back=r"\$(MOVE_TYPE|TERM_TYPE|FLY_TYPE|ORNT_TYPE|SPD_OPT)|start_at|now|via|goal|angles\[\d\]|PULSE",
        stop=r"^ *PAUSE$",
        wait=r"^ *WAIT FOR \$DIN\[7\]$",
        shown="WRITE LUN_CRT('pose 3 of 4: read the gauge, then press START', NL)",
    ),
}
