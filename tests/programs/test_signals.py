"""Nothing of the cell is touched that the cell did not name, and what the program leaves to others is said."""

import re
from dataclasses import replace

import numpy as np
import pytest

import tests.programs.sessions as sessions
from planner.programs.dialect import load_dialect
from planner.programs.instructions import JointMove, LogAxes, Program, Sync, WaitInput
from planner.programs.verification import program_notes
from tests.programs.reading import read_back, verify, write_program

NAMES = sessions.TURNED_DOWN
PASSING = [n for n in NAMES if load_dialect(n).blend.kind not in ("dense", "none")]
SESSIONS = [sessions.static, sessions.continuous, sessions.mixed, sessions.dense]
# every word by which one of the languages switches an output or waits for an input
TOUCHES = re.compile(
    r"\$A?_?D?OUT\b|\$A_OUT|\$D?IN\[|\$A_IN|PulseDO|SetDO|WaitDI|PULSE|^M10[01]$|\bM8[01]$|\bM6[2-6]\b|CONDITION|standard_digital",
    re.MULTILINE,
)


def _code(program: Program, name: str) -> str:
    """Return the program without its comments."""
    texts = (f.text for f in write_program(program, name, "a"))
    lines = (line for text in texts for line in text.splitlines())
    return "\n".join(re.sub(r"^N\d+ ", "", line) for line in lines if not re.match(r"\s*(;|!|#|--|\()", line))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.usefixtures("by_lines")
@pytest.mark.parametrize("session", SESSIONS)
def test_unnamed_signals_are_not_touched(name, session):
    named = session()
    unnamed = sessions.with_controller(named, sync_output=None, gauge_input=None)
    assert TOUCHES.search(_code(named, name))
    found = TOUCHES.search(_code(unnamed, name))
    assert found is None, found
    files = write_program(unnamed, name, "a")
    assert verify(unnamed, name, files).syncs == 0
    notes = " ".join(program_notes(unnamed, name))
    assert "controller.sync_output" in notes
    assert "controller.gauge_input" in notes
    words = re.sub(r"[^a-z_.]+", " ", files[0].text)
    assert "names no controller.sync_output" in words
    assert "names no controller.gauge_input" in words


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.usefixtures("by_lines")
def test_without_an_input_the_operator_says_when(name):
    """The pause before stands for it; where there is none, the program pauses of itself."""
    program = sessions.with_controller(sessions.static(), gauge_input=None)
    asked = sum(isinstance(i, WaitInput) for i in program.instructions)
    alone = replace(program, instructions=tuple(i for i in program.instructions if type(i).__name__ != "Pause"))
    pause = re.compile(r"^HALT$|^M0?0$|^ *Stop;$|^ *PAUSE$|^ *popup", re.MULTILINE)
    assert len(pause.findall(_code(alone, name))) == asked == 1
    assert len(pause.findall(_code(program, name))) == 2


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.usefixtures("by_lines")
@pytest.mark.parametrize("session", SESSIONS)
def test_named_signals_are_those_of_the_cell(name, session):
    texts = {}
    for output, gauge_input in ((37, 41), (38, 42)):
        program = sessions.with_controller(session(), sync_output=output, gauge_input=gauge_input)
        text = "\n".join(f.text for f in write_program(program, name, "a"))
        assert not [w for w in ("{output}", "{input}", "{what}", "{number}") if w in text]
        for number in (output, gauge_input):
            assert re.search(rf"(?<![\d.]){number}(?![\d.])", re.sub(r"-?\d+\.\d+", "", text)), number
        texts[output] = text
    assert texts[37] != texts[38]


def test_rapid_signals_have_names_of_a_stated_pattern():
    text = write_program(sessions.static(), "rapid", "s")[0].text
    assert "PulseDO \\PLength:=0.05, do5;" in text
    assert "WaitDI di7, 1;" in text
    head = " ".join(line.strip(" !") for line in text.partition("PROC main")[0].splitlines())
    assert "digital output do5, 50 ms: a signal of this name must be configured" in head
    assert "digital input di7" in head


@pytest.mark.parametrize("name", PASSING)
@pytest.mark.usefixtures("by_lines")
def test_axes_in_passing_are_logged_or_the_trace_is_named(name):
    program = sessions.continuous()
    notes = " ".join(program_notes(program, name))
    text = write_program(program, name, "a")[0].text
    told = load_dialect(name).trace in notes
    assert told == (not load_dialect(name).logs_passing)
    if told:
        assert "record them with" in " ".join(re.sub(r"[^a-z]+", " ", text).split())
    bare = replace(program, instructions=tuple(i for i in program.instructions if not isinstance(i, LogAxes)))
    assert load_dialect(name).trace not in " ".join(program_notes(bare, name))


@pytest.mark.parametrize("name", PASSING)
@pytest.mark.usefixtures("by_lines")
def test_a_log_without_an_output_and_an_output_without_a_log(name):
    program = sessions.continuous()
    syncs = sum(isinstance(i, Sync) for i in program.instructions)
    bare = replace(program, instructions=tuple(i for i in program.instructions if not isinstance(i, LogAxes)))
    assert read_back(name, write_program(bare, name, "a")).syncs == syncs
    silent = sessions.with_controller(program, sync_output=None)
    files = write_program(silent, name, "a")
    assert read_back(name, files).syncs == 0
    logged = {"krl": r"PASS_\w+ \( \) PRIO", "rapid": r"PassPose \d+;"}
    assert len(re.findall(logged.get(name, "$^"), files[0].text)) == (syncs if name in logged else 0)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.usefixtures("by_lines")
def test_what_cannot_be_selected_is_left_to_the_operator(name):
    notes = " ".join(program_notes(sessions.static(), name))
    text = write_program(sessions.static(), name, "a")[0].text
    by_hand = "select tool 1, base 0, load 2 by hand"
    assert (by_hand in notes) == (by_hand in text) == (name not in ("krl", "rapid"))
    assert "by hand" not in " ".join(
        program_notes(sessions.with_controller(sessions.static(), tool=None, base=None, load=None), name)
    )


def test_rapid_drives_the_measured_point():
    """Without a tool in the cell the module's own tooldata ends in it; a tool of the cell must."""
    program = replace(sessions.static(), map_mm=(40.0, -1.5, 100.25), mass_kg=1.2, com_mm=(1.0, 2.0, 30.0))
    own = write_program(sessions.with_controller(program, tool=None), "rapid", "s")[0].text
    (data,) = re.findall(r"PERS tooldata (\w+) := (\[.*\]);", own)
    assert data[0] == f"edbb_{sessions.PLAN_ID}"
    assert data[1] == "[TRUE,[[40.000,-1.500,100.250],[1,0,0,0]],[1.200,[1.000,2.000,30.000],[1,0,0,0],0,0,0]]"
    moves = sum(isinstance(i, JointMove) for i in program.instructions)
    assert own.count(f", {data[0]} \\WObj:=wobj0;") == moves
    assert "tool0" not in own
    given = write_program(program, "rapid", "s")[0].text
    assert "PERS tooldata" not in given
    assert given.count(", tool1 \\WObj:=wobj0;") == moves
    assert "[40.000,-1.500,100.250] mm in the flange frame" in given


def test_where_the_feed_is_of_the_tool_point_the_program_says_of_which():
    program = replace(sessions.static(), map_mm=(40.0, -1.5, 100.25))
    text = write_program(program, "bnr", "s")[0].text
    said = " ".join(line.strip("; ") for line in text.splitlines() if line.startswith(";"))
    assert "configure the measured point there, [40.000, -1.500, 100.250] mm" in said


def test_rapid_tooldata_without_a_mass_is_that_of_tool0():
    text = write_program(sessions.with_controller(sessions.static(), tool=None), "rapid", "s")[0].text
    assert "[0.001,[0.000,0.000,0.001],[1,0,0,0],0,0,0]]" in text
    assert "enter it before the first run" in text


def test_rapid_reads_the_axes_in_one_go_with_the_pulse():
    text = write_program(sessions.continuous(), "rapid", "s")[0].text
    (body,) = re.findall(r"PROC PassPose\(num pose\)(.*?)ENDPROC", text, re.DOTALL)
    assert body.index("CJointT()") < body.index("PulseDO") < body.index("passedPose")
    poses = np.array([int(n) for n in re.findall(r"^ +PassPose (\d+);", text, re.MULTILINE)])
    np.testing.assert_array_equal(poses, [1, 2, 3, 4])
    assert f"PERS jointtarget passedJoints{{{len(poses)}}} := [" in text
    assert re.search(r"FOR ", text) is None  # it would count down where nothing has been passed
    assert "where the corner path begins" in " ".join(program_notes(sessions.continuous(), "rapid"))
