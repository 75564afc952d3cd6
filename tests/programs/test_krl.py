"""KRL stays inside the subset that every KRC and the public grammar of the language take."""

import dataclasses
import re
import tomllib
from pathlib import Path

import pytest
from lark import Lark, Token

import tests.programs.sessions as sessions
from planner.programs.dialect import dialect_root
from planner.programs.instructions import Centre, JointMove, LogAxes
from planner.programs.verification import import_map
from tests.programs.reading import write_program

GRAMMAR = Lark((Path(__file__).parent / "grammars" / "krl.lark").read_text(), parser="lalr")
SYSTEM = {
    "$STOPMESS", "$ADVANCE", "$OUT", "$IN", "$LOAD", "LOAD_DATA", "$RED_VEL", "$APO.CPTP", "$AXIS_ACT", "$ORI_TYPE",
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
        named = {str(t) for t in tree.scan_values(lambda t: isinstance(t, Token) and t.type == "SYSTEM")}
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


def test_the_reduction_changes_only_at_a_stop_and_ends_at_100() -> None:
    text = write_program(sessions.continuous(), "krl", "a")[0].text
    lines = [x for x in text.split("\r\n") if x and not x.startswith(";")]
    moves = [x for x in lines if x.startswith(("PTP", "$RED_VEL", "WAIT"))]
    for before, stop, line in zip(moves, moves[1:], moves[2:], strict=False):
        if line.startswith("$RED_VEL"):
            assert stop == "WAIT SEC 0", "the advance run stops, so that it acts on no move before"
            assert not before.endswith("C_PTP")
    reductions = [int(x.partition("=")[2]) for x in lines if x.startswith("$RED_VEL")]
    assert reductions[0] == reductions[-1] == 100
    assert min(reductions) < 100
    assert all(1 <= r <= 100 for r in reductions)


def test_a_leg_slower_than_one_percent_is_said_in_whole_numbers_of_both_words() -> None:
    """0.52 % of axis speed: neither word alone can say it."""
    text = write_program(sessions.static(), "krl", "a")[0].text
    said = dict(percent=100, reduction=100)
    driven = []
    for line in text.split("\r\n"):
        if match := re.fullmatch(r"BAS \(#VEL_PTP,(\d+) \)", line):
            said["percent"] = int(match[1])
        elif match := re.fullmatch(r"\$RED_VEL=(\d+)", line):
            said["reduction"] = int(match[1])
        elif line.startswith("PTP"):
            driven.append(said["percent"] * said["reduction"] / 100.0)
    planned = [m.axis_percent for m in sessions.static().moves]
    assert min(planned) < 1.0
    assert all(0.8 * p <= d <= p for d, p in zip(driven, planned, strict=True))


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


def test_a_move_after_a_centring_says_its_speed_anew() -> None:
    """CENTRE drives at percentages of its own, and gives back what it has changed of the program's."""
    program = sessions.static()
    plain = write_program(program, "krl", "a")[0].text
    called = tuple(
        x
        for i in program.instructions
        for x in ((i, Centre(1, i.pose)) if isinstance(i, JointMove) and i.pose else (i,))
    )
    text = write_program(dataclasses.replace(program, instructions=called), "krl", "a")[0].text
    legs = re.findall(r"(BAS \(#VEL_PTP,\d+ \)\r\n)?PTP ", text.partition("CENTRE (1,1)")[2])
    assert len(legs) > 4
    assert all(legs[:4]), "each of the next moves to a pose, and the one after the last"
    assert text.count("BAS (#VEL_PTP") > plain.count("BAS (#VEL_PTP")
    routine = (dialect_root() / "krl" / "centring.src.j2").read_text()
    (body,) = re.findall(r"GLOBAL DEF CENTRE(.*?)\nEND\n", routine, re.DOTALL)
    kept = re.findall(r"^(\w+)=(\$[\w.]+)$", body, re.MULTILINE)
    assert {variable for _, variable in kept} == {"$ADVANCE", "$RED_VEL", "$VEL.CP", "$ACC.CP"}
    assert all(f"\n{variable}={name}" in body for name, variable in kept)
