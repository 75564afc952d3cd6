"""LinuxCNC's real motion controller drives a plan of a bar; its log, imported, calibrates the robot that it was.

The interpreter alone (``rs274``) says what a program means. Here the trajectory planner, the blending, the digital
output that moves with the motion and the clock of the machine take part: what is compared is what was driven.
"""

import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

import tests.programs.linuxcnc.machine as machine
import tests.programs.sessions as sessions
from planner.programs.verification import write_program
from tests.command import edbb

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(not machine.installed(), reason="Debian's linuxcnc-uspace is not installed"),
]

ROBOTS = Path(__file__).resolve().parents[3] / "robots"
TOOL_SPEED = 3000  # [mm/min], so that the whole drive takes about four minutes
# LinuxCNC drives a step no quicker than it could stop within the next one. Steps take 20 ms here, and with the robot's
# own accelerations in the INI a drive planned for 243 s took 281: the axes are given room, the program keeps the limits
ROOM = 5.0
CELL = (ROBOTS / "comau-nj130" / "cells" / "edbb.toml").read_text()
CELL = re.sub(r"dialects = .*", 'dialects = ["linuxcnc"]', CELL).replace("both_ways = true", "both_ways = false")
CELL = CELL.replace("tool_speed_mm_min = 1000", f"tool_speed_mm_min = {TOOL_SPEED}") + "validate = 0\n"

# Denavit-Hartenberg rows of the robot (its robot.toml): theta [deg], d, a [mm], alpha [deg]
ROWS = np.array([
    [0, 550, 400, -90], [-90, 0, 860, 0], [180, 0, -210, 90], [180, 761.58, 0, -90], [0, 0, 0, 90], [-90, 210, 0, 0],
], dtype=float)  # fmt: skip
TOOL, FIXTURE = np.array([50.0, 0.0, 150.0]), np.array([258.0, 1468.0, 708.0])  # [mm]
TRUE_ROWS = ROWS + np.array([
    [0, 0, 0.6, 0], [0.05, 0, 0.8, 0], [-0.08, 0, 0, 0.04], [0, -0.7, 0, 0], [0.06, 0, 0, 0], [0, 0, 0, 0],
])  # fmt: skip
TRUE_TOOL, TRUE_FIXTURE, ZERO = np.array([50.4, -0.3, 150.5]), np.array([258.9, 1467.2, 708.6]), 0.15  # [mm]
NOISE = 1e-3  # [mm] of the gauge


def tool_point(q_deg, rows, tool):
    """Where the tool point is from the base, (n, 3) [mm], at joint angles (n, 6) [deg]."""
    out = np.tile(np.eye(4), (len(q_deg), 1, 1))
    for k, (theta, d, a, alpha) in enumerate(rows):
        t, s = np.deg2rad(q_deg[:, k] + theta), np.deg2rad(alpha)
        step = np.zeros((len(q_deg), 4, 4))
        step[:, 0] = np.stack([np.cos(t), -np.sin(t) * np.cos(s), np.sin(t) * np.sin(s), a * np.cos(t)], axis=1)
        step[:, 1] = np.stack([np.sin(t), np.cos(t) * np.cos(s), -np.cos(t) * np.sin(s), a * np.sin(t)], axis=1)
        step[:, 2] = [0, np.sin(s), np.cos(s), d]
        step[:, 3] = [0, 0, 0, 1]
        out = out @ step
    return out[:, :3, 3] + out[:, :3, :3] @ tool


def lengths(q_deg, rows=ROWS, tool=TOOL, fixture=FIXTURE, zero=0.0):
    return np.linalg.norm(tool_point(q_deg, rows, tool) - fixture, axis=1) + zero


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    folder = tmp_path_factory.mktemp("linuxcnc")
    (folder / "cell.toml").write_text(CELL)
    done = edbb("plan", folder / "cell.toml", "--poses", 26, "-o", folder / "out")
    assert done.returncode == 0, done.stderr
    return folder / "out"


@pytest.fixture(scope="module")
def planned(plan):
    return json.loads((plan / "plan.json").read_text())


@pytest.fixture(scope="module")
def log(plan):
    joints = tomllib.loads((ROBOTS / "comau-nj130" / "robot.toml").read_text())["joints"]
    limits = [
        machine.JointLimits(low, high, j["speed_deg_s"], ROOM * j["acceleration_deg_s2"])
        for j in joints
        for low, high in [j["limit_deg"]]
    ]
    (program,) = plan.glob("*.ngc")
    found = machine.drive(program.read_text(), limits, plan / "axes.log", seconds=590)
    assert "ended" in found.words, found.words[-2000:]
    return found


@pytest.fixture(scope="module")
def measured(log, planned):
    """First and last sample of what is driven with the bar: it is put on and taken off at rest at the mount pose."""
    mount = next(p["q_deg"] for p in planned["poses"] if p["role"] == "mount")
    at_mount = np.flatnonzero(np.abs(log.cycles_deg - mount).max(axis=1) < 2e-4)
    away = int(at_mount[np.flatnonzero(np.diff(at_mount) > 1)[0]])
    back = int(at_mount[at_mount > away][0])
    return away // machine.KEPT, -(-back // machine.KEPT)


def test_the_machine_said_nothing_but_what_the_program_says(log):
    said = [line for line in log.words.splitlines() if line.startswith("message:")]
    assert not [line for line in said if "error" in line.lower() or "limit" in line.lower()], said


def test_the_bar_stays_within_its_range(log, measured, planned):
    first, last = measured
    length = lengths(log.q_deg[first : last + 1])
    assert length.min() > 300.0
    assert length.max() < 520.0
    assert length.min() == pytest.approx(planned["path"]["length_min_mm"], abs=0.1)
    assert length.max() == pytest.approx(planned["path"]["length_max_mm"], abs=0.1)


def test_the_tool_keeps_its_speed(log, measured):
    first, last = measured
    x = tool_point(log.q_deg[first : last + 1], ROWS, TOOL)
    way, window = np.linalg.norm(np.diff(x, axis=0), axis=1), round(1.0 / machine.SAMPLE_S)
    speed = np.convolve(way, np.ones(window), "valid") / (window * machine.SAMPLE_S) * 60.0  # [mm/min]
    assert speed.max() <= 1.02 * TOOL_SPEED
    assert speed.max() >= 0.9 * TOOL_SPEED


def test_the_poses_are_marked_in_their_order(log, measured, planned):
    first, last = measured
    rise = first + 1 + np.flatnonzero(np.diff(log.mark[first : last + 1]) > 0.5)
    poses = np.array([p["q_deg"] for p in planned["poses"] if p["role"] != "mount"])
    assert len(rise) == len(poses)
    at_pose = tool_point(poses, ROWS, TOOL)
    at_mark = tool_point(log.q_deg[rise], ROWS, TOOL)
    # a sample is up to 20 ms late, which is 1 mm of way, and the path passes a pose within its blend of 10 mm
    assert np.linalg.norm(at_mark - at_pose, axis=1).max() < 10.0
    apart = np.linalg.norm(at_pose[:, None] - at_pose[None], axis=2) + 1e3 * np.eye(len(poses))
    assert np.median(apart.min(axis=1)) > 20.0  # so that a mark out of its order would be seen


def test_it_takes_as_long_as_planned(log, measured, planned):
    first, last = measured
    q = log.q_deg[first : last + 1]
    moving = np.abs(np.diff(q, axis=0)).max(axis=1) > 1e-7  # what is left out is the stop of the person
    # LinuxCNC slows where a step's successor is too short to stop in: 2.3 % were seen
    assert moving.sum() * machine.SAMPLE_S == pytest.approx(planned["trajectory"]["measuring_s"], rel=0.03)


def test_its_log_calibrates_the_robot(log, measured, plan, planned, tmp_path):
    first, last = measured
    rng = np.random.default_rng(7)
    t = machine.SAMPLE_S * np.arange(len(log.q_deg))
    read = np.arange(first + 25, last - 25, 3)  # the bar is read 17 times a second
    t_gauge, q = t[read], log.q_deg[read]
    length = lengths(q, TRUE_ROWS, TRUE_TOOL, TRUE_FIXTURE, ZERO) + rng.normal(0.0, NOISE, len(q))
    rows = "".join(f"{a:.6f},{b:.6f}\n" for a, b in zip(t_gauge, length, strict=True))
    (tmp_path / "gauge.csv").write_text("time,length\n" + rows)
    joints = "".join(f"q{k + 1}_deg = {k + 2}\n" for k in range(machine.JOINTS))
    (tmp_path / "map.toml").write_text(
        'schema = "edbb-map/1"\nseparator = " "\nheader = false\n'
        f"[columns]\nt_s = {{ column = 1, factor = {machine.CYCLE_S} }}\n{joints}"
        '[[traces]]\n[traces.columns]\nt_s = "time"\nlength_mm = "length"\n'
    )
    run, out = tmp_path / "run.csv", tmp_path / "found"
    done = edbb("import", log.file, tmp_path / "gauge.csv", "--map", tmp_path / "map.toml", "-o", run)
    assert done.returncode == 0, done.stderr
    done = edbb("identify", run, "--cell", plan / "cell.toml", "--plan", plan / "plan.json", "-o", out)
    assert done.returncode == 0, done.stderr
    found = json.loads((out / "identification.json").read_text())
    assert found["stages"][-1]["held_out"]["rms_mm"] < 1.5 * NOISE
    rows = {p["name"]: p for p in found["parameters"]}
    truth = {
        "a1": 400.6, "theta2": -89.95, "a2": 860.8, "theta3": 179.92, "alpha3": 90.04, "d4": 760.88, "theta5": 0.06,
        "fixture_A_x": TRUE_FIXTURE[0], "fixture_A_y": TRUE_FIXTURE[1], "fixture_A_z": TRUE_FIXTURE[2],
        "map_x": TRUE_TOOL[0], "map_y": TRUE_TOOL[1], "map_z": TRUE_TOOL[2], "zero": ZERO,
    }  # fmt: skip
    off = {name: (rows[name]["value"] - value) / rows[name]["std"] for name, value in truth.items()}
    assert max(map(abs, off.values())) < 5.0, off


def test_the_first_move_is_slow_from_anywhere(tmp_path):
    """The arm stands one degree off in its first axis and 170 in its last: none goes faster than 10 deg/s to home."""
    program = sessions.static()
    (file,) = write_program(program, "linuxcnc", "edbb")
    home = np.array(program.moves[0].q_deg)
    start = home + np.array([1.0, 0.0, 0.0, 0.0, 0.0, 170.0])
    first = [line for line in file.text.splitlines() if line.startswith("G94 G53 G1")]
    there = " ".join(f"{axis}{angle:.4f}" for axis, angle in zip(machine.AXES, start, strict=True))
    text = "\n".join(["G17 G21 G40 G80 G90", "G61.1", f"G53 G0 {there}", "G4 P0.5", *first, "M2", ""])
    limits = [machine.JointLimits(-350.0, 350.0, 360.0, 2000.0)] * 6
    log = machine.drive(text, limits, tmp_path / "axes.log", seconds=120)
    assert "ended" in log.words, log.words[-2000:]
    begun = int(np.flatnonzero(np.abs(log.cycles_deg - start).max(axis=1) < 1e-4)[-1])
    way = log.cycles_deg[begun:]
    assert np.abs(np.diff(way, axis=0)).max() / machine.CYCLE_S <= 10.05
    np.testing.assert_allclose(way[-1], home, atol=1e-4)
