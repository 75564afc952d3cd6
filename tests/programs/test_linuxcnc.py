"""LinuxCNC's own interpreter runs the program; its canonical commands are compared with the plan."""

import re
import shutil
import subprocess
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tests.programs.sessions as sessions
from planner.programs.dialect import load_dialect
from planner.programs.instructions import Dwell, JointMove, Pause, Program, Sync
from planner.programs.rendering import ProgramFile, render_program
from planner.programs.verification import ProgramMismatchError, import_map
from tests.programs.reading import verify, write_program

RS274 = shutil.which("rs274")
pytestmark = pytest.mark.skipif(RS274 is None, reason="rs274 is not installed (Debian package linuxcnc-uspace)")


def _canonical(text: str, folder: Path) -> tuple[int, list[str]]:
    """Return the exit code and the canonical commands that the interpreter issues."""
    (folder / "program.ngc").write_text(text)
    run = subprocess.run(
        [str(RS274), "-g", "program.ngc"], cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, timeout=60
    )
    lines = run.stdout.decode().splitlines()
    return run.returncode, [re.sub(r"^\s*\d+ N\S+\s+", "", line) for line in lines]


def _numbers(command: str) -> list[float]:
    return [float(x) for x in re.findall(r"-?\d+\.\d+", command)]


def _written(program: Program) -> str:
    (file,) = write_program(program, "linuxcnc", "edbb")
    return file.text


@pytest.mark.parametrize("session", [sessions.static, sessions.continuous, sessions.dense])
@pytest.mark.parametrize("joints", [5, 6])
def test_every_axis_of_every_move(session, joints: int, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    program = session(joints)
    code, commands = _canonical(_written(program), tmp_path)
    assert code == 0
    path = np.array([_numbers(c) for c in commands if c.startswith("STRAIGHT_FEED")])[1:, :joints]
    planned = np.array([m.q_deg for m in program.moves])
    assert path.shape == planned.shape
    assert np.abs(path - planned).max() <= 0.5001e-4
    assert commands[-1] == "ON_RESET()"
    assert any(c.startswith("PROGRAM_END") for c in commands)


def test_each_move_takes_its_time(tmp_path: Path) -> None:
    program = sessions.dense()
    _, commands = _canonical(_written(program), tmp_path)
    feed, here, times = 0.0, np.zeros(6), []
    for command in commands:
        if command.startswith("SET_FEED_RATE"):
            (feed,) = _numbers(command)
        elif command.startswith("STRAIGHT_FEED"):
            there = np.array(_numbers(command))
            times.append(float(np.linalg.norm((there - here)[:3])) / feed * 60.0)
            here = there
    times = times[1:]  # the axes that go first have a block of their own
    planned = [m.duration_s for m in program.moves]
    # the feed is printed to 1e-4, and the interpreter's path length from ends printed to 1e-4
    moving = [i for i, m in enumerate(program.moves) if i > 0 and times[i] > 0.05]
    assert len(moving) > 150
    np.testing.assert_allclose([times[i] for i in moving], [planned[i] for i in moving], rtol=2e-3)


def test_dwells_pulses_and_stops(tmp_path: Path) -> None:
    program = sessions.static()
    _, commands = _canonical(_written(program), tmp_path)
    dwells = [_numbers(c)[0] for c in commands if c.startswith("DWELL")]
    pulse = 0.05
    planned = [
        i.seconds if isinstance(i, Dwell) else pulse for i in program.instructions if isinstance(i, Dwell | Sync)
    ]
    assert dwells == planned
    pulses = sum(isinstance(i, Sync) for i in program.instructions)
    assert commands.count("SET_AUX_OUTPUT_BIT(5)") == commands.count("CLEAR_AUX_OUTPUT_BIT(5)") - 1 == pulses
    assert commands.count("PROGRAM_STOP()") == sum(isinstance(i, Pause) for i in program.instructions)
    modes = [c for c in commands if c.startswith("SET_MOTION_CONTROL_MODE")]
    assert modes[0] == "SET_MOTION_CONTROL_MODE(CANON_EXACT_STOP)"
    assert len(modes) == 2, "M72 gives back what was found"


def test_path_mode_and_pulses_in_passing(tmp_path: Path) -> None:
    program = sessions.dense()
    _, commands = _canonical(_written(program), tmp_path)
    mode, modes = "", []
    for command in commands:
        if command.startswith("SET_MOTION_CONTROL_MODE"):
            mode = command.split("(")[1]
        elif command.startswith("STRAIGHT_FEED"):
            modes.append(mode.startswith("CANON_CONTINUOUS"))
    assert modes[1:] == [m.blend_mm > 0.0 for m in program.moves]
    on = [i for i, c in enumerate(commands) if c.startswith("SET_MOTION_OUTPUT_BIT")]
    off = [i for i, c in enumerate(commands) if c.startswith("CLEAR_MOTION_OUTPUT_BIT")]
    assert len(on) == len(off) == sum(isinstance(i, Sync) for i in program.instructions)
    for begin, end in zip(on, off, strict=True):
        assert sum(c.startswith("STRAIGHT_FEED") for c in commands[begin:end]) == 1


@pytest.mark.parametrize("session", [sessions.static, sessions.dense])
# type: ignore[no-untyped-def]
def test_without_signals_no_output_is_switched_and_no_input_awaited(session, tmp_path: Path) -> None:
    program = session()
    signals = ("SET_AUX", "CLEAR_AUX", "SET_MOTION_OUTPUT", "CLEAR_MOTION_OUTPUT", "WAIT(")
    counts = []
    for one in (program, sessions.with_controller(program, sync_output=None, gauge_input=None)):
        code, commands = _canonical(_written(one), tmp_path)
        assert code == 0
        counts.append(sum(c.startswith(signals) for c in commands))
    assert counts[0] > 0 == counts[1]


def test_the_log_has_the_columns_of_the_import_map(tmp_path: Path) -> None:
    program = sessions.static()
    _, commands = _canonical(_written(program), tmp_path)
    columns = tomllib.loads(import_map("linuxcnc", 6))
    rows = [c[5:-2].split(columns["separator"]) for c in commands if c.startswith("LOG(")]
    poses = [m for m in program.moves if m.pose is not None]
    assert [int(row[columns["columns"]["pose"] - 1]) for row in rows] == [m.pose for m in poses]
    for row, move in zip(rows, poses, strict=True):
        q = [float(row[columns["columns"][f"cmd{i}_deg"] - 1]) for i in range(1, 7)]
        np.testing.assert_allclose(q, move.q_deg, atol=0.5001e-4)


def test_the_interpreter_would_notice(tmp_path: Path) -> None:
    text = _written(sessions.static())
    for old, new in ((" F15.0000", ""), ("Z-60.0000", "X-60.0000"), ("M66 P7 L3", "M66 P7 E0 L3")):
        assert old in text
        code, _ = _canonical(text.replace(old, new), tmp_path)
        assert code != 0, f"{old!r} -> {new!r}"


SLOW = 10.0  # [deg/s] of each axis on the first move
STARTS = [
    (0.01, 0, 0, 0, 0, 170),
    (1, 0, 0, 0, 0, 170),
    (2, -1, 0, 150, -85, 170),
    (0, 0, 0, 0, 0, 170),
    (90, -40, 70, 0, 0, 0),
]


def approach_speeds(text: str, offset: tuple[float, ...], home: tuple[float, ...], folder: Path) -> list[float]:
    """Return the largest axis speed [deg/s] of each block until home, where the arm has stood off home before.

    By RS274NGC 2.1.2.5: F is the speed along X Y Z alone if one of them moves, else that of A B C.
    """
    start = " ".join(f"{axis}{h + o:.4f}" for axis, h, o in zip("XYZABC", home, offset, strict=True))
    at = text.index("G94 G53 G1")
    code, commands = _canonical(f"{text[:at]}G53 G0 {start}\n{text[at:]}", folder)
    assert code == 0
    feed, here, out = 0.0, np.add(home, offset), []
    begun = next(k for k, c in enumerate(commands) if c.startswith("STRAIGHT_TRAVERSE"))
    np.testing.assert_allclose(_numbers(commands[begun]), here, atol=1e-4)
    for command in commands[begun + 1 :]:
        if command.startswith("SET_FEED_RATE"):
            (feed,) = _numbers(command)
        elif command.startswith("STRAIGHT_FEED"):
            there = np.array(_numbers(command))
            way = there - here
            length = np.linalg.norm(way[:3]) if way[:3].any() else np.linalg.norm(way[3:])
            if length > 0.0:
                out.append(float(np.abs(way).max() / (length / feed * 60.0)))
            here = there
            if np.abs(here - home).max() < 1e-4:
                return out
    raise AssertionError("it never stands at home")


@pytest.mark.parametrize("offset", STARTS)
def test_the_first_move_is_slow_from_anywhere(offset: tuple[float, ...], tmp_path: Path) -> None:
    program = sessions.static()
    text, home = _written(program), program.moves[0].q_deg
    assert max(approach_speeds(text, offset, home, tmp_path)) <= 1.001 * SLOW


def test_a_first_move_of_all_axes_at_once_is_fast_and_is_not_released(tmp_path: Path) -> None:
    program = sessions.static()
    text = _written(program)
    first = next(line for line in text.splitlines() if line.startswith("G94 G53 G1 A"))
    at_once = text.replace(first + "\n", "")
    assert max(approach_speeds(at_once, STARTS[1], program.moves[0].q_deg, tmp_path)) > 100.0 * SLOW
    for wrong in (at_once, text.replace(first, first.replace(" A", " A9")), text.replace("F600", "F6000")):
        with pytest.raises(ProgramMismatchError):
            verify(program, "linuxcnc", (ProgramFile("edbb.ngc", wrong),))


def test_axes_that_nearly_stand_make_no_move_quicker_than_planned(tmp_path: Path) -> None:
    """Where X goes 0.0005 deg in 10 s the interpreter drives it at 0.1 a minute all the same, and A with it."""
    program = sessions.static()
    k = max(i for i, item in enumerate(program.instructions[:-1]) if isinstance(item, JointMove))
    here = [m.q_deg for m in program.moves][-2]
    for x, released in ((0.0005, False), (0.05, True), (0.0, True)):
        there = (here[0] + x, here[1], here[2], here[3] + 20.0, *here[4:])
        move = replace(program.instructions[k], q_deg=there, duration_s=10.0)
        changed = replace(program, instructions=(*program.instructions[:k], move))
        dialect = load_dialect("linuxcnc")
        (file,) = render_program(changed, dialect, "edbb")
        _, commands = _canonical(file.text, tmp_path)
        last = max(i for i, c in enumerate(commands) if c.startswith("STRAIGHT_FEED"))
        (feed,) = _numbers(next(c for c in reversed(commands[:last]) if c.startswith("SET_FEED_RATE")))
        seconds = (x or 20.0) / feed * 60.0
        assert seconds == pytest.approx(10.0, rel=1e-3) if released else seconds < 0.4
        if released:
            verify(changed, "linuxcnc", (file,))
        else:
            with pytest.raises(ProgramMismatchError, match="is driven at"):
                verify(changed, "linuxcnc", (file,))
