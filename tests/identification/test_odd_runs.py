"""Runs of a kind that is easily forgotten: joints that hardly move, targets read together, rows without approaches."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from planner.cell.cell import setup_of
from planner.cell.reading import load_cell
from planner.effects.backlash import Hysteresis
from planner.effects.catalogue import catalogue
from planner.effects.effect import Parameter, transform_move
from planner.effects.nonparametric import gear_curve
from planner.fit.better_explanations import explain_better
from planner.fit.cross_validation import validate_fit
from planner.fit.least_squares import fit
from planner.fit.problem import FitProblem
from planner.fit.run_setup import add_motion, directions_by_row, number_samples, setup_for_run
from planner.kinematics.robot_reader import load_robot
from planner.motion.collision.engines import pin_model
from planner.runs.joint_motion import looks_continuous
from planner.runs.run import Samples
from tests.cell.test_robots import urdf_text
from tests.identification.worlds import world
from tests.not_everywhere import require_planning


@pytest.mark.parametrize("travel", [1e-3, 1e-2, 0.1])
def test_the_curve_of_a_joint_that_hardly_moves_has_finite_sizes(travel):
    w = world()
    q = np.tile(w.q[:1], (40, 1))
    q[:, 1] += np.linspace(0, travel, 40)
    for quickness in (3.0, 30.0):
        sizes = np.array([p.prior for p in gear_curve(w.model.setup, q, 1, quickness).make()])
        assert np.isfinite(sizes).all()
        assert np.isclose((sizes**2).sum() / 2, 4e-8)  # the size that is stated, sine and cosine each


def test_targets_that_are_read_together_make_no_continuous_run():
    t = np.repeat(np.arange(50.0) * 12, 3)
    q = np.repeat(np.random.default_rng(1).uniform(-1, 1, (50, 6)), 3, axis=0)
    assert not looks_continuous(t, q)
    assert looks_continuous(np.arange(150) * 0.01, np.cumsum(np.full((150, 6), 1e-4), axis=0))


def test_a_drive_that_is_logged_now_and_then_is_a_drive():
    """A smooth path from pose to pose, each a few seconds from the last, in ever longer steps of time."""
    rng = np.random.default_rng(3)
    poses = CubicSpline(np.arange(80) * 6.0, rng.uniform(-1, 1, (80, 6)))
    for step in (0.01, 0.3, 0.5, 1.0, 2.0):
        t = np.arange(0, 470, step)
        assert looks_continuous(t, poses(t)), step
    at_rest = rng.uniform(-1, 1, (200, 6))
    for step in (0.1, 1.0, 20.0):  # the number of the row may stand for its time
        assert not looks_continuous(step * np.arange(200), at_rest), step
    grid = np.cumsum(np.full((200, 6), 0.02), axis=0)
    assert not looks_continuous(12.0 * np.arange(200), grid)  # nobody drives so slowly
    again = np.repeat(at_rest, 5, axis=0)
    assert not looks_continuous(np.arange(1000.0), again)
    t = np.arange(0, 470, 0.5)  # it stands at each pose for more than half of the time, and is logged all along
    assert not looks_continuous(t, poses(6 * (t // 6 + np.clip((t % 6) / 2, 0, 1))))
    backwards = np.where(np.arange(len(t)) < 400, t, t - 300)
    assert not looks_continuous(backwards, poses(t))


def test_directions_of_approach_follow_the_rows():
    q = np.array([[0.0, 0.0], [0.1, 0.0], [0.1, -0.2], [0.0, -0.2], [0.5, 0.5], [0.4, 0.5]])
    session = np.array([0, 0, 0, 0, 1, 1])
    samples = Samples(q, np.zeros(6, dtype=int), session=session)
    assert directions_by_row(samples).tolist() == [[0, 0], [1, 0], [1, -1], [-1, -1], [0, 0], [-1, 0]]


def test_a_part_of_a_run_keeps_what_came_before():
    run = number_samples(world().run)
    part = add_motion(run.take(np.arange(7, len(run), 10)))
    assert part.samples.number.tolist() == list(range(7, len(run), 10))
    assert np.array_equal(part.samples.direction, run.samples.direction[7::10])
    assert np.array_equal(part.samples.reversals, run.samples.reversals[7::10])


def test_a_validation_run_without_the_column_of_an_effect_is_judged():
    """Hysteresis needs the reversals before each pose; a run that has none takes its mean."""
    w = world()
    run = number_samples(w.run)
    k = w.model.setup.chain.joint_places[2]
    extra = Parameter(
        "hysteresis3", "rad", 1e-4, "", transform_move(int(k), Hysteresis(2, 0.05)), "hysteresis, joint 3"
    )
    found = fit(FitProblem.of(w.model.plus([extra]), run))
    bare = setup_for_run(w.cell, run)
    few = replace(w.run.take(np.arange(0, len(run), 9)))
    assert few.samples.reversals is None
    assert 0 < validate_fit(found, few, bare).rms < 1e-3


def test_an_arm_of_ten_joints_is_read(tmp_path):
    require_planning()
    path = tmp_path / "arm.urdf"
    path.write_text(urdf_text(["0 0 1", "0 1 0"] * 5))
    robot = load_robot(str(path), tip="tip")
    assert robot.n_joints == 10
    assert pin_model(robot)[0].nq == 10


def test_compliance_without_masses_is_a_turn():
    """A newton metre means nothing where no link has a mass: the turn under the run's largest load does."""
    setup = setup_of(load_cell("ur10/edbb"))
    bare = replace(setup.robot, masses=(None,) * 6)
    q = np.random.default_rng(2).uniform(-2, 2, (60, 6))
    offered = catalogue(replace(setup, robot=bare, tool_mass=0.0), Samples(q, np.zeros(60, dtype=int)))
    kinds = {"joint compliance", "tool compliance"}
    assert {e.unit for e in offered if e.kind in kinds} == {"rad"}
    context_turn = next(e for e in offered if e.name == "joint compliance, joint 2").make()
    assert all(p.prior == pytest.approx(3e-4) for p in context_turn)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("joint", "by", "ratio", "words"),
    [(3, 2, -1.0, "couple = { 2 = -1 }"), (4, 4, -2.0, "joint 4 counts the other way")],
)
def test_a_robot_whose_angles_are_counted_otherwise_gets_a_hint(joint, by, ratio, words):
    w = world(n=60)
    length = w.read({}, {f"theta{joint}": ratio * w.q[:, by - 1]})
    run = w.reading(length)
    assert words in explain_better(w.cell, run)
    assert explain_better(w.cell, w.reading(w.read({}))) == ""
