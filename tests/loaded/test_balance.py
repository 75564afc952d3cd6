"""The arm in balance with its loads, and a simulated loaded run, against the world that shares no code."""

from dataclasses import replace

import numpy as np
import pytest

import tests.loaded.shared as shared
import tests.loaded.world as world
from planner.cell.cell import setup_of
from planner.cell.placement import Targets
from planner.effects.compliance import compliance_parameters
from planner.model.model import Model
from planner.runs.run import Samples
from planner.simulation.equilibrium import solve_equilibrium
from planner.simulation.simulated_run import simulate_run
from planner.simulation.truth import Truth

ANGLES = 24


@pytest.fixture(scope="module")
def model():
    setup = setup_of(shared.cell())
    return Model.of(setup, frozenset({"fixture", "zero"})).plus(compliance_parameters(setup))


@pytest.fixture(scope="module")
def errors(model):
    """Those of the world: geometry, compliances, and a ball that is a millimetre off."""
    ball = {f"fixture_A_{a}": v for a, v in zip("xyz", (-6e-4, 5e-4, 8e-4), strict=True)}
    soft = {f"compliance{i + 1}": v for i, v in enumerate(world.SOFT)}
    known = shared.ERRORS | ball | soft
    assert set(known) <= set(model.names)
    return np.array([known.get(n, 0.0) for n in model.names])


@pytest.fixture(scope="module")
def samples():
    theta = (np.arange(ANGLES) + 0.5) * 2 * np.pi / ANGLES
    q = np.tile(world.angles(shared.arm(), world.circle_points(theta)), (len(world.LOADS), 1))
    return Samples(q=q, place=np.zeros(len(q), int), force=np.repeat(world.LOADS, ANGLES))


@pytest.fixture(scope="module")
def true(errors, model, samples):
    ball = world.FIXTURE + errors[[model.names.index(f"fixture_A_{a}") for a in "xyz"]]
    x = world.true_point(shared.arm(), world.World(errors=shared.ERRORS), samples.q, samples.force, ball)
    return np.linalg.norm(x - ball, axis=1)


def read(model, samples, errors):
    return -model.residual(samples, Targets(length=np.zeros(len(samples))), errors)[:, 0]


def test_the_readings_are_those_of_the_world(model, errors, samples, true):
    """Within a micrometre: what geometric errors change of the weights' levers is left out. Not so without balance."""
    assert np.abs(read(*solve_equilibrium(model, samples, errors), errors) - true).max() < 1e-6
    assert np.abs(read(model, samples, errors) - true).max() > 4e-6


def test_so_are_the_deflections_between_loads(model, errors, samples, true):
    found = read(*solve_equilibrium(model, samples, errors), errors).reshape(len(world.LOADS), -1)
    wanted = true.reshape(len(world.LOADS), -1)
    assert np.abs(wanted[-1] - wanted[0]).max() > 5e-4
    np.testing.assert_allclose(found[1:] - found[0], wanted[1:] - wanted[0], atol=1e-8)


def test_a_loaded_run_is_simulated_in_balance(model, errors, samples, true):
    silent = replace(model.setup.gauge, noise=0.0)
    quiet = replace(model, setup=replace(model.setup, gauge=silent, joint_sigma=0.0))
    run = simulate_run(shared.cell(), "x", samples, Truth(quiet, errors), 0)
    assert np.abs(run.readings.length - true).max() < 1e-6
    assert run.samples.torque is None  # nobody logged them
