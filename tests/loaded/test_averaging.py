"""Whole turns, found and averaged: against curves that are known exactly."""

import numpy as np
import pytest

import tests.loaded.shared as shared
import tests.loaded.world as world
from planner.common.errors import InputError
from planner.loaded.curves import average_curves
from planner.loaded.evaluation import evaluate_loaded_circles


def made(rate=25.0, overshoot=np.pi, loads=(100.0, 300.0), repeats=2, wrong=None):
    """A run whose reading is a known function of angle, load and sense; ``wrong`` spoils what is overshoot."""
    way = world.course(shared.arm(), loads=loads, repeats=repeats, rate=rate, overshoot=overshoot)
    length = known(way.theta, way.force, way.sense_of_travel)
    if wrong is not None:
        length = np.where((way.theta < 0) | (way.theta > 2 * np.pi), length + wrong, length)
    return way, shared.run_of(way, length)


def known(theta, force, sense):
    return 0.1325 + 3e-4 * np.sin(theta) + 1e-4 * np.cos(3 * theta) - 1e-6 * force + 2e-5 * sense


@pytest.mark.parametrize("overshoot", [0.0, 0.4, np.pi])
def test_the_grid_holds_the_curve_and_every_repeat_counts(overshoot):
    _, run = made(overshoot=overshoot)
    (curves,) = average_curves(shared.setup(run), run, overshoot)
    assert curves.directions == (1, -1)
    assert np.all(curves.repeats == 2)
    np.testing.assert_allclose(curves.loads, [100, 300])
    for d, sense in enumerate(curves.directions):
        for k, load in enumerate((100.0, 300.0)):
            np.testing.assert_allclose(curves.length[d, k], known(curves.theta, load, sense), atol=4e-7)


def test_overshoot_is_dropped():
    _, run = made(wrong=1e-3)
    (curves,) = average_curves(shared.setup(run), run, np.pi)
    np.testing.assert_allclose(curves.length[0, 0], known(curves.theta, 100.0, 1), atol=4e-7)
    (spoilt,) = average_curves(shared.setup(run), run, 0.0)
    assert np.abs(spoilt.length[0, 0] - known(curves.theta, 100.0, 1)).max() > 2e-4


def test_two_turns_without_overshoot_count_twice():
    _, run = made(overshoot=np.pi, repeats=1)
    (curves,) = average_curves(shared.setup(run), run, 0.0)
    assert np.all(curves.repeats == 2)


def test_the_circle_is_the_programs():
    _, run = made()
    (curves,) = average_curves(shared.setup(run), run, np.pi)
    np.testing.assert_allclose(curves.circle.centre, world.CENTRE, atol=2e-6)
    assert curves.circle.radius == pytest.approx(world.RADIUS, abs=2e-6)
    np.testing.assert_allclose(curves.circle.axes, np.eye(3), atol=1e-4)


def test_the_angles_of_the_joints_are_averaged_too():
    _, run = made()
    (curves,) = average_curves(shared.setup(run), run, np.pi)
    q = world.angles(shared.arm(), world.circle_points(curves.theta))
    np.testing.assert_allclose(curves.q[0, 0], q, atol=2e-4)


def test_ways_there_and_back_are_left_out():
    way, run = made()
    away = np.linspace(0, 1, 300)[:, None] * np.array([0.3, -0.2, 0.1, 0, 0.2, 0])
    q = np.concatenate([way.q[:1] + away[::-1], way.q])
    length = np.concatenate([np.full(300, 0.2), run.readings.length])
    force = np.concatenate([np.full(300, 100.0), way.force])
    t = np.concatenate([np.arange(300) * 0.04 - 20.0, way.t])
    longer = world.Course(q, t, force, np.zeros(len(q)), np.zeros(len(q)), np.zeros(len(q)), np.zeros(len(q)))
    run = shared.run_of(longer, length)
    (curves,) = average_curves(shared.setup(run), run, np.pi)
    np.testing.assert_allclose(curves.length[0, 0], known(curves.theta, 100.0, 1), atol=4e-7)
    assert np.all(curves.repeats == 2)


def test_ramps_between_loads_are_no_loads():
    way, run = made(loads=(100.0, 200.0, 300.0))
    force = way.force.copy()
    edges = np.flatnonzero(np.diff(way.part)) + 1
    for e in edges:
        force[e : e + 20] = np.linspace(force[e - 1], force[e], 20)
    force = force + np.random.default_rng(1).normal(0, 1.5, len(force))
    run = shared.run_of(way, run.readings.length, force)
    (curves,) = average_curves(shared.setup(run), run, 0.5)
    np.testing.assert_allclose(curves.loads, [100, 200, 300], atol=1.0)
    assert np.all(curves.repeats >= 2)


def test_more_overshoot_than_the_passes_have_is_refused():
    _, run = made()
    with pytest.raises(InputError, match="--overshoot-deg 200 would drop more"):
        evaluate_loaded_circles(run, shared.cell(), overshoot=np.radians(200.0))
