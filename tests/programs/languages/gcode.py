"""What the tests know of G-code, by its manuals."""

from tests.programs.controllers import NUMBER, DialectFacts, Language

_G = r"(?:N\d+ )?"
# LinuxCNC, M codes: M48, M49 both overrides on and off, M50 P0 feed override off, M52 adaptive feed, M53 feed stop;
# SINUMERIK, programming manual: OVR, OVRRAP, OVRA of the program, $AC_OVR, $AA_OVR of synchronized actions, G63 and
# G33 to G35, G331, G332 with the override off, machine data $MN_ $MC_ $MA_; DIN 66025: G63
OVERRIDE = Language(
    motion=rf"{_G}.*\bG(?:1|101)\b.*",
    modal={rf".*\bF{NUMBER}.*": 0.0},
    knob=r".*\bOVR ?= ?(?P<value>.*)",
    off=rf"{_G}(?:M49|M50 ?P0)\b.*",
    on=rf"{_G}(?:M48|M50(?: ?P1)?)\b.*",
    comment=r";[^\r\n]*|\([^)\r\n]*\)",
    forbidden=r"\bM49\b|\bM50 ?P0|\bM5[1-3]\b|\bOVR|\$A[AC]_OVR|\bG(63|33|34|35|331|332)\b|\$M[NCA]_",
)
REFUSED = ["G0 X999", "G2 X1 Y1 I5", "G1 X1", "M3 S5000", "G92 X0", "M62 P9", "#1=5", 'CALL "X"', "G10 L2 P1 X5"]
DIALECTS = {
    "bnr": DialectFacts(
        given_back=r"G(161|90|40|53|126 R.*|04 .*)|M0?0|M30|M100|M101",
        stop=r"^M00$",
        wait=r"^M101$",
        shown="; pose 3 of 4: read the gauge, then press NC Start",
    ),
    "din66025": DialectFacts(
        given_back=r"G(71 G90|40 G53 D0|4 F.*)|M0|M30|M80|M81",
        stop=r"^N\d+ M0$",
        wait=r"^N\d+ M81$",
        shown="(pose 3 of 4: read the gauge, then press NC Start)",
    ),
    "linuxcnc": DialectFacts(
        stop=r"^M0$", wait=r"^M66 P7 L3", shown="(MSG,pose 3 of 4: read the gauge, then press Cycle Start)"
    ),
    "sinumerik": DialectFacts(
        given_back=r"G(40 G500 D0|90 G710|641 ADIS=.*|60|4 F.*)|ADIS|\$A_OUT\[5\]|\$AC_TIMER\[1\]|ID|M0|M30|R\[10\]",
        stop=r"^N\d+ M0$",
        wait=r"^N\d+ WHILE \$A_IN\[7\]==FALSE$",
        shown='MSG("pose 3 of 4: read the gauge, then press NC Start")',
    ),
}
