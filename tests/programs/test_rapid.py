"""The third-party RAPID checker reads every module."""

import numpy as np
import pytest

import planner.programs.verification as catalogue
import tests.programs.sessions as sessions
from planner.programs.verification import write_program

checker = pytest.importorskip(
    "rapidchecker.cli", reason="rapidchecker is not installed (pip install 'edbb-planner[dev]')"
)

pytestmark = pytest.mark.filterwarnings("ignore:.*deprecated")  # the checker's own use of pyparsing


def _check(text: str) -> tuple[int, str]:
    errors = checker.check_file(text)
    return len(errors), "\n".join(map(str, errors))


@pytest.mark.slow
@pytest.mark.parametrize(
    "program",
    [
        sessions.static(6, 1),
        sessions.static(7, 1),
        sessions.continuous(6, 2),
        sessions.with_controller(sessions.continuous(6, 1), tool=None, sync_output=None, gauge_input=None),
    ],
    ids=["static", "seven joints", "continuous", "no tool and no signals"],
)
def test_module_is_accepted(program) -> None:  # type: ignore[no-untyped-def]
    (file,) = write_program(program, "rapid", "edbb")
    code, message = _check(file.text)
    assert code == 0, message


@pytest.mark.slow
def test_module_in_parts_is_accepted(monkeypatch: pytest.MonkeyPatch) -> None:
    short = catalogue.load_dialect("rapid").model_copy(update={"part_lines": 20})
    monkeypatch.setattr(catalogue, "load_dialect", lambda _name: short)
    files = write_program(sessions.continuous(6, 3), "rapid", "edbb")
    assert len(files) >= 3
    for file in files:
        code, message = _check(file.text)
        assert code == 0, message


@pytest.mark.slow
def test_circles_are_accepted() -> None:
    (file,) = write_program(sessions.with_circle(), "rapid", "edbb")
    assert file.text.count("MoveC CalcRobT(") == 3
    code, message = _check(file.text)
    assert code == 0, message


@pytest.mark.parametrize(("old", "new"), [("fine,", "fine"), ("ENDPROC", "ENDPRO"), ("    Stop;", "   Stop;")])
def test_the_checker_would_notice(old: str, new: str) -> None:
    (file,) = write_program(sessions.static(6, 1), "rapid", "edbb")
    assert old in file.text
    code, _ = _check(file.text.replace(old, new, 1))
    assert code != 0


def test_seventh_joint_is_the_first_external_axis() -> None:
    (file,) = write_program(sessions.static(7), "rapid", "edbb")
    assert "[[0.0000,-10.0000,0.0000,0.0000,90.0000,0.0000],[5.0000,9E9,9E9,9E9,9E9,9E9]]" in file.text


def test_strings_fit_the_controller() -> None:
    (file,) = write_program(sessions.static(), "rapid", "edbb")
    strings = [line.split('"')[1] for line in file.text.splitlines() if "TPWrite" in line]
    assert strings
    assert all(len(s) <= 80 and "\\" not in s for s in strings)


def test_a_leg_that_only_turns_the_tool_is_not_driven_at_full_speed() -> None:
    (file,) = write_program(sessions.static(6, 1), "rapid", "edbb")
    moves = [line for line in file.text.splitlines() if "MoveAbsJ" in line]
    turning = [float(line.split("], [")[1].split(",")[1]) for line in moves]
    program = sessions.static(6, 1)
    legs = np.abs(np.diff([m.q_deg for m in program.moves], axis=0)).sum(axis=1)
    planned = legs / [m.duration_s for m in program.moves[1:]]
    np.testing.assert_allclose(turning[1:], planned, atol=0.0501)
