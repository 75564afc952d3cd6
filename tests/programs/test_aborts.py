"""An abort at any line, and the start after it: what was found at entry is there again, or was never changed."""

import re
from pathlib import Path

import pytest

import tests.programs.sessions as sessions
from planner.programs.dialect import dialect_names, load_dialect
from planner.programs.languages.statements import MotionStatement, Waiting
from planner.programs.verification import EXECUTIONS, write_program
from tests.programs.test_linuxcnc import RS274, _canonical

SESSIONS = [sessions.static(), sessions.continuous(), sessions.mixed(), sessions.dense(), sessions.resumable()]
CHANGES = re.compile(
    r"(?P<name>\$?[a-z_][\w$]*(?:\[[^\]]*\])?(?:\.\w+)*) ?(?::=|=(?!=))"
    r"|^(?P<word>AccSet|VelSet|GripLoad|SetDO|PulseDO|PULSE|BAS ?\(#\w+|INTERRUPT \w+|set_\w+|PAYLOAD|M\d+|G\d+.*)",
    re.IGNORECASE,
)
OWN = r"\w+_[0-9A-F]{12}(\[.*\])?(\.\w+)?|edbb_\w+"  # variables of the program, which bear its id
# What each controller takes back where a program is aborted, or what is the program's own. Nothing else may change.
#   RAPID (technical reference, AccSet, GripLoad, PulseDO): defaults as PP is moved to main; a pulse runs out
#   KRL (programming instructions of the KSS): BAS(#INITMOV) of every program sets $VEL, $ACC, $APO, $ADVANCE; TOOL,
#     BASE and LOAD are set by every program, interrupts end with it; $OV_PRO has a test of its own
#   PDL2 (language manual, predefined variables): of the program stack; values of a WITH clause hold for one move
#   SINUMERIK, DIN 66025, B&R: G functions as the machine data say at every reset (MD20150 GCODE_RESET_VALUES)
#   LinuxCNC has a test of its own; FANUC: every TP program selects its own frames and payload
# The output of the cell marks poses and is off beside that; the operator's variable says where a session starts.
GIVEN_BACK = {
    "rapid": r"PLength|File|AccSet|GripLoad|SetDO|PulseDO|startAt|nPassed|passed\w+\{?.*|i",
    "krl": r"BAS ?\(#(INITMOV|ACC_PTP|VEL_PTP|TOOL|BASE)|\$(ADVANCE|APO\.\w+|VEL\.CP|ORI_TYPE|CIRC_TYPE|TOOL|BASE|LOAD)"
    r"|\$OUT\[5\]|PULSE|INTERRUPT \w+|DISTANCE|DELAY|PRIO|\$OV_PRO",
    "pdl2": r"\$(MOVE_TYPE|TERM_TYPE|FLY_TYPE|ORNT_TYPE|SPD_OPT)|start_at|now|via|goal|angles\[\d\]|PULSE",
    "sinumerik": r"G(40 G500 D0|90 G710|641 ADIS=.*|60|4 F.*)|ADIS|\$A_OUT\[5\]|\$AC_TIMER\[1\]|ID|M0|M30|R\[10\]",
    "din66025": r"G(71 G90|40 G53 D0|4 F.*)|M0|M30|M80|M81",
    "bnr": r"G(161|90|40|53|126 R.*|04 .*)|M0?0|M30|M100|M101",
    "urscript": r"set_standard_digital_out|start_at|title|error|blocking",
    "fanuc-tp": r"(UFRAME|UTOOL)_NUM|PAYLOAD|R\[99\]|DO\[5\]|DI\[7\]|COMMENT|PROTECT|DEFAULT_GROUP|CONTROL_CODE|J\d",
}


@pytest.mark.parametrize("name", [n for n in dialect_names() if n != "linuxcnc"])
def test_nothing_is_changed_that_an_abort_leaves_changed(name: str) -> None:
    dialect = load_dialect(name)
    programs = [*SESSIONS, *([sessions.with_circle()] if dialect.circle else [])]
    allowed = re.compile(f"{GIVEN_BACK.get(name, '')}|{OWN}", re.IGNORECASE)
    moves = re.compile(rf"(^| )({dialect.reading.motion or 'no motion'})( |$)")
    for program in programs:
        texts = tuple(f.text for f in write_program(program, name, "a"))
        for statement in EXECUTIONS[dialect.reading.family](dialect).parse(texts):
            if isinstance(statement, MotionStatement | Waiting):
                continue
            said = " ".join(statement.text.split())
            for match in CHANGES.finditer(said):
                changed = match["name"] or match["word"]
                assert moves.search(said) or allowed.fullmatch(changed), f"{said}: {changed}"


class _Krl:
    """Runs the lines of a KRL program that touch the override; the variables of the .dat outlive a cancelled run."""

    def __init__(self, override: int) -> None:
        source, _ = write_program(sessions.continuous(), "krl", "a")
        body = source.text.partition("\r\nEND\r\n")[0]
        self.lines = [x for x in body.split("\r\n") if re.search(r"OV_|CAP_|^ENDIF|^PTP", x) and "INTERRUPT" not in x]
        self.values = {"OV_PRO": override, "OV": 0, "CAP": 100, "WAS": 100}
        self.driven: list[int] = []

    def run(self, lines: int | None = None) -> None:
        """Run so many lines, or all; whole numbers are divided as in KRL."""
        skipped = False
        self.driven = []
        for line in self.lines[:lines]:
            said = re.sub(r"\$|_[0-9A-F]{12}", "", line).replace("<>", "!=").replace("/", "//")
            said = said.replace(" OR ", " or ").replace(" AND ", " and ")
            if match := re.fullmatch("IF (.*) THEN", said):
                skipped = not eval(match[1], {}, self.values)
            elif said == "ENDIF":
                skipped = False
            elif said.startswith("PTP"):
                self.driven.append(self.values["OV_PRO"])
            elif not skipped:
                name, _, value = said.partition("=")
                self.values[name] = eval(value, {}, self.values)


@pytest.mark.parametrize("override", [100, 37, 3])
def test_krl_gives_the_override_back_at_the_start_after_a_cancelled_run(override: int) -> None:
    whole = _Krl(override)
    whole.run()
    assert whole.values["OV_PRO"] == override
    assert len(set(whole.driven)) > 1 or override == 3
    for cancelled_at in range(len(whole.lines)):
        robot = _Krl(override)
        robot.run(cancelled_at)
        robot.run(cancelled_at // 2)  # and cancelled once more
        robot.run()
        assert robot.values["OV_PRO"] == override
        assert robot.driven == whole.driven, "a scaled override is never scaled again"
        assert robot.values["OV"] == 0


def test_krl_keeps_an_override_that_somebody_has_set_since() -> None:
    robot = _Krl(100)
    robot.run(len(robot.lines) // 2)
    robot.values["OV_PRO"] = 7
    robot.run()
    assert robot.values["OV_PRO"] == 7
    assert max(robot.driven) <= 7


@pytest.mark.skipif(RS274 is None, reason="LinuxCNC's interpreter is not installed")
@pytest.mark.parametrize("found", ["M48\nG54\nG21", "M50 P0\nG55\nG20"])
def test_linuxcnc_gives_its_state_back(found: str, tmp_path: Path) -> None:
    """At the end the interpreter is as it was found, offsets were never touched, an aborted mark ends at the start."""
    (file,) = write_program(sessions.static(), "linuxcnc", "s")
    text = f"{found}\nG92 Y5\nG43.1 Z11\n(LOG,begin)\n{file.text}".replace("\nM72\n", "\nM72\n(LOG,end)\n")
    code, commands = _canonical(text, tmp_path)
    assert code == 0
    begin, end = (commands.index(f'LOG("{word}")') for word in ("begin", "end"))
    for kind in (
        "USE_LENGTH_UNITS",
        "SET_G5X_OFFSET",
        "SET_G92_OFFSET",
        "USE_TOOL_LENGTH",
        r"(EN|DIS)ABLE_FEED_OVERRIDE",
    ):
        before, after = ([c for c in commands[:at] if re.match(kind, c)] for at in (begin, end))
        assert before[-1:] == after[-1:]
    assert not [c for c in commands[begin:end] if c.startswith(("SET_G92", "USE_TOOL"))]
    assert next(c for c in commands if "OUTPUT_BIT(5)" in c).startswith("CLEAR")
    rows = [c for c in commands if re.match(r'LOG\("\d', c)]
    assert [float(q) for q in rows[0][5:-2].split(";")[1:]] == pytest.approx(sessions.angles(6, 4)[0], abs=1e-4)
