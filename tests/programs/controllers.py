"""Small controllers that run programs with an operator at the override, each written from its language alone.

A controller knows how fast a motion is driven as a share of what the machine can: the program's own words, times the
override of the operator where it is switched on. A program that writes the override, or switches it off, changes that.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import prod


@dataclass(frozen=True)
class Language:
    """How one language says its speeds and reaches the operator's override; all are patterns of one statement.

    Attributes:
        motion: a motion; its groups are speeds said with it, ``t...`` are times.
        modal: words that hold until they are said anew, by their pattern, with the value that holds before.
        of_circle: names of modal words that only circles heed, and which of the others they do not.
        knob: a statement that sets the override, its value in ``value`` (a number, or an expression of variables).
        off, on: statements that switch the override off and on.
        forbidden: whatever reaches the operator's override, by the manual named beside.
    """

    motion: str
    modal: dict[str, float] = field(default_factory=dict)
    of_circle: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())
    circle: str = "$^"
    knob: str = "$^"
    off: str = "$^"
    on: str = "$^"
    comment: str = r";[^\r\n]*"
    forbidden: str = "$^"
    statement: str = "\n"


_NUMBER = r"(\d+(?:\.\d+)?)"
_G = r"(?:N\d+ )?"

LANGUAGES: dict[str, Language] = {
    # KUKA, system variables of the KSS: $OV_PRO is the override of the pendant; others are $OV_JOG, $OV_ROB, $OV_APPL
    "krl": Language(
        motion=r"(?:PTP|CIRC) .*",
        circle="CIRC .*",
        modal={rf"BAS ?\(#VEL_PTP,{_NUMBER} ?\)": 100.0, rf"\$RED_VEL={_NUMBER}": 100.0, rf"\$VEL\.CP={_NUMBER}": 2.0},
        of_circle=((rf"\$VEL\.CP={_NUMBER}",), (rf"BAS ?\(#VEL_PTP,{_NUMBER} ?\)",)),
        knob=r"\$OV_PRO ?= ?(?P<value>.*)",
        forbidden=r"\$OV_(PRO|JOG|ROB|APPL)",
    ),
    # ABB, RAPID instructions: SpeedRefresh changes the speed override of the motion task; VelSet has one of its own
    "rapid": Language(
        motion=r"Move(?:AbsJ|C) .*?,\s*\[(?P<v>[\d.]+),.*",
        modal={rf"VelSet {_NUMBER},.*": 100.0},
        knob=r"SpeedRefresh (?P<value>.*)",
        comment=r"![^\r\n]*",
        forbidden="SpeedRefresh|SetSysData",
        statement=";",
    ),
    # Comau, PDL2 predefined variables: $GEN_OVR is the general override of the pendant ($ARM_OVR, $ARM_SPD_OVR may
    # be given for one move by WITH, an assignment stays); SYS_CALL 'SAG' sets the general override
    "pdl2": Language(
        motion=r"MOVE(?:FLY)?\b.*",
        knob=r"\$GEN_OVR := (?P<value>.*)",
        comment=r"--[^\r\n]*",
        forbidden=r"\$GEN_OVR|\$ARM_(SPD_|ACC_|DEC_)?OVR(\[\d+\])? *:=|SYS_CALL",
    ),
    # FANUC, R-30iB basic operator's manual: OVERRIDE=...% ; system variables $MCR.$GENOVERRIDE, $MCR_GRP[].$PRGOVERRIDE
    "fanuc": Language(
        motion=r"\s*\d+:J P\[\d+\] (?:(?P<t>[\d.]+)sec|(?P<v>\d+)%).*",
        knob=r"\s*\d+:\s*OVERRIDE=(?P<value>\d+)%",
        comment=r"!.*",
        forbidden=r"OVERRIDE|\$MCR|\$SCR",
    ),
    # Universal Robots: the slider is set by RTDE (speed_slider_fraction), or by 'set speed' at port 30003
    "urscript": Language(
        motion=r"move[jc]\(.*v=(?:d2r\()?(?P<v>[\d.]+).*",
        knob=r".*speed_slider\w*\((?P<value>.*)\)",
        comment=r"#[^\r\n]*",
        forbidden=r"speed_slider|speed_fraction|set speed|socket_|rtde_",
    ),
    # LinuxCNC, M codes: M48, M49 both overrides on and off, M50 P0 feed override off, M52 adaptive feed, M53 feed stop;
    # SINUMERIK, programming manual: OVR, OVRRAP, OVRA of the program, $AC_OVR, $AA_OVR of synchronized actions, G63 and
    # G33 to G35, G331, G332 with the override off, machine data $MN_ $MC_ $MA_; DIN 66025: G63
    "gcode": Language(
        motion=rf"{_G}.*\bG(?:1|101)\b.*",
        modal={rf".*\bF{_NUMBER}.*": 0.0},
        knob=r".*\bOVR ?= ?(?P<value>.*)",
        off=rf"{_G}(?:M49|M50 ?P0)\b.*",
        on=rf"{_G}(?:M48|M50(?: ?P1)?)\b.*",
        comment=r";[^\r\n]*|\([^)\r\n]*\)",
        forbidden=r"\bM49\b|\bM50 ?P0|\bM5[1-3]\b|\bOVR|\$A[AC]_OVR|\bG(63|33|34|35|331|332)\b|\$M[NCA]_",
    ),
}


@dataclass
class Run:
    """What a controller has driven: share of the full speed of every motion, and before which statement each stood."""

    speeds: list[float] = field(default_factory=list)
    statements: list[int] = field(default_factory=list)


def statements_of(language: Language, text: str) -> list[str]:
    """Cut a program into its statements, without remarks."""
    bare = re.sub(language.comment, "", text)
    bare = re.sub(r"(ADVANCE|WITH [^\r\n]*|,)\r?\n\s*(?=WITH)", r"\1 ", bare)
    return [s for part in bare.split(language.statement) if (s := " ".join(part.split()))]


def run_program(
    language: Language, text: str, turn_at: int | None = None, turned_to: float = 100.0, switched_on: bool = True
) -> Run:
    """Run a program whose operator turns the override to ``turned_to`` [%] before statement ``turn_at``."""
    modal, variables = dict(language.modal), {"knob": 100.0}
    out = Run()
    for number, said in enumerate(statements_of(language, text)):
        if number == turn_at:
            variables["knob"] = turned_to
        if re.fullmatch(language.off, said):
            switched_on = False
        elif re.fullmatch(language.on, said):
            switched_on = True
        elif match := re.fullmatch(language.knob, said):
            variables["knob"] = _value(match["value"], variables)
        elif match := re.fullmatch(r"(\w+)=(\$OV_PRO|[\w(*+)/]+)", said):
            variables[match[1]] = _value(match[2], variables)
        for pattern in modal:
            if match := re.fullmatch(pattern, said):
                modal[pattern] = float(match[1])
        if re.fullmatch(language.motion, said):
            factor = variables["knob"] / 100.0 if switched_on else 1.0
            out.speeds.append(prod(_said(language, said, modal)) * factor)
            out.statements.append(number)
    return out


def _said(language: Language, said: str, modal: dict[str, float]) -> Iterator[float]:
    """Yield the factors that the program's words multiply the speed of one motion with."""
    round_words, straight_words = language.of_circle
    unheeded = straight_words if re.fullmatch(language.circle, said) else round_words
    yield from (value for pattern, value in modal.items() if pattern not in unheeded)
    match = re.fullmatch(language.motion, said)
    assert match is not None
    for name, value in match.groupdict().items():
        if value is not None:
            yield 1.0 / float(value) if name == "t" else float(value)
    yield from (float(v) for v in re.findall(r"\$(?:PROG_SPD_OVR|ARM_SPD_OVR|LIN_SPD) = ([\d.]+)", said))


def _value(expression: str, variables: dict[str, float]) -> float:
    """Return a number, a variable, or an expression of whole numbers."""
    text = expression.replace("$OV_PRO", "knob").replace("/", "//")
    try:
        return float(eval(text, {"__builtins__": {}}, {k: int(v) for k, v in variables.items()}))
    except (NameError, SyntaxError):
        return 0.0
