"""What the tests know of RAPID, by its manuals."""

from tests.programs.controllers import NUMBER, DialectFacts, Language

# ABB, RAPID instructions: SpeedRefresh changes the speed override of the motion task; VelSet has one of its own
OVERRIDE = Language(
    motion=r"Move(?:AbsJ|C) .*?,\s*\[(?P<v>[\d.]+),.*",
    modal={rf"VelSet {NUMBER},.*": 100.0},
    knob=r"SpeedRefresh (?P<value>.*)",
    comment=r"![^\r\n]*",
    forbidden="SpeedRefresh|SetSysData",
    statement=";",
)
REFUSED = [
    "SetDO do9, 1;",
    "Other;",
    "MoveL p1, v100, fine, tool0;",
    "tool1.tframe.trans.z := 5;",
    "IF TRUE THEN",
    "PulseDO do9;",
    "GripLoad load9;",
    "VelSet 100, 5000;",
    "CONST num a := 5;",
]
DIALECTS = {
    "rapid": DialectFacts(
        given_back=r"PLength|File|AccSet|GripLoad|SetDO|PulseDO|startAt|nPassed|passed\w+\{?.*|i",
        stop=r"^ *Stop;$",
        wait=r"^ *WaitDI di7, 1;$",
        shown='TPWrite "pose 3 of 4: read the gauge, then press Start";',
    ),
}
