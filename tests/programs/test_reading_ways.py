"""How the gauge is read is one word of the cell: in every language the program waits as it says, and nowhere else."""

import re
import shutil
import subprocess
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

import tests.programs.sessions as sessions
from planner.cell.reading import cell_of, load_cell
from planner.common.errors import InputError
from planner.programs.dialect import dialect_names, load_dialect
from planner.programs.instructions import Instruction, JointMove, LogAxes, Sync
from planner.programs.verification import ProgramMismatchError, write_program
from planner.session.neutral_program import _read_at_rest, write_session
from tests.programs.languages import dialect_facts
from tests.programs.reading import read_back, verify
from tests.programs.test_krl import GRAMMAR

POSES = 4
IN_FILES = ("ros2-trajectory", "lerobot")  # a person plays one file after the other


@cache
def cell_read_by(way, gauge="", **controller):
    """The shipped KUKA cell whose gauge is read in this way."""
    shipped = load_cell("kuka-kr6-r700/edbb")
    signals = {"sync_output": 5, "gauge_input": 7} | controller
    file = shipped.file.model_copy(
        update={
            "gauge": shipped.file.gauge.model_copy(update={"read_by": way}),
            "controller": shipped.file.controller.model_copy(update=signals),
        }
    )
    return cell_of(file, shipped.path, shipped.name)


def session(way):
    """Four poses at rest, read in this way."""
    tour: list[Instruction] = []
    for pose, q in enumerate(sessions.angles(6, POSES), start=1):
        mark = [Sync(pose), LogAxes(pose)]
        steps = _read_at_rest(cell_read_by(way), mark, f"pose {pose} of {POSES}", seated=False)
        tour += [JointMove(q, 7.3, 16.6, 0.52, pose=pose), *steps]
    return sessions._frame(6, tour)


def text_of(files):
    return "\n".join(line for f in files for line in f.text.splitlines())


@pytest.mark.parametrize("way", ["log", "hand", "trigger", "input"])
@pytest.mark.parametrize("name", dialect_names())
def test_every_way_of_reading_is_written_and_read_back(name, way):
    """Two stops for a person belong to attaching the bar and taking it off, one wait to the bar that is ready."""
    program = session(way)
    files = write_program(program, name, "s")
    verify(program, name, files)
    found, text = read_back(name, files), text_of(files)
    waits_for_person = POSES if way == "hand" else 0
    if name in IN_FILES:
        assert len(files) == len(found.stops) + 1 == 3 + waits_for_person
        return
    assert len(re.findall(dialect_facts(name).stop, text, re.MULTILINE)) == 2 + waits_for_person
    assert len(re.findall(dialect_facts(name).wait, text, re.MULTILINE)) == 1 + (POSES if way == "input" else 0)
    kind = {"hand": "pause", "input": "wait"}.get(way)
    at_poses = [(kind, 2 + k) for k in range(1, POSES + 1)] if kind else []
    assert list(found.stops) == [("pause", 2), ("wait", 2), *at_poses, ("pause", 3 + POSES)]


@pytest.mark.parametrize("name", dialect_names())
def test_the_pendant_tells_the_pose(name):
    text = text_of(write_program(session("hand"), name, "s"))
    assert dialect_facts(name).shown in text
    for other in (1, 2, 4):
        assert dialect_facts(name).shown.replace("pose 3", f"pose {other}") in text
    assert "of 4: read" not in text_of(write_program(session("log"), name, "s"))


@pytest.mark.parametrize("way", ["hand", "input"])
@pytest.mark.parametrize("name", [n for n in dialect_names() if dialect_facts(n).stop])
def test_a_program_that_lacks_a_wait_is_not_released(name, way):
    program = session(way)
    files = write_program(program, name, "s")
    word = {"hand": dialect_facts(name).stop, "input": dialect_facts(name).wait}[way]
    lines = files[0].text.splitlines()
    at = [k for k, line in enumerate(lines) if re.search(word, line)][2]
    altered = [replace(files[0], text="\n".join(lines[:at] + lines[at + 1 :]) + "\n"), *files[1:]]
    with pytest.raises(ProgramMismatchError):
        verify(program, name, altered)


def test_a_drive_has_no_wait_at_its_poses():
    """What is read in passing has a log: the program of a drive stops to attach the bar and to take it off."""
    for name in dialect_names():
        found = read_back(name, write_program(sessions.continuous(), name, "s")) if name not in IN_FILES else None
        if found is not None:
            assert [kind for kind, _ in found.stops] == ["pause", "wait", "pause"]


@pytest.mark.parametrize("name", IN_FILES)
@pytest.mark.parametrize(("way", "lacks"), [("trigger", "switch no output"), ("input", "wait for no input")])
def test_a_format_without_signals_refuses_what_it_cannot_do(name, way, lacks):
    with pytest.raises(InputError, match=lacks):
        write_session(cell_read_by(way), session(way), name, "s")


def test_a_new_language_states_its_wait_in_one_line(monkeypatch):
    """``pause`` of dialect.toml: with another word there, the program is written and read back with it."""
    own = load_dialect("bnr").model_copy(update={"pause": ("M777",), "go_on": "turn the key"})
    for module in ("planner.programs.verification", "tests.programs.reading"):
        monkeypatch.setattr(f"{module}.load_dialect", lambda _name: own)
    program = session("hand")
    files = write_program(program, "bnr", "s")
    assert len(re.findall("^M777$", files[0].text, re.MULTILINE)) == 2 + POSES
    assert "; pose 3 of 4: read the gauge, then turn the key" in files[0].text
    with pytest.raises(ProgramMismatchError, match="it waits for a person"):
        verify(program, "bnr", [replace(files[0], text=files[0].text.replace("M777\n", "", 1))])


@pytest.mark.skipif(shutil.which("rs274") is None, reason="rs274 is not installed (Debian package linuxcnc-uspace)")
@pytest.mark.parametrize(("way", "stops"), [("log", 2), ("hand", 2 + POSES), ("trigger", 2), ("input", 2)])
def test_the_interpreter_of_linuxcnc_stops_where_it_is_read(way, stops, tmp_path: Path):
    (file,) = write_program(session(way), "linuxcnc", "s")
    (tmp_path / "program.ngc").write_text(file.text)
    run = subprocess.run(["rs274", "-g", "program.ngc"], cwd=tmp_path, stdin=subprocess.DEVNULL, capture_output=True)
    assert run.returncode == 0
    commands = run.stdout.decode()
    assert commands.count("PROGRAM_STOP()") == stops
    assert ('MESSAGE("pose 3 of 4: read the gauge, then press Cycle Start")' in commands) == (way == "hand")


@pytest.mark.parametrize(
    ("way", "change", "told"),
    [
        ("trigger", {"sync_output": None}, "'controller.sync_output'"),
        ("input", {"gauge_input": None}, "'controller.gauge_input'"),
        ("centring", {}, 'a gauge \'edbb\' is read by "log" or "hand" or "trigger" or "input"'),
    ],
)
def test_a_way_that_cannot_be_is_refused_by_its_key(way, change, told):
    with pytest.raises(InputError, match=re.escape(told)):
        cell_read_by(way, **change)


def test_a_rest_of_no_time_is_no_dwell():
    cell = cell_read_by("log")
    still = replace(cell, motion=replace(cell.motion, settle=0.0, dwell=0.0))
    assert _read_at_rest(still, [Sync(1)], "pose 1 of 1", seated=False) == [Sync(1)]


def test_a_drive_cannot_be_read_by_hand_and_no_time_is_given_that_nobody_waits():
    shipped = load_cell("comau-nj130/edbb")

    def with_gauge(**keys):
        gauge = shipped.file.gauge.model_copy(update=keys)
        return cell_of(shipped.file.model_copy(update={"gauge": gauge}), shipped.path, shipped.name)

    with pytest.raises(InputError, match="without a stop"):
        with_gauge(read_by="hand")
    with pytest.raises(InputError, match=r"'gauge\.reading_s' = 9, but no robot waits"):
        with_gauge(reading_s=9.0)


def test_the_head_says_what_the_program_waits_for():
    """An input that nobody wired holds the robot for ever: the head of the program says so."""

    def head(way, **signals):
        cell = cell_read_by(way, **signals)
        return cell.gauge.reading_text(cell.file)

    assert "stops and names the pose" in head("hand")
    assert "counts 20 s for each reading" in head("hand")
    assert "drives on by itself" in head("log")
    assert "waits until input 7 is on" in head("input")
    assert "triggers the gauge" in head("trigger")
    assert "Before the first pose the program waits until input 7" in head("hand")
    assert "leave gauge_input out of the cell" in head("log")
    assert "input" not in head("hand", gauge_input=None)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*deprecated")  # the checker's own use of pyparsing
@pytest.mark.parametrize("way", ["hand", "input"])
def test_the_grammar_of_krl_and_the_checker_of_rapid_take_the_waits(way):
    for file in write_program(session(way), "krl", "s"):
        GRAMMAR.parse(file.text)
    checker = pytest.importorskip("rapidchecker.cli", reason="rapidchecker is not installed")
    assert not checker.check_file(write_program(session(way), "rapid", "s")[0].text)
