"""An abort at any line, and the start after it: what was found at entry is there again, or was never changed."""

import re
from pathlib import Path

import pytest

import tests.programs.sessions as sessions
from planner.programs.dialect import dialect_names, load_dialect
from planner.programs.languages.statements import MotionStatement, Waiting
from planner.programs.verification import EXECUTIONS
from tests.programs.languages import dialect_facts
from tests.programs.reading import write_program
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
#     BASE and LOAD are set by every program, interrupts end with it;
#     $RED_VEL is set by the program's own head and end: left below 100 it only slows others
#   PDL2 (language manual, predefined variables): of the program stack; values of a WITH clause hold for one move
#   SINUMERIK, DIN 66025, B&R: G functions as the machine data say at every reset (MD20150 GCODE_RESET_VALUES)
#   LinuxCNC has a test of its own; FANUC: every TP program selects its own frames and payload
# The output of the cell marks poses and is off beside that; the operator's variable says where a session starts.


@pytest.mark.parametrize("name", [n for n in dialect_names() if n != "linuxcnc"])
def test_nothing_is_changed_that_an_abort_leaves_changed(name: str) -> None:
    dialect = load_dialect(name)
    programs = [*SESSIONS, *([sessions.with_circle()] if dialect.circle else [])]
    allowed = re.compile(f"{dialect_facts(name).given_back}|{OWN}", re.IGNORECASE)
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
    ):
        before, after = ([c for c in commands[:at] if re.match(kind, c)] for at in (begin, end))
        assert before[-1:] == after[-1:]
    assert not [c for c in commands[begin:end] if c.startswith(("SET_G92", "USE_TOOL"))]
    overrides = [c for c in commands if re.match("(EN|DIS)ABLE_FEED_OVERRIDE", c)]
    assert overrides[-1].startswith("ENABLE"), "the knob stays the operator's, as M2 leaves it after every program"
    assert next(c for c in commands if "OUTPUT_BIT(5)" in c).startswith("CLEAR")
    rows = [c for c in commands if re.match(r'LOG\("\d', c)]
    assert [float(q) for q in rows[0][5:-2].split(";")[1:]] == pytest.approx(sessions.angles(6, 4)[0], abs=1e-4)
