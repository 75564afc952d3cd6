"""Streams of timed goals keep the acceleration of every joint, as whoever follows them joins the goals."""

import csv
import re
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
import yaml
from scipy.interpolate import CubicHermiteSpline

import tests.programs.sessions as sessions
from planner.common.errors import InputError
from planner.programs.instructions import JointMove, Program
from planner.programs.rendering import ProgramFile
from planner.programs.verification import ProgramMismatchError
from tests.programs.reading import verify, write_program

LIMIT = (100.0, 80.0, 120.0, 200.0, 300.0, 400.0)  # [deg/s²]
PRINTED = {"ros2-trajectory": 1.0, "lerobot": 4 * 0.5e-3 * 30.0**2}  # [deg/s²] that the rounding of angles may add
STREAMS = list(PRINTED)


STEP = {"ros2-trajectory": 1e-3, "lerobot": 1.0 / 30.0}  # [s] in which a controller sends goals to the joints


def follow(name: str, files: tuple[ProgramFile, ...], home_deg: tuple[float, ...]) -> Iterator[np.ndarray]:
    """Yield the angles (n, N) [deg] of each file as its consumer drives it, one row a step, from rest where it stands.

    The trajectory controller of ROS 2 joins two points by a straight line, and by a cubic where both have velocities. A
    player of LeRobot's frames sends one after the other, and a servo drives to each within its time.
    """
    here = np.array(home_deg)
    for file in files:
        q = (_trajectory if name == "ros2-trajectory" else _frames)(file.text, here)
        here = q[-1]
        yield q


def _trajectory(text: str, here: np.ndarray) -> np.ndarray:
    points = yaml.safe_load(text)["points"]
    time = np.array([0.0, *(p["time_from_start"]["sec"] + 1e-9 * p["time_from_start"]["nanosec"] for p in points)])
    q = np.rad2deg([np.deg2rad(here), *(p["positions"] for p in points)])
    v = [np.zeros(len(here)), *(np.rad2deg(p["velocities"]) if "velocities" in p else None for p in points)]
    even = np.arange(0.0, time[-1], STEP["ros2-trajectory"])
    driven = []
    for k in range(len(time) - 1):
        t = even[(even >= time[k]) & (even < time[k + 1])]
        begin, end = v[k], v[k + 1]
        if begin is None or end is None:
            share = (t - time[k]) / (time[k + 1] - time[k])
            driven.append(q[k] + share[:, None] * (q[k + 1] - q[k]))
        else:
            driven.append(CubicHermiteSpline(time[k : k + 2], q[k : k + 2], np.array([begin, end]))(t))
    return np.concatenate([*driven, q[-1:]])


def _frames(text: str, here: np.ndarray) -> np.ndarray:
    rows = list(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))
    keys = [k for k in rows[0] if k.endswith(".pos")]
    np.testing.assert_allclose([float(r["timestamp"]) * 30.0 for r in rows], np.arange(len(rows)) + 1.0, atol=2e-3)
    return np.array([here.tolist(), *([float(r[k]) for k in keys] for r in rows)])


def largest_share(name: str, files: tuple[ProgramFile, ...], home_deg: tuple[float, ...], limit: np.ndarray) -> float:
    """Return the largest acceleration along the whole stream over the limit of its joint, by second differences."""
    out = 0.0
    for q in follow(name, files, home_deg):
        still = np.concatenate([q[:1], q, q[-1:], q[-1:]])  # at rest before and after
        acceleration = np.abs(np.diff(still, n=2, axis=0)) / STEP[name] ** 2
        out = max(out, float((acceleration / (limit + PRINTED[name])).max()))
    return out


def _quick(program: Program, by: float) -> Program:
    """The same session driven so much quicker, with the limits of its joints."""
    quicker = tuple(
        replace(i, duration_s=i.duration_s / by, tool_speed_mm_s=i.tool_speed_mm_s * by)
        if isinstance(i, JointMove)
        else i
        for i in program.instructions
    )
    return replace(program, instructions=quicker, acceleration_deg_s2=LIMIT)


@pytest.mark.parametrize("name", STREAMS)
@pytest.mark.parametrize("session", [sessions.static, sessions.continuous, sessions.mixed, sessions.dense])
@pytest.mark.parametrize("by", [1.0, pytest.param(3.0, marks=pytest.mark.slow), 8.0])
def test_every_joint_keeps_its_acceleration(name: str, session, by: float) -> None:  # type: ignore[no-untyped-def]
    program = _quick(session(), by)
    files = write_program(program, name, "a")
    assert largest_share(name, files, program.moves[0].q_deg, np.array(LIMIT)) <= 1.0


@pytest.mark.parametrize("name", STREAMS)
@pytest.mark.parametrize("session", [sessions.static, sessions.dense])
def test_no_leg_takes_less_time_than_planned_nor_much_more(name: str, session) -> None:  # type: ignore[no-untyped-def]
    """Ramps make a leg longer; a stretch that keeps its limits without them is not made longer at all."""
    program = session()
    here, known = program.home_deg, list(program.instructions)
    for k, item in enumerate(known):
        if isinstance(item, JointMove):  # the joint that moves furthest may turn at 6 degrees in 0.123 s
            furthest = max(abs(b - a) for a, b in zip(here, item.q_deg, strict=True))
            known[k], here = replace(item, shortest_s=0.123 * furthest / 6.0), item.q_deg
    program = replace(program, instructions=tuple(known), acceleration_deg_s2=(5000.0,) * 6)
    found = verify(program, name, write_program(program, name, "a"))
    planned = np.array([m.duration_s for m in program.moves])[1:]
    read = np.array([m.speed for m in found.moves])[1:]
    assert (read >= planned * (1.0 - 1e-6)).all()
    frame = len(planned) / 30.0 if name == "lerobot" else 0.0
    assert read.sum() <= 1.02 * planned.sum() + frame


def test_without_limits_the_stream_is_written_as_planned() -> None:
    for name in STREAMS:
        verify(sessions.dense(), name, write_program(sessions.dense(), name, "a"))


EDITS = [
    ("ros2-trajectory", r", -?[\d.]+\], time", ", 9.0], time", "accelerates joint 6"),
    ("ros2-trajectory", "velocities: ", "velocity: ", "does not know"),
    ("lerobot", r"(?<=,)(-?\d+)\.\d(\d\d,)(?=via)", r"\1.9\2", "off by"),
]


@pytest.mark.parametrize(("name", "pattern", "new", "because"), EDITS)
def test_an_edit_in_the_middle_of_a_stream_is_found(name: str, pattern: str, new: str, because: str) -> None:
    program = replace(sessions.dense(), acceleration_deg_s2=LIMIT)
    first, tour, *rest = write_program(program, name, "a")
    middle = len(tour.text) // 2
    text, changes = re.subn(pattern, new, tour.text[middle:], count=1)
    assert changes
    with pytest.raises(ProgramMismatchError, match=because):
        verify(program, name, (first, ProgramFile(tour.name, tour.text[:middle] + text), *rest))


@pytest.mark.parametrize("name", STREAMS)
@pytest.mark.parametrize("session", [sessions.static, sessions.dense])
def test_a_stream_is_not_released_for_joints_that_accelerate_less(name: str, session) -> None:  # type: ignore[no-untyped-def]
    """The reader finds the acceleration that the follower finds, from the text alone."""
    program = _quick(session(), 3.0)
    files = write_program(program, name, "a")
    found = verify(program, name, files).acceleration_deg_s2
    share = largest_share(name, files, program.moves[0].q_deg, np.array(LIMIT))
    assert max(a / (b + PRINTED[name]) for a, b in zip(found, LIMIT, strict=True)) == pytest.approx(share, abs=0.03)
    weaker = replace(program, acceleration_deg_s2=tuple(0.8 * a for a in found))
    with pytest.raises(ProgramMismatchError, match="accelerates joint"):
        verify(weaker, name, files)


def test_the_peak_that_is_read_is_that_of_the_cubic() -> None:
    """Against scipy's spline through the same points and velocities."""
    program = replace(sessions.dense(), acceleration_deg_s2=LIMIT)
    files = write_program(program, "ros2-trajectory", "s")
    found = verify(program, "ros2-trajectory", files)
    points = yaml.safe_load(files[1].text)["points"]
    time = np.array([p["time_from_start"]["sec"] + 1e-9 * p["time_from_start"]["nanosec"] for p in points])
    q, v = (np.rad2deg([p[key] for p in points]) for key in ("positions", "velocities"))
    rows = [k for k, p in enumerate(points) if k and any(p["velocities"])]
    first = next(k for k, m in enumerate(found.moves) if m.peak != 1.0)
    assert len(rows) > 150
    for n, k in enumerate(rows[:40]):
        j = int(np.abs(q[k] - q[k - 1]).argmax())
        speed = CubicHermiteSpline(time[k - 1 : k + 1], q[k - 1 : k + 1, j], v[k - 1 : k + 1, j]).derivative()
        peak = np.abs(speed(np.linspace(time[k - 1], time[k], 33))).max() / abs(q[k, j] - q[k - 1, j])
        assert found.moves[first + n].peak == pytest.approx(peak * (time[k] - time[k - 1]), rel=1e-4)


@pytest.mark.parametrize("limits", [(100.0,) * 5, (100.0, 100.0, 0.0, 100.0, 100.0, 100.0), (-1.0,) * 6])
def test_a_limit_that_is_none_is_refused(limits: tuple[float, ...]) -> None:
    with pytest.raises(InputError, match="acceleration_deg_s2 is no limit above 0 for each of 6 joints"):
        replace(sessions.static(), acceleration_deg_s2=limits)


def test_a_joint_that_nobody_limits_needs_no_ramp() -> None:
    """As a URDF leaves it that states no acceleration: the frames of a leg are then as even as planned."""
    program = replace(sessions.static(), acceleration_deg_s2=(np.inf,) * 6)
    files = write_program(program, "lerobot", "s")
    found = verify(program, "lerobot", files)
    assert found.moves[1].speed == pytest.approx(program.moves[1].duration_s, rel=1e-3)
