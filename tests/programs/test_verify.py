"""A program that differs from the plan in anything that matters is not released."""

import dataclasses
import re

import pytest

import tests.programs.sessions as sessions
from planner.common.errors import InputError
from planner.programs.dialect import dialects, load_dialect
from planner.programs.instructions import JointMove, Pause, Program
from planner.programs.rendering import ProgramFile
from planner.programs.verification import ProgramMismatchError, read_texts
from tests.programs.reading import blends, read_back, verify, write_program

NAMES = [d.name for d in dialects()]


def _edited(files: tuple[ProgramFile, ...], old: str, new: str, count: int = 1) -> tuple[ProgramFile, ...]:
    first, *rest = files
    text, changes = re.subn(old, new, first.text, count=count, flags=re.MULTILINE)
    assert changes, f"{old} does not stand in {first.name}"
    return (dataclasses.replace(first, text=text), *rest)


def _refused(program: Program, name: str, files: tuple[ProgramFile, ...], because: str) -> None:
    with pytest.raises(ProgramMismatchError, match=because):
        verify(program, name, files)


@pytest.mark.parametrize("name", NAMES)
def test_unchanged_is_released(name: str) -> None:
    program = sessions.static()
    verify(program, name, write_program(program, name, "a"))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("kind", ["static", "continuous", "mixed"])
def test_the_reader_knows_every_statement_that_is_written(name: str, kind: str) -> None:
    program = getattr(sessions, kind)()
    files = write_program(program, name, "a")
    assert read_back(name, files).unknown == ()


@pytest.mark.parametrize("name", NAMES)
def test_no_text_of_a_person_gets_out_of_its_comment(name: str) -> None:
    hostile = "arm) ;\nM30\n' \" PTP {A1 0} (é"
    pause = [Pause(hostile) if isinstance(i, Pause) else i for i in sessions.static().instructions]
    program = dataclasses.replace(sessions.static(), robot=hostile, instructions=tuple(pause))
    files = write_program(program, name, "a")
    assert verify(program, name, files).unknown == ()
    assert all(file.text.isascii() for file in files)


@pytest.mark.parametrize("name", sessions.TURNED_DOWN)
@pytest.mark.usefixtures("by_lines")
def test_an_unknown_statement_is_refused_where_only_known_ones_are_allowed(name: str) -> None:
    program = sessions.static()
    files = _edited(write_program(program, name, "a"), r"^(?=.*-60\.0000)", "QUUX 5;\n")
    _refused(program, name, files, "does not know the statement")
    texts = tuple(file.text for file in files)
    assert len(read_texts(load_dialect(name), texts, only_known=False).unknown) == 1
    with pytest.raises(InputError, match="does not know the statement"):
        read_texts(load_dialect(name), texts)


@pytest.mark.parametrize("name", sessions.TURNED_DOWN)
@pytest.mark.usefixtures("by_lines")
def test_an_angle_off_by_one_in_the_last_but_one_digit(name: str) -> None:
    program = sessions.static()
    _refused(program, name, _edited(write_program(program, name, "a"), r"-60\.0000", "-60.0010"), "off by 0.0010")


@pytest.mark.parametrize("name", sessions.TURNED_DOWN)
@pytest.mark.usefixtures("by_lines")
def test_a_move_that_is_missing(name: str) -> None:
    program = sessions.static()
    files = _edited(write_program(program, name, "a"), r"^.*-60\.0000.*\r?\n", "")
    _refused(program, name, files, "planned are")


@pytest.mark.parametrize("name", NAMES)
def test_another_plan(name: str) -> None:
    program = dataclasses.replace(sessions.static(), plan_id="ba9876543210")
    _refused(program, name, write_program(sessions.static(), name, "a"), "belongs to plan 0123456789ab")


@pytest.mark.parametrize("name", NAMES)
def test_no_plan_id(name: str) -> None:
    program = sessions.static()
    _refused(program, name, _edited(write_program(program, name, "a"), "plan_id", "plan"), "plan_id")


@pytest.mark.parametrize("name", sessions.TURNED_DOWN)
@pytest.mark.usefixtures("by_lines")
def test_dwells_and_pulses_of_another_session(name: str) -> None:
    program = sessions.static()
    kinds = {"Dwell": "dwells", "Sync": "pulses"}
    for kind, because in kinds.items():
        fewer = [i for i in program.instructions if type(i).__name__ != kind]
        changed = dataclasses.replace(program, instructions=tuple(fewer))
        _refused(program, name, write_program(changed, name, "a"), because)


@pytest.mark.parametrize("name", [n for n in NAMES if load_dialect(n).blend.kind not in ("dense", "none")])
def test_a_corner_cut_more_than_planned(name: str) -> None:
    program = sessions.continuous()
    wider = tuple(
        dataclasses.replace(i, blend_mm=i.blend_mm * 1.5) if hasattr(i, "blend_mm") else i for i in program.instructions
    )
    files = write_program(dataclasses.replace(program, instructions=wider), name, "a")
    _refused(program, name, files, "rounds its corner")


@pytest.mark.parametrize("name", NAMES)
def test_a_stop_that_is_driven_through(name: str) -> None:
    program = sessions.dense()
    stops = tuple(dataclasses.replace(i, blend_mm=0.0) if hasattr(i, "blend_mm") else i for i in program.instructions)
    files = write_program(program, name, "a")
    if not any(blend is not None for blend in blends(read_back(name, files))):
        verify(dataclasses.replace(program, instructions=stops), name, files)  # a language that stops at every move
        return
    _refused(dataclasses.replace(program, instructions=stops), name, files, "rounds its corner")


@pytest.mark.parametrize("name", NAMES)
def test_a_leg_faster_than_planned(name: str) -> None:
    program = sessions.static()
    slower = tuple(
        dataclasses.replace(
            i,
            duration_s=i.duration_s * 2,
            tool_speed_mm_s=i.tool_speed_mm_s / 2,
            axis_percent=i.axis_percent / 2,
            tool_travel_mm=i.travel_mm,
        )
        if isinstance(i, JointMove)
        else i
        for i in program.instructions
    )
    files = write_program(program, name, "a")
    _refused(dataclasses.replace(program, instructions=slower), name, files, "of the planned speed")


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("linuxcnc", r" F15\.0000", " F1e1"),
        ("linuxcnc", "^M2$", "M99"),
        ("bnr", r"Q3=-60\.0000", "Q2=-60.0000"),
        ("krl", "PTP {A1 40", "SPTP {A1 40"),
        ("krl", "A2 -20", "A3 -20"),
        ("rapid", r"MoveAbsJ \[\[40", "MoveJ [[40"),
        ("rapid", "ENDPROC", ""),
        ("pdl2", "MOVE TO {40", "MOVE LINEAR TO {40"),
        ("pdl2", "^END A$|^END a.$", ""),
    ],
)
def test_text_that_is_not_of_the_language(name: str, old: str, new: str) -> None:
    program = sessions.static()
    _refused(program, name, _edited(write_program(program, name, "a"), old, new, count=0), "cannot be read back")
