"""A planned circle really is one: held against pinocchio's forward kinematics, not against ours."""

import re
from dataclasses import replace

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.circular.plan import points_on_sweep
from planner.circular.planning import plan_circles
from planner.motion.collision.engines import CollisionWorld, pin_model
from planner.motion.timing.leg_times import axis_limits
from planner.motion.timing.trajectory import check_limits
from planner.programs.dialect import load_dialect
from planner.programs.verification import ProgramMismatchError
from planner.runs.run import FIRST_MOUNTING
from planner.session.neutral_program import session_program
from planner.session.options import PlanOptions
from tests.circular.conftest import cell_file, quiet
from tests.motion.timing.bound import KEPT, largest_share
from tests.not_everywhere import pin
from tests.programs.reading import read_back, verify

CENTRE = np.array([258.0, 1468.0, 708.0]) * 1e-3


def tools(cell, q):
    """Measured points (n, 3) and flange orientations (n, 3, 3), by pinocchio."""
    model, frames = pin_model(cell.robot)
    data, (joint, placement) = model.createData(), frames[-1]
    points, turns = [], []
    for theta in cell.robot.theta(np.asarray(q)):
        pin.forwardKinematics(model, data, theta)
        T = data.oMi[joint] * placement * pin.SE3(cell.robot.flange_frame())
        points.append(T.act(np.array(cell.tool.p_FM)))
        turns.append(T.rotation.copy())
    return np.array(points), np.array(turns)


def arc_of(planned, name):
    return next(a for d in planned.drives for a in d.arcs if a.circle.name == name)


def test_points_lie_on_the_circle_and_the_tool_keeps_its_orientation(planned):
    arc = arc_of(planned, "round")
    x, R = tools(planned.cell, arc.q)
    assert np.abs(np.linalg.norm(x - CENTRE, axis=1) - 0.350).max() < 1e-9
    assert np.abs(x[:, 2] - CENTRE[2]).max() < 1e-9
    assert np.abs(R - R[0]).max() < 1e-8
    angle = np.unwrap(np.arctan2(x[:, 1] - CENTRE[1], x[:, 0] - CENTRE[0]))
    assert np.allclose(np.diff(angle), np.diff(arc.angle), atol=1e-9)
    assert np.allclose(np.rad2deg([arc.angle[0], arc.angle[-1]]), [170, 550])
    assert {180.0, 540.0} <= set(np.round(np.rad2deg(arc.angle), 9))


def test_half_plane_circle_lies_in_its_plane(planned):
    arc = arc_of(planned, "arc")
    x, R = tools(planned.cell, arc.q)
    assert np.abs(x[:, 1] - CENTRE[1]).max() < 1e-9
    assert np.abs(np.linalg.norm(x - CENTRE, axis=1) - 0.350).max() < 1e-9
    assert np.abs(R - R[0]).max() < 1e-8
    assert np.rad2deg(np.arctan2(x[0, 2] - CENTRE[2], x[0, 0] - CENTRE[0])) == pytest.approx(55.0)
    assert (np.diff(np.arctan2(x[:, 2] - CENTRE[2], x[:, 0] - CENTRE[0])) > 0).all()


@pytest.mark.parametrize("name", ["round", "arc"])
@pytest.mark.parametrize("way", ["ccw", "cw"])
def test_as_driven_it_leaves_the_circle_by_little_and_keeps_its_speed(planned, name, way):
    arc = arc_of(planned, name)
    trajectory = getattr(arc, way).trajectory
    x, _ = tools(planned.cell, trajectory.sample(0.11).q)
    off = np.abs(np.linalg.norm(x - CENTRE, axis=1) - 0.350).max()
    assert off < 5e-6
    assert off < arc.off + 1e-7
    marks = np.flatnonzero(points_on_sweep(arc.circle, arc.angle))[[0, -1]]
    times = trajectory.waypoint_time[marks if way == "ccw" else len(arc.q) - 1 - marks[::-1]]
    inside = trajectory.at(np.linspace(*times, 500))
    assert inside.tool_speed.max() <= arc.circle.speed * (1 + 1e-6)
    assert inside.tool_speed.min() > 0.995 * arc.circle.speed
    assert arc.slowest_on_sweep == pytest.approx(inside.tool_speed.min(), rel=1e-3)
    assert largest_share(check_limits(trajectory, axis_limits(planned.cell, bar=True), 0.1)) <= KEPT


def test_nothing_collides_on_the_way(planned):
    for drive in planned.drives:
        world = CollisionWorld.from_cell(planned.cell, drive.mounting)
        for one in drive.passes:
            assert not world.collides(one.trajectory.sample(0.25).q).any()
        assert (
            not CollisionWorld(world.scene.without_bar()).collides(drive.course.travel.trajectory.sample(0.1).q).any()
        )
        assert all(v.clear for v in drive.verdicts)
        assert all(v.clear for a in drive.arcs for v in a.verdicts)


def test_passes_follow_each_other_and_measure_both_directions(planned):
    (drive,) = planned.drives
    measured = [(drive.arcs[p.arc].circle.name, p.direction) for p in drive.passes if p.arc is not None]
    assert measured == [("round", "ccw"), ("round", "cw"), ("arc", "ccw"), ("arc", "cw")]
    for a, b in zip(drive.passes, drive.passes[1:], strict=False):
        assert np.abs(a.path.q[-1] - b.path.q[0]).max() < 1e-6
    mount = planned.cell.mount(FIRST_MOUNTING)
    assert np.abs(drive.course.travel.q[-1] - mount).max() == 0.0
    assert np.abs(drive.passes[-1].path.q[-1] - mount).max() < 1e-6
    marks = [m for p in drive.passes for m in p.marks]
    assert marks == list(range(8))


@pytest.mark.parametrize("dialect", ["krl", "rapid"])
def test_where_a_controller_knows_circles_it_drives_them_itself(planned, dialect):
    files = dict(planned.programs)[dialect]
    read = read_back(dialect, files)
    start = np.vstack([read.joint_path_deg[:1], read.joint_path_deg[:-1]])
    assert len(read.joint_path_deg) < 60
    assert sum(len(f.text) for f in files) < 30_000
    covered = {"round": 0.0, "arc": 0.0}
    for k, via in [(k, m.via_deg) for k, m in enumerate(read.moves) if m.via_deg is not None]:
        x, R = tools(planned.cell, np.deg2rad([start[k], via, read.joint_path_deg[k]]))
        assert np.abs(R - R[0]).max() < 1e-5, "the tool does not turn, so that tool and base do not matter"
        radii = np.linalg.norm(x - CENTRE, axis=1)
        assert np.abs(radii - 0.350).max() < 20e-6
        a, b = x[0] - CENTRE, x[2] - CENTRE
        half = np.arccos(a @ (x[1] - CENTRE) / 0.35**2) + np.arccos((x[1] - CENTRE) @ b / 0.35**2)
        assert half < np.deg2rad(121)
        covered["round" if np.abs(x[:, 2] - CENTRE[2]).max() < 20e-6 else "arc"] += half
        assert read.moves[k].speed <= (100.0 if covered["arc"] == 0.0 else 100.001)
        assert abs(read.moves[k].blend or 0.0) <= 1.0
    assert covered["round"] == pytest.approx(2 * np.deg2rad(380), abs=1e-3)
    assert covered["arc"] == pytest.approx(2 * np.deg2rad(70), abs=1e-3)


SPOILT = {  # dialect: what stands before a place of a circle, its word, and a quicker speed
    "krl": (r"=\{A1 ", ("CIRC ", "LIN "), (r"\$VEL\.CP=0\.", "$VEL.CP=9.")),
    "rapid": (r"CalcRobT\(\[\[", ("MoveC ", "MoveL "), (r"\n +\[", "\n  [9")),
}


@pytest.mark.parametrize("dialect", SPOILT)
@pytest.mark.parametrize("what", ["through", "end", "word", "speed"])
def test_a_circle_that_is_not_the_planned_one_is_not_released(planned, dialect, what):
    files = dict(planned.programs)[dialect]
    program = session_program(planned.cell, planned.courses, planned.plan_id, load_dialect(dialect).path_form)
    text, (place, word, (slow, quick)) = files[0].text, SPOILT[dialect]
    circles = text.index(word[0])
    if what in ("through", "end"):
        first = [m.end() for m in re.finditer(place, text)][what == "end"]
        text = f"{text[:first]}1{text[first:].lstrip('-')}"
    elif what == "word":
        text = text.replace(*word, 1)
    else:
        before = text.rindex("AX_", 0, circles) if dialect == "krl" else circles
        text = text[:before] + re.sub(slow, quick, text[before:], count=1)
    assert text != files[0].text
    with pytest.raises(ProgramMismatchError):
        verify(program, dialect, (replace(files[0], text=text), *files[1:]))


@pytest.mark.long
def test_a_tool_that_turns_with_the_bar_is_driven_in_joints(tmp_path):
    circle = '\n[[circles]]\nname = "f"\nradius_mm = 350\nstart_deg = 180\nsweep_deg = 60\nspeed_mm_s = 100\n'
    for how, circles in (("constant", 2), ("follow", 0)):
        path = cell_file(tmp_path, circle + f'orientation = "{how}"\ndirections = ["ccw"]\n')
        plan = plan_circles(load_cell(str(path)), PlanOptions(dialect=("krl",)), quiet())
        moves = read_back("krl", plan.programs[0][1]).moves
        assert any(m.via_deg is not None for m in moves) == (circles > 0)


@pytest.mark.slow
@pytest.mark.parametrize("dialect", ["din66025", "bnr"])
def test_what_a_program_says_is_the_circle(planned, dialect):
    files = dict(planned.programs)[dialect]
    read = read_back(dialect, files)
    assert read.plan_id == planned.plan_id
    program = session_program(planned.cell, planned.courses, planned.plan_id, load_dialect(dialect).path_form)
    assert len(read.joint_path_deg) == len(program.moves)
    assert read.syncs == 8
    x, _ = tools(planned.cell, np.deg2rad(read.joint_path_deg))
    off = np.linalg.norm(x - CENTRE, axis=1) - 0.350
    flat = np.abs(x[:, 2] - CENTRE[2]) < 20e-6
    around = np.unwrap(np.arctan2(x[flat, 1] - CENTRE[1], x[flat, 0] - CENTRE[0]))
    assert np.abs(off[flat]).max() < 20e-6  # what the dialect's decimals leave
    assert np.ptp(around) > np.deg2rad(379)  # all of the 380 degrees
    turned = np.sign(np.diff(around))
    assert (turned > 0).sum() > 500
    assert (turned < 0).sum() > 500
