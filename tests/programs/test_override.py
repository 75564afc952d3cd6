"""The override belongs to the operator: turned down at any moment it slows the robot, and no program turns it up."""

import re
from pathlib import Path

import numpy as np
import pytest

import tests.programs.sessions as sessions
from planner.programs.dialect import Dialect, dialect_names, dialects, load_dialect
from planner.programs.instructions import Program
from planner.programs.verification import ProgramMismatchError
from tests.programs.controllers import run_program, statements_of
from tests.programs.languages import override_of
from tests.programs.reading import verify, write_program
from tests.programs.test_linuxcnc import RS274, _canonical

DRIVEN = [d.name for d in dialects() if override_of(d.name)]
SESSIONS = [sessions.static, sessions.continuous, sessions.mixed, sessions.dense, sessions.led_by_hand]


def _programs(dialect: Dialect) -> list[Program]:
    return [*(s() for s in SESSIONS), *([sessions.with_circle()] if dialect.circle else [])]


def _text(program: Program, name: str) -> str:
    (text, *_) = [f.text for f in write_program(program, name, "a")]
    return text


@pytest.mark.slow
@pytest.mark.parametrize("name", DRIVEN)
def test_turned_down_at_any_statement_it_slows_all_that_follows(name: str) -> None:
    """From the statement on, every motion to the end has the share of the speed that the operator has asked for."""
    dialect = load_dialect(name)
    language = override_of(name)
    assert language is not None
    for number, program in enumerate(_programs(dialect)):
        text = _text(program, name)
        count = len(statements_of(language, text))
        whole = run_program(language, text)
        assert len(whole.speeds) == len(program.moves) + bool(dialect.speed.approach_first)
        assert min(whole.speeds) > 0.0
        rng = np.random.default_rng(number)
        for turn_at in rng.choice(count, min(count, 60), replace=False):
            percent = int(rng.integers(1, 100))
            turned = run_program(language, text, int(turn_at), percent)
            after = np.array(whole.statements) >= turn_at
            expected = np.where(after, percent / 100.0, 1.0) * np.array(whole.speeds)
            np.testing.assert_allclose(turned.speeds, expected, rtol=1e-12)


@pytest.mark.parametrize("name", dialect_names())
def test_no_program_reaches_for_the_override(name: str) -> None:
    """Neither a variable of the operator's override, nor a word that switches it off, stands in any program."""
    dialect = load_dialect(name)
    language = override_of(name)
    if language is None:  # a list, a trajectory or frames: numbers alone, of a controller without an override
        assert not dialect.override.knob
        return
    programs = [
        *_programs(dialect),
        *((sessions.resumable(), sessions.resumable(rounded=True)) if dialect.resume else ()),
    ]
    for program in programs:
        for file in write_program(program, name, "a"):
            found = [s for s in statements_of(language, file.text) if re.search(language.forbidden, s, re.IGNORECASE)]
            assert not found


@pytest.mark.parametrize("name", dialect_names())
def test_the_head_says_whose_the_override_is(name: str) -> None:
    dialect = load_dialect(name)
    text = _text(sessions.static(), name)
    said = _plain(re.sub(r"^ *\d+: *!", "", text, flags=re.MULTILINE))  # a remark of TP has a line number
    if dialect.override.knob:
        assert "is the operator s this program neither sets it nor switches it off" in said
        assert "the speeds are those at 100" in said
    else:
        assert dialect.override.note
    assert _plain(dialect.override.note) in said


def _plain(text: str) -> str:
    """Return the words alone, as not every language takes every sign in a remark."""
    return " ".join(re.sub(r"[^\w$.]+", " ", text).split())


BEYOND_100 = ("linuxcnc", "sinumerik", "bnr", "din66025")  # controllers whose feed override goes on, to 120 % or more


@pytest.mark.parametrize("name", BEYOND_100)
def test_where_the_knob_goes_beyond_100_the_head_says_so(name: str) -> None:
    assert "keep it at 100 % or below" in load_dialect(name).override.sentence


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("krl", "$OV_PRO=100"),
        ("krl", "$OV_APPL=100"),
        ("krl", "$RED_VEL=120"),
        ("rapid", "    SpeedRefresh 100;"),
        ("pdl2", "  $GEN_OVR := 100"),
        ("pdl2", "  $ARM_SPD_OVR := 100"),
        ("fanuc-tp", "   1:  OVERRIDE=100% ;"),
        ("urscript", "  rtde_set_watchdog(1)"),
        ("linuxcnc", "M50 P0"),
        ("linuxcnc", "M49"),
        ("sinumerik", "OVR=100"),
        ("din66025", "G63"),
        ("bnr", "G63"),
    ],
)
def test_a_program_that_reaches_for_it_is_not_released(name: str, line: str) -> None:
    """Before the first motion of the tour, in a program that is otherwise as written."""
    program = sessions.static()
    files = write_program(program, name, "a")
    text = files[0].text
    language = override_of(name)
    assert language is not None
    end = "\r\n" if "\r\n" in text else "\n"
    lines = text.split(end)
    motions = [k for k, x in enumerate(lines) if re.search(r"^(N\d+ )?.*\b(PTP|MoveAbsJ|MOVE|movej|G1|G101|J P)\b", x)]
    motions = [k for k in motions if not re.match(rf"\s*({language.comment})", lines[k])]
    lines.insert(motions[2], line)
    changed = type(files[0])(files[0].name, end.join(lines), files[0].encoding)
    with pytest.raises(ProgramMismatchError):
        verify(program, name, (changed, *files[1:]))


@pytest.mark.skipif(RS274 is None, reason="LinuxCNC's interpreter is not installed")
@pytest.mark.parametrize("found", ["M48", "M49", "M50 P0"])
@pytest.mark.parametrize("session", [sessions.static, sessions.dense])
def test_linuxcnc_itself_has_the_feed_override_on_throughout(found: str, session, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    """Whatever the program before has left: the knob works at every motion, and still at the end."""
    text = f"{found}\n(LOG,begin)\n{_text(session(), 'linuxcnc')}".replace("\nM72\n", "\nM72\n(LOG,end)\n")
    code, commands = _canonical(text, tmp_path)
    assert code == 0
    on, feeds = True, 0
    for command in commands[commands.index('LOG("begin")') : commands.index('LOG("end")')]:
        if re.match("(EN|DIS)ABLE_FEED_OVERRIDE", command):
            on = command.startswith("EN")
        elif command.startswith("STRAIGHT_FEED"):
            feeds += 1
            assert on
    assert on
    assert feeds == len(session().moves) + 1  # the axes that go first have a block of their own
