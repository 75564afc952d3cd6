"""A fit comes to rest in a narrow curved valley; SciPy's least squares knows where."""

from contextlib import suppress
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import least_squares

from planner.common.errors import NoSolutionError
from planner.fit.least_squares import solve

PRIOR = np.array([2.0, 50.0])


class Valley:
    """Rosenbrock's function as readings of one unit of noise each: ``w`` (y - k x²) and 1 - x, from (-1, 0)."""

    prior = PRIOR
    model = SimpleNamespace(width=1)

    def __init__(self, curvature, steepness):
        self.curvature, self.steepness = curvature, steepness

    def __len__(self):
        return 2

    def residual(self, at):
        x, y = at
        return np.array([self.steepness * (y - self.curvature * x**2), 1.0 - x])

    def white_columns(self, at):
        left = -self.residual(at)  # what the model has still to explain
        slope = np.array([[-2 * self.curvature * self.steepness * at[0], self.steepness], [-1.0, 0.0]])
        table = np.column_stack([slope * PRIOR, left])
        return SimpleNamespace(gram=table.T @ table, factored=None)


def minimum(valley):
    """The lowest cost and where it is, by SciPy from both ends of the valley."""
    starts = ([-1.5, 0.0], [0.8, 0.64 * valley.curvature])
    finely = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15, "max_nfev": 20_000}
    tried = [least_squares(lambda at: np.append(valley.residual(at), at / PRIOR), s, **finely) for s in starts]
    best = min(tried, key=lambda t: t.cost)
    return 2 * best.cost, best.x


@pytest.mark.parametrize(("curvature", "steepness"), [(1, 3), (1, 30), (3, 10), (10, 3), (25, 10), (25, 1000)])
def test_a_fit_comes_to_rest_in_a_curved_valley(curvature, steepness):
    valley = Valley(curvature, steepness)
    found = solve(valley, np.array([-1.5, 0.0]), converged=1e-3)
    cost, where = minimum(valley)
    assert found.cost == pytest.approx(cost, abs=1e-4)
    np.testing.assert_allclose(found.errors, where, atol=0.01)


@pytest.mark.parametrize("curvature", [3, 5, 10])
def test_a_fit_in_too_narrow_a_valley_is_refused_or_right(curvature):
    """Braked steps are short wherever they are: that they are is no sign of rest (seen: a cost of 4.7, not 0.2)."""
    valley = Valley(curvature, 1000)
    with suppress(NoSolutionError):
        found = solve(valley, np.array([-1.5, 0.0]), converged=1e-3)
        assert found.cost == pytest.approx(minimum(valley)[0], abs=1e-4)
