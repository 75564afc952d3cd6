"""The robot between geometry alone and the posterior: of few drawn robots with two errors, against other minimisers."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import minimize

from planner.fit.assumptions import DOUBT, NOTICED
from planner.fit.least_squares import Fit, Solution
from planner.inference.misfit import Misfit
from planner.release.compromise import (
    choose_compromise,
    interpolate_fit,
    minimise_expected_error,
    safe_share,
)
from planner.release.released_robot import ReleasedRobot
from planner.release.tool_map import ToolMap

NAMES = ("a", "b")
RISKS = (1.0, 2.0, 4.0)
COUNT = 400


def fit_of(errors):
    problem = SimpleNamespace(model=SimpleNamespace(names=NAMES))
    return Fit(problem, Solution(np.array(errors, dtype=float), np.eye(2), 0.0), 2.0, np.zeros(0, dtype=int))


def geometry_of(drawn, rest=0.01, stretch=1.0):
    """Geometry alone has neither error; the tool moves by what each is, along an axis of its own."""
    count = drawn.shape[1]
    fit = fit_of(drawn.mean(axis=1))
    posterior = SimpleNamespace(fit=fit, drawn=drawn, of_noise=drawn - fit.errors[:, None])
    tool = ToolMap(np.zeros((1, 6)), np.zeros(3), np.zeros((1, 3)), NAMES, np.eye(3)[None, :, :2])
    misfit = Misfit(np.full(count, stretch), np.full(count, rest))
    alone, held = fit_of([0.0, 0.0]), SimpleNamespace()
    return ReleasedRobot(
        alone,
        alone,
        posterior,
        misfit,
        np.zeros(count),
        np.zeros(count),
        tool,
        (),
        (),
        None,
        tool,
        held,
        None,
        np.zeros((1, 1)),
    )


def one_sure_one_likely(absent):
    """An error of 3 that is missing in a share ``absent`` of the robots, and one of 1 that all have."""
    rng = np.random.default_rng(0)
    there = np.arange(COUNT) >= round(absent * COUNT)
    return np.stack([3.0 * there, np.ones(COUNT)]) + rng.normal(0, 0.05, (2, COUNT))


def worse(geometry, fit):
    return float((geometry.drawn_errors(fit) > NOTICED * geometry.drawn_errors(geometry.geometry)).mean())


@pytest.mark.parametrize("risk", RISKS)
@pytest.mark.parametrize("stretch", [1.0, 2.0])
def test_a_compromise_has_the_least_power_of_the_error_over_that_of_geometry(risk, stretch):
    """Another minimiser, of the drawn errors themselves, finds none better."""
    geometry = geometry_of(one_sure_one_likely(0.03), stretch=stretch)
    alone = geometry.drawn_errors(geometry.geometry)

    def cost(errors):
        return ((geometry.drawn_errors(fit_of(errors)) / alone) ** (2 * risk)).mean()

    best = minimize(cost, geometry.posterior.fit.errors, method="Nelder-Mead", options={"xatol": 1e-6, "fatol": 1e-9})
    found = minimise_expected_error(geometry, risk)
    assert cost(found.errors) <= 1.01 * best.fun
    assert np.allclose(found.errors, best.x, atol=0.1)


def test_what_is_certain_is_taken_where_something_else_is_not():
    """A way to the mean would end early, since 3 % of the robots lack the larger error."""
    geometry = geometry_of(one_sure_one_likely(0.03))
    first = minimise_expected_error(geometry)
    early = interpolate_fit(geometry.fit, first, safe_share(geometry, first))
    chosen = interpolate_fit(geometry.fit, *choose_compromise(geometry))
    assert safe_share(geometry, first) < 0.5
    assert early.errors[1] < 0.5 < 0.8 < chosen.errors[1]
    assert geometry.likely_workspace_error(chosen) < 0.95 * geometry.likely_workspace_error(early)
    assert worse(geometry, chosen) <= DOUBT + 1 / COUNT


@pytest.mark.parametrize("absent", [0.0, 0.01, 0.05, 0.2, 0.6])
def test_the_robot_is_hardly_ever_noticeably_worse_and_as_good_as_any_such(absent):
    geometry = geometry_of(one_sure_one_likely(absent))
    chosen = interpolate_fit(geometry.fit, *choose_compromise(geometry))
    assert worse(geometry, chosen) <= DOUBT + 1 / COUNT
    for risk in RISKS:
        aim = minimise_expected_error(geometry, risk)
        other = interpolate_fit(geometry.fit, aim, safe_share(geometry, aim))
        assert geometry.likely_workspace_error(chosen) <= geometry.likely_workspace_error(other)


def test_where_everything_is_certain_all_of_it_is_taken():
    geometry = geometry_of(one_sure_one_likely(0.0))
    aim, share = choose_compromise(geometry)
    assert share == 1.0
    assert np.allclose(aim.errors, [3.0, 1.0], atol=0.05)


def test_where_nothing_moves_the_tool_no_compromise_is_sought():
    geometry = geometry_of(one_sure_one_likely(0.0), rest=0.0)
    still = replace(geometry, tool=replace(geometry.tool, rows=np.zeros((1, 3, 2))))
    aim, share = choose_compromise(still)
    assert share == 0.0
    assert np.array_equal(aim.errors, still.posterior.fit.errors)


@pytest.mark.parametrize("point", [(3.0, 1.0), (0.0, 0.0), (1.5, 0.5), (1.0, 2.0), (-1.0, 3.0)])
def test_the_length_along_the_way_to_the_mean_is_that_of_the_projection(point):
    geometry = geometry_of(one_sure_one_likely(0.03))
    mean = geometry.posterior.fit.errors
    assert geometry.length_along(fit_of(point)) == pytest.approx(np.dot(point, mean) / np.dot(mean, mean), abs=1e-9)
