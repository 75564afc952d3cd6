"""Runs of a planned test, made by pinocchio with known play in a joint: found, cut and evaluated."""

from dataclasses import replace

import numpy as np
import pytest

from planner.circular.document import circular_document, read_circular_plan
from planner.circular.evaluation import circular_test_content, evaluate_circles
from planner.circular.plan import circle_samples, circles_of, replace_circles
from planner.common.errors import InputError
from planner.common.files import document_text
from planner.motion.collision.engines import pin_model
from planner.runs.run import Readings, Run
from planner.simulation.simulated_run import SAMPLE_RATE
from tests.not_everywhere import pin

PLAY = 6e-5  # [rad] of joint 1
SHIFT = np.array([2e-4, -3e-4, 0.0])  # [m] of the fixture


@pytest.fixture(scope="module")
def plan_file(planned, tmp_path_factory):
    path = tmp_path_factory.mktemp("plan") / "plan.json"
    path.write_text(document_text(circular_document(planned).content()))
    return read_circular_plan(path)


@pytest.fixture(scope="module")
def made(planned):
    """The run, and the true bar's length as a function of the joint angles."""
    cell, samples = planned.cell, circle_samples(planned, SAMPLE_RATE)
    model, frames = pin_model(cell.robot)
    data, (joint, placement) = model.createData(), frames[-1]

    def length(q, fixture):
        out = np.empty(len(q))
        for k, theta in enumerate(cell.robot.theta(q)):
            pin.forwardKinematics(model, data, theta)
            T = data.oMi[joint] * placement * pin.SE3(cell.robot.flange_frame())
            out[k] = np.linalg.norm(T.act(np.array(cell.tool.p_FM)) - fixture)
        return out

    fixture = cell.fixtures[0].p_BX + SHIFT
    q = samples.q.copy()
    q[:, 0] -= PLAY / 2 * np.sign(samples.speed[:, 0])
    noise = np.random.default_rng(2).normal(scale=3e-7, size=len(q))
    run = Run(
        "made", replace(samples, q_read=samples.q), Readings(length=length(q, fixture) + noise), ("A",), continuous=True
    )
    return run, lambda angles: length(angles, fixture)


@pytest.fixture(scope="module")
def found(planned, plan_file, made):
    return evaluate_circles(planned.cell, plan_file, made[0])


@pytest.mark.slow
def test_every_sweep_is_found_once(found):
    assert [(c.ring.circle.name, [p.direction for p in c.paths]) for c in found.circles] == [
        ("round", ["ccw", "cw"]),
        ("arc", ["ccw", "cw"]),
    ]
    assert all(p.sweeps == 1 for c in found.circles for p in c.paths)
    for c, degrees in zip(found.circles, (360.0, 60.0), strict=True):
        for p in c.paths:
            assert np.rad2deg(np.ptp(p.angle)) == pytest.approx(degrees, abs=0.2)


def test_the_fixtures_shift_is_the_centre(found):
    assert found.circles[0].centre.centre == pytest.approx(-SHIFT[:2], abs=3e-6)


def test_play_shows_at_its_joints_reversals(planned, found, made):
    """The jump is play times how the bar's length changes with the joint, by finite differences of pinocchio's."""
    _, length = made
    arc = planned.drives[0].arcs[0]
    checked = 0
    for path in found.circles[0].paths:
        sense = 1 if path.direction == "ccw" else -1
        for r in (r for r in path.reversals if 0 in r.joints and np.isfinite(r.step)):
            q = np.array([np.interp(r.angle, arc.angle, column) for column in arc.q.T])
            ahead = np.array([np.interp(r.angle + sense * 0.1, arc.angle, column) for column in arc.q.T])
            step = np.zeros(6)
            step[0] = 1e-6
            slope = (length((q + step)[None]) - length((q - step)[None]))[0] / 2e-6
            expected = -np.sign(ahead[0] - q[0]) * PLAY * slope
            assert r.step == pytest.approx(expected, abs=0.06 * abs(expected) + 0.5e-6)
            checked += abs(expected) > 10e-6
    assert checked >= 2


@pytest.mark.slow
def test_without_play_nothing_is_left(planned, plan_file, made):
    run, length = made
    exact = replace(run, readings=Readings(length=length(run.samples.q)))
    c = evaluate_circles(planned.cell, plan_file, exact).circles[0]
    assert c.G_b < 2e-6
    assert c.H < 2e-6
    assert max(abs(r.step) for p in c.paths for r in p.reversals if np.isfinite(r.step)) < 0.5e-6
    assert pytest.approx(0.0, abs=4e-6) == c.D


@pytest.mark.slow
def test_deviation_from_the_angles_leaves_out_how_well_the_path_was_followed(planned, plan_file, made):
    """Joints that lag behind change the length and the angles read alike."""
    run, length = made
    q = run.samples.q + 2e-4 * np.sin(run.samples.t / 3.0)[:, None]
    lagging = replace(run, samples=replace(run.samples, q=q, q_read=q), readings=Readings(length=length(q)))
    c = evaluate_circles(planned.cell, plan_file, lagging).circles[0]
    straight = evaluate_circles(
        planned.cell, plan_file, replace(run, readings=Readings(length=length(run.samples.q)))
    ).circles[0]
    assert c.G_b > 50e-6
    assert c.calculated_range == pytest.approx(straight.calculated_range, abs=3e-6)


def test_what_is_missing_is_said(planned, plan_file, made):
    run = made[0]
    half = int(np.argmax(np.diff(run.samples.t) > 2.0)) + 1  # up to the first pause: the first sweep ccw
    test = evaluate_circles(planned.cell, plan_file, run.take(slice(0, half)))
    assert "circle round: no whole sweep cw in the run" in test.warnings
    assert "circle arc is not in the run" in test.warnings
    assert test.circles[0].G_b is None
    content = circular_test_content(test)
    assert content["circles"][0]["G_b_um"] is None


def test_runs_that_cannot_be_evaluated(planned, plan_file, made):
    run = made[0]
    with pytest.raises(InputError, match="no whole sweep"):
        evaluate_circles(planned.cell, plan_file, run.take(slice(0, 300)))
    with pytest.raises(InputError, match="length_mm is missing"):
        evaluate_circles(planned.cell, plan_file, replace(run, readings=Readings(position=np.zeros((len(run), 3)))))


def test_loads_are_told_apart_by_their_force(planned, plan_file, made):
    run = made[0]
    cell = replace_circles(planned.cell, *(replace(c, loads=(125.0, 250.0)) for c in circles_of(planned.cell)))
    force = np.where(run.samples.t < run.samples.t[len(run) // 4], 128.0, 246.0)
    loaded = replace(run, samples=replace(run.samples, force=force))
    test = evaluate_circles(cell, plan_file, loaded)
    assert {c.load for c in test.circles} == {125.0, 250.0}
