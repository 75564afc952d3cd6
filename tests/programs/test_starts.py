"""A session can be started at a later pose: what is left out, the way there, and how surely that is read back."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tests.programs.sessions as sessions
from planner.programs.dialect import dialect_names, load_dialect
from planner.programs.instructions import JointMove, LogAxes, Program
from planner.programs.rendering import ProgramFile
from planner.programs.verification import ProgramMismatchError
from tests.not_everywhere import nc_gcode_interpreter
from tests.programs.reading import read_back, verify, write_program
from tests.programs.test_linuxcnc import RS274, _canonical, _numbers

STARTED = [name for name in dialect_names() if load_dialect(name).resume is not None]
POSES = 4


def _driven(program: Program, start: int) -> np.ndarray:
    """Angles of the moves that a start at a pose is to drive: home, mount, the way in, and all from there on."""
    way = [m.q_deg for e in program.entries if e.at == start for m in e.moves]
    first = next(k for k, m in enumerate(program.moves) if m.pose == start)
    rest = [m.q_deg for m in program.moves[first if start > 1 else 2 :]]
    return np.array([*(m.q_deg for m in program.moves[:2]), *way, *rest])


@pytest.mark.parametrize("name", STARTED)
@pytest.mark.parametrize("rounded", [False, True])
def test_all_starts_are_read_back(name: str, rounded: bool) -> None:
    program = sessions.resumable(6, POSES, rounded)
    found = read_back(name, write_program(program, name, "s"))
    assert found.stretches == program.stretches
    assert [at for at, _ in found.entries] == [2, 3, 4]
    for entry, (_, moves) in zip(program.entries, found.entries, strict=True):
        path = [m.angles_deg for m in moves]
        np.testing.assert_allclose(path, [m.q_deg for m in entry.moves], atol=10.0 ** -load_dialect(name).decimals)


@pytest.mark.parametrize("name", STARTED)
def test_a_way_may_be_slower_than_any_move_of_the_session(name: str) -> None:
    """Then only the way lowers the reduction, and what follows a stop has it back."""
    program = sessions.resumable(6, POSES)
    quick = tuple(
        replace(i, axis_percent=60.0, duration_s=1.0) if isinstance(i, JointMove) else i for i in program.instructions
    )
    program = replace(program, instructions=quick)
    verify(program, name, write_program(program, name, "s"))


@pytest.mark.parametrize("name", [n for n in dialect_names() if n not in STARTED])
def test_other_controllers_start_at_the_first_pose_and_say_so(name: str) -> None:
    program = sessions.resumable()
    files = write_program(program, name, "s")
    assert len(read_back(name, files).joint_path_deg) == len(program.moves)
    assert "starts at the first" in " ".join(re.sub(r"[();]", " ", files[0].text).split())


@pytest.mark.parametrize("name", STARTED)
def test_a_tampered_start_is_not_released(name: str) -> None:
    program = sessions.resumable()
    files = write_program(program, name, "s")
    stretch, entry = (getattr(load_dialect(name).resume, key) for key in ("stretch", "entry"))
    decimals = load_dialect(name).decimals
    at = f"{program.entries[0].moves[0].q_deg[0]:.{decimals}f}"
    turned = (at, f"{float(at) + 0.5:.{decimals}f}")
    for old, new in (turned, (_said(entry, 3), _said(entry, 2)), (_said(stretch, 2), _said(stretch, 3))):
        pattern = re.compile(re.escape(old).replace("NUMBER", r"(?P<number>\d+)"))
        k, found = next((k, m) for k, file in enumerate(files) if (m := pattern.search(file.text)))
        changed = new.replace("NUMBER", found.groupdict().get("number", ""))
        text = files[k].text[: found.start()] + changed + files[k].text[found.end() :]
        with pytest.raises(ProgramMismatchError):
            verify(program, name, (*files[:k], ProgramFile(files[k].name, text), *files[k + 1 :]))


def _said(text: str, number: int) -> str:
    plan = {"{until}": str(number), "{at}": str(number), "{ID}": sessions.PLAN_ID.upper(), "{number}": "NUMBER"}
    for key, value in plan.items():
        text = text.replace(key, value)
    return text


@pytest.mark.skipif(RS274 is None, reason="LinuxCNC's interpreter is not installed")
@pytest.mark.parametrize("start", [1, 2, 4])
def test_linuxcnc_drives_what_a_start_asks_for(start: int, tmp_path: Path) -> None:
    program = sessions.resumable(6, POSES)
    (file,) = write_program(program, "linuxcnc", "s")
    code, commands = _canonical(file.text.replace("#<start> = 1", f"#<start> = {start}"), tmp_path)
    assert code == 0
    path = np.array([_numbers(c) for c in commands if c.startswith("STRAIGHT_FEED")])[1:, :6]
    np.testing.assert_allclose(path, _driven(program, start), atol=1e-4)
    assert commands.count("SET_AUX_OUTPUT_BIT(5)") == POSES + 1 - start


@pytest.mark.parametrize("start", [0, 1, 2, 4])
def test_sinumerik_drives_what_a_start_asks_for(start: int) -> None:
    """A public interpreter runs the file; it knows no axes called A1, no signals and no WRITE."""
    program = _without_signals(sessions.resumable(6, POSES))
    (file,) = write_program(program, "sinumerik", "s")
    text = f"R[10]={start}\n" + re.sub(r" A(\d)=", r" AX\1=", file.text).replace("FGROUP(A1,A2,A3,A4,A5,A6)", "")
    table, _ = nc_gcode_interpreter.nc_to_dataframe(text, extra_axes=[f"AX{i}" for i in range(1, 7)])
    path = table.filter(table["gg01_motion"] == "G1").select([f"AX{i}" for i in range(1, 7)]).to_numpy()
    kept = np.concatenate([[True], np.abs(np.diff(path, axis=0)).max(axis=1) > 0])
    np.testing.assert_allclose(path[kept], _driven(program, max(start, 1)), atol=1e-4)
    assert set(table["gg09_frame_tool_suppress"].drop_nulls()) == {"G153"}
    assert "G500" in set(table["gg08_work_offset"].drop_nulls())


def _without_signals(program: Program) -> Program:
    kept = tuple(i for i in program.instructions if not isinstance(i, LogAxes))
    return sessions.with_controller(replace(program, instructions=kept), sync_output=None, gauge_input=None)


def test_din_takes_its_time_for_the_first_move() -> None:
    """Inverse time (DIN 66025, G93): the block takes 1/F minutes, so that an axis two turns off goes at 10 deg/s."""
    (file,) = write_program(sessions.static(), "din66025", "s")
    first = next(line for line in file.text.splitlines() if "G1 " in line)
    words = re.fullmatch(r"N\d+ G93 (?:G9 )?G1(?: A\d=-?[\d.]+){6} F([\d.]+)", first)
    assert words is not None, first
    assert 720.0 / (60.0 / float(words[1])) <= 10.0
    with pytest.raises(ProgramMismatchError, match="move 1"):
        verify(sessions.static(), "din66025", (ProgramFile("s.nc", file.text.replace(f"F{words[1]}", "F600", 1)),))
