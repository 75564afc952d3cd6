"""Columns that stand for those at the next steps: the same minimum as with columns formed at each."""

import numpy as np
import pytest

import planner.fit.least_squares as least_squares
from planner.fit.least_squares import solve
from tests.identification.worlds import world
from tests.simulation.generator.truth import Noise, draw_errors


@pytest.fixture(scope="module")
def run():
    w, rng = world(n=120), np.random.default_rng(5)
    return w.measured(draw_errors(w.arm, rng, 4e-4, 5e-4), Noise(), rng)


def test_the_minimum_is_the_same(run, monkeypatch):
    problem = world(n=120).fitted(run)[0].problem
    anew = solve(problem)
    monkeypatch.setattr(least_squares, "FROZEN_NUMBERS", 0)
    frozen = solve(problem)
    sigma = np.linalg.norm(anew.root(problem.prior), axis=1)
    assert np.abs((frozen.errors - anew.errors) / sigma).max() < 0.03
    assert np.linalg.norm(frozen.root(problem.prior), axis=1) == pytest.approx(sigma, rel=0.01)
    assert frozen.cost == pytest.approx(anew.cost, abs=1e-3)


def test_the_fit_is_as_near_as_its_noise_is_settled(run, monkeypatch):
    anew = world(n=120).fitted(run)[0]
    monkeypatch.setattr(least_squares, "FROZEN_NUMBERS", 0)
    frozen = world(n=120).fitted(run)[0]
    sigma = np.linalg.norm(anew.solution.root(anew.problem.prior), axis=1)
    assert np.abs((frozen.errors - anew.errors) / sigma).max() < 0.1
    assert frozen.problem.whitener.noise.gauge == pytest.approx(anew.problem.whitener.noise.gauge, rel=0.02)
    assert frozen.effective == pytest.approx(anew.effective, abs=0.05)
