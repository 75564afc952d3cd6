"""KRL stays inside the subset that every KRC and the public grammar of the language take."""

import dataclasses
import re
import tomllib
from itertools import pairwise
from pathlib import Path

import pytest
from lark import Lark

import tests.programs.sessions as sessions
from planner.programs.instructions import LogAxes
from planner.programs.verification import import_map, write_program

GRAMMAR = Lark((Path(__file__).parent / "grammars" / "krl.lark").read_text(), parser="lalr")
SYSTEM = {
    "$STOPMESS", "$ADVANCE", "$OUT", "$IN", "$LOAD", "LOAD_DATA", "$OV_PRO", "$APO.CPTP", "$AXIS_ACT", "$ORI_TYPE",
    "$CIRC_TYPE", "$TOOL", "$BASE", "$NULLFRAME", "$VEL.CP", "$APO.CDIS",
}  # fmt: skip


@pytest.mark.parametrize(
    "program",
    [
        sessions.static(6),
        sessions.static(7),
        sessions.continuous(6),
        sessions.dense(6, 2500),
        sessions.resumable(),
        sessions.with_circle(),
        sessions.with_controller(sessions.with_circle(), tool=None, base=None),
        sessions.resumable(rounded=True),
    ],
    ids=["static", "seven joints", "continuous", "in parts", "resumable", "circle", "circle, no tool", "in passing"],
)
def test_every_file_is_of_the_grammar(program) -> None:  # type: ignore[no-untyped-def]
    for file in write_program(program, "krl", "edbb nj130, a long name for a small controller"):
        name = file.name.partition(".")[0]
        tree = GRAMMAR.parse(file.text)
        assert file.text.splitlines()[2] in (f"DEF {name} ( )", f"DEFDAT {name} PUBLIC")
        named = {str(t) for t in tree.scan_values(lambda t: t.type == "SYSTEM")}
        assert named <= SYSTEM


def test_log_row_is_read_by_the_import_map() -> None:
    data = write_program(sessions.static(), "krl", "a")[1].text
    assert data.count("POSE ") == 4
    after_run = data.replace("AX {A1 0.0,A2 0.0", "AX {E6AXIS: A1 -12.34567,A2 1.5E-04")
    pattern = tomllib.loads(import_map("krl", 6))["pattern"]
    rows = [m.groupdict() for m in re.finditer(pattern, after_run)]
    assert [row["pose"] for row in rows] == ["1", "2", "3", "4"]
    assert float(rows[0]["q1_deg"]) == -12.34567
    assert float(rows[0]["q2_deg"]) == 1.5e-4
    assert set(rows[0]) == {"pose", *(f"q{i}_deg" for i in range(1, 7))}


def test_override_changes_only_at_a_stop_and_is_given_back() -> None:
    text = write_program(sessions.continuous(), "krl", "a")[0].text
    lines = [x for x in text.split("\r\n") if x and not x.startswith(";")]
    moves = [x for x in lines if x.startswith(("PTP", "$OV_PRO"))]
    for before, line in pairwise(moves):
        if line.startswith("$OV_PRO"):
            assert not before.endswith("C_PTP")
    overrides = [x for x in moves if x.startswith("$OV_PRO") and "CAP_" not in x]
    assert overrides[0] == "$OV_PRO=OV_0123456789AB", "what a cancelled run has left is given back first"
    assert overrides[1] != "$OV_PRO=OV_0123456789AB"
    assert overrides[-1] == "$OV_PRO=OV_0123456789AB"
    assert lines.index("OV_0123456789AB=$OV_PRO") < lines.index(overrides[0])
    assert lines[lines.index("INTERRUPT OFF 20") + 2] == "OV_0123456789AB=0", "the next run keeps its own"
    assert not re.search(r"\$OV_PRO=\d", text)


@pytest.mark.parametrize("found", [1, 3, 30, 99, 100])
def test_override_is_a_part_of_the_one_found(found: int) -> None:
    """The printed expression, with KRL's whole-number division: never nothing, never more than found or planned."""
    text = write_program(sessions.continuous(), "krl", "a")[0].text
    scaled = re.findall(r"\$OV_PRO=\(\w+\*(\d+)\+99\)/100", text)
    assert scaled
    for percent in map(int, scaled):
        value = (found * percent + 99) // 100
        assert 1 <= value <= min(found, percent)
        assert value - 1 < found * percent / 100 <= value


def test_axes_in_passing_are_read_in_the_subprogram_that_pulses() -> None:
    source, data = write_program(sessions.mixed(), "krl", "a")
    main, _, passing = source.text.partition("GLOBAL DEF ")
    body = [x for x in passing.split("\r\n") if x]
    assert body[-3:-1] == ["LOG_0123456789AB[NUM_0123456789AB].AX=$AXIS_ACT", "PULSE ($OUT[5],TRUE,0.05)"]
    lines = main.split("\r\n")
    triggers = [i for i, x in enumerate(lines) if x.startswith("TRIGGER")]
    assert all(lines[i + 1].endswith("C_PTP") for i in triggers)
    poses = [int(x.split()[2]) for x in lines if re.fullmatch("; pose .* in passing", x)]
    rested = re.findall(r"LOG_\w+\[(\d+)\]\.AX=\$AXIS_ACT\r\nNUM_\w+=(\d+)", main)
    assert [(int(a), int(b)) for a, b in rested] == [(3, 3), (4, 4)]  # the two in passing filled rows 1 and 2
    assert [int(p) for p in re.findall(r"POSE (\d+)", data.text)] == [*poses, 1, 2]


def test_without_a_log_the_trigger_pulses_by_itself() -> None:
    program = sessions.continuous()
    bare = tuple(i for i in program.instructions if not isinstance(i, LogAxes))
    source, _ = write_program(dataclasses.replace(program, instructions=bare), "krl", "a")
    assert source.text.count("TRIGGER WHEN DISTANCE=1 DELAY=0 DO PULSE ($OUT[5],TRUE,0.05)") == 4
    assert "PASS_" not in source.text
