"""Every dialect that is on disk: what is written is what is read back, and it is the plan."""

import re

import numpy as np
import pytest

import tests.programs.sessions as sessions
from planner.common.errors import InputError
from planner.programs import verification
from planner.programs.dialect import dialects, load_dialect
from planner.programs.instructions import Dwell, Program, Sync
from planner.programs.rendering import render_program
from planner.programs.verification import ProgramMismatchError
from tests.programs.reading import blends, read_back, verify, write_program

NAMES = [d.name for d in dialects()] + [f"{d.name}+{o}" for d in dialects() for o in d.options]
SESSIONS = {
    "static": sessions.static,
    "continuous": sessions.continuous,
    "mixed": sessions.mixed,
    "dense": sessions.dense,
}


def _cases() -> list[tuple[str, str, int]]:
    cases = []
    for name in NAMES:
        dialect = load_dialect(name)
        for joints in range(max(5, dialect.min_joints), min(7, dialect.max_joints) + 1):
            cases += [(name, session, joints) for session in (SESSIONS if joints == 6 else ("mixed",))]
    return cases


def _planned(program: Program) -> np.ndarray:
    return np.array([m.q_deg for m in program.moves])


@pytest.mark.parametrize(("name", "session", "joints"), _cases())
def test_read_back_is_the_plan(name: str, session: str, joints: int) -> None:
    program = SESSIONS[session](joints)
    files = write_program(program, name, "edbb nj-130")
    found = read_back(name, files)
    resolution = 10.0 ** -load_dialect(name).decimals
    assert found.joint_path_deg.shape == _planned(program).shape
    assert np.abs(found.joint_path_deg - _planned(program)).max() <= 0.5001 * resolution
    assert found.plan_id == sessions.PLAN_ID
    syncs = sum(isinstance(i, Sync) for i in program.instructions) if load_dialect(name).sync.rest else 0
    assert found.syncs == syncs
    assert found.dwells_s == tuple(i.seconds for i in program.instructions if isinstance(i, Dwell))
    for move, blend in zip(program.moves, blends(found), strict=True):
        assert blend is None or move.blend_mm > 0.0


@pytest.mark.parametrize("name", NAMES)
def test_text_is_fit_for_the_controller(name: str) -> None:
    dialect = load_dialect(name)
    for session in (sessions.static, sessions.continuous, sessions.mixed):
        for file in write_program(session(), name, "edbb"):
            text = file.text.encode(file.encoding).decode()
            end = "\r\n" if dialect.line_ending == "crlf" else "\n"
            lines = text.split(end)
            assert lines.pop() == ""
            assert not any("\n" in line or "\r" in line or "\t" in line for line in lines)
            assert all(line.strip() and line == line.rstrip() for line in lines)
            assert max(map(len, lines)) <= dialect.max_line
            assert sessions.PLAN_ID in text
            assert not re.search(r"\d[eE][-+]\d|-0\.0*(?![\d])|\bnan\b|\binf\b|None", text)


@pytest.mark.parametrize("name", NAMES)
def test_same_program_same_bytes(name: str) -> None:
    program = sessions.continuous()
    assert write_program(program, name, "a") == verification.write_program(program, name, "a")


@pytest.mark.parametrize("name", [n for n in NAMES if load_dialect(n).reading.family == "gcode"])
def test_no_word_twice_in_a_block(name: str) -> None:
    (file,) = write_program(sessions.continuous(), name, "a")
    for line in file.text.splitlines():
        tokens = (re.fullmatch(r"([A-Z]\d?)=.+|([A-FH-Z])-?[\d.]+", t) for t in line.split(";")[0].split())
        letters = [t[1] or t[2] for t in tokens if t]
        assert len(letters) == len(set(letters)), line


@pytest.mark.parametrize("name", [n for n in NAMES if load_dialect(n).blend.kind not in ("dense", "none")])
def test_continuous_tour_runs_without_stops(name: str) -> None:
    program = sessions.continuous()
    found = read_back(name, write_program(program, name, "a"))
    rounded = [m.blend_mm > 0.0 for m in program.moves]
    assert [b is not None for b in blends(found)] == rounded


@pytest.mark.parametrize("name", [n for n in NAMES if load_dialect(n).blend.kind == "dense"])
def test_long_legs_stop_where_millimetres_cannot_be_said(name: str) -> None:
    assert set(blends(read_back(name, write_program(sessions.continuous(), name, "a")))) == {None}
    dense = blends(read_back(name, write_program(sessions.dense(), name, "a")))
    assert dense.count(None) < 10 < len(dense) - 10


@pytest.mark.slow
@pytest.mark.parametrize("name", [d.name for d in dialects() if load_dialect(d.name).part_lines])
def test_long_programs_are_split_and_still_run_in_order(name: str) -> None:
    limit = 300
    program = sessions.with_controller(sessions.dense(6, 1500), part_lines=limit)
    files = write_program(program, name, "a_name_that_is_longer_than_a_controller_takes")
    dialect = load_dialect(name)
    found = read_back(name, files)
    assert np.abs(found.joint_path_deg - _planned(program)).max() <= 0.5001 * 10.0**-dialect.decimals
    if dialect.files.part:
        assert len(files) > 5
        assert len({f.name for f in files}) == len(files)
        assert all(f.text.count("\n") <= limit + 25 for f in files[1:])


@pytest.mark.parametrize("name", [d.name for d in dialects() if load_dialect(d.name).part_lines])
@pytest.mark.parametrize("rounded", [False, True])
def test_a_program_in_parts_can_be_started_at_a_later_pose(name: str, rounded: bool) -> None:
    program = sessions.with_controller(sessions.resumable(6, 6, rounded), part_lines=20)
    files = write_program(program, name, "s")
    found = read_back(name, files)
    assert found.stretches == program.stretches
    assert [at for at, _ in found.entries] == [e.at for e in program.entries]
    verify(program, name, files)
    if load_dialect(name).files.part:
        assert len(files) > 3
        with pytest.raises(ProgramMismatchError):
            verify(program, name, (files[0], *files[2:]))


@pytest.mark.parametrize("name", [n for n in NAMES if not load_dialect(n).part_lines])
def test_a_file_beyond_the_limit_of_a_controller_without_parts_is_refused(name: str) -> None:
    program = sessions.with_controller(sessions.dense(6, 300), part_lines=100)
    with pytest.raises(InputError, match=r"part_lines allows 100"):
        write_program(program, name, "a")


def test_a_program_that_the_controller_takes_not_is_refused() -> None:
    dialect = load_dialect("fanuc-tp")
    assert dialect.max_lines == 9999
    with pytest.raises(InputError, match=r"the controller allows 100"):
        render_program(sessions.dense(6, 200), dialect.model_copy(update={"max_lines": 100}), "a")


def test_blocks_that_are_quicker_than_the_controller_are_told() -> None:
    program = sessions.dense(6, 100)
    slow = write_program(sessions.with_controller(program, block_ms=200.0), "krl", "a")[0].text
    assert "it brakes at" in slow.replace("\r\n; ", " ")
    assert "brakes" not in write_program(program, "krl", "a")[0].text
