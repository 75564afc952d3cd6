"""Levenberg–Marquardt on the exact non-linear model, priors counted as further readings."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from planner.errors import NoSolutionError
from planner.identification.problem import Problem
from planner.repeatable import evenly
from planner.units import Array

WARM = 3_000  # samples of a long run that find the minimum before all of them polish it
ROUGH = 0.05  # the same while noise and priors are still being settled
FLAT = 3e-5  # a fall of the sum of squares this small, in noise variances, tells nothing any more
STEPS = 50
CONVERGED = 1e-3  # a step this small, in the parameters' own standard deviations, ends the fit


@dataclass(frozen=True)
class Solution:
    """Where the fit came to rest.

    Attributes:
        errors: values of the parameters, (P,).
        factor: R (P, P), upper triangular, of rows per prior size with the prior: RᵀR is the information.
        cost: weighted sum of squares with the prior's.
        steps: how many were taken.
    """

    errors: Array
    factor: Array
    cost: float
    steps: int

    def root(self, prior: Array) -> Array:
        """Square root S (P, P) of the covariance, S Sᵀ, in the parameters' units."""
        return np.asarray(prior[:, None] * np.linalg.inv(self.factor))


def solve(problem: Problem, start: Array | None = None, converged: float = CONVERGED) -> Solution:
    """Fit the model's parameters; ``converged`` in standard deviations ends it.

    Raises:
        NoSolutionError: the fit does not come to rest.
    """
    errors = np.zeros(len(problem.prior)) if start is None else np.array(start)
    if len(problem) > 2 * WARM:
        few = problem.take(evenly(len(problem), WARM))
        errors = _descend(few, errors, ROUGH).errors
    return _descend(problem, errors, converged)


@dataclass(frozen=True)
class _Triangle:
    """The whole problem about some errors, rows and residuals with the prior's, in P + 1 rows.

    ``factor`` (P, P) and ``right`` (P,) give the next step, ``factor``·z = ``right``; ``cost`` is where it stands now.
    The columns are per prior size and the prior is in: the information is never below 1, its root by Cholesky exact
    enough.
    """

    factor: Array
    right: Array
    cost: float

    @classmethod
    def about(cls, problem: Problem, errors: Array) -> "_Triangle":
        """Linearise about errors (P,) [m, rad]; the cost is infinite where the model cannot follow them."""
        whole = np.asarray(sum(problem.over_pieces(lambda part: problem.piece(part, errors).gram)))
        z = errors / problem.prior
        if not np.all(np.isfinite(whole)):  # a step far beyond what the model can follow
            return cls(np.eye(len(z)), 0 * z, np.inf)
        factor = cholesky(whole[:-1, :-1] + np.eye(len(z)))
        right = solve_triangular(factor, whole[:-1, -1] - z, trans="T")
        return cls(factor, right, float(whole[-1, -1] + z @ z))

    def step(self, damping: float) -> Array:
        """Solve for the step, turned towards steepest descent by ``damping`` (Marquardt's scaling)."""
        if damping == 0.0:
            return np.asarray(solve_triangular(self.factor, self.right))
        brake = np.sqrt(damping) * np.linalg.norm(self.factor, axis=0)
        return np.asarray(
            np.linalg.lstsq(np.vstack([self.factor, np.diag(brake)]), np.append(self.right, 0 * brake))[0]
        )


def _descend(problem: Problem, errors: Array, converged: float) -> Solution:
    here, damping = _Triangle.about(problem, errors), 0.0
    readings = len(problem) * problem.model.width
    for step in range(1, STEPS + 1):
        z = here.step(damping)
        trial = errors + problem.prior * z
        there = _Triangle.about(problem, trial)
        sigma = np.sqrt(max(1.0, here.cost / readings))  # a robot that is off by more than noise settles no finer
        fall = abs(here.cost - there.cost)
        small = float(np.linalg.norm(here.factor @ z)) < converged * sigma or fall < FLAT * sigma**2
        if there.cost <= here.cost * (1 + 1e-9):
            errors, here, damping = trial, there, damping / 10 if damping > 1e-6 else 0.0
        else:
            damping = max(10 * damping, 1e-3)
        if small:
            return Solution(errors, here.factor, here.cost, step)
    raise NoSolutionError(
        f"the fit did not come to rest in {STEPS} steps: the start is too far off, or the readings contradict "
        "each other"
    )
