"""Regularised non-linear least squares: Levenberg–Marquardt with the priors as further readings.

The prior sigmas in the robot's file say how large an error of each kind usually is. How far *this* robot is off is
estimated from the run as well: every kind (lengths, angles, compliances) has one common factor on its prior sigmas, at
the value that maximises the evidence of the run (MacKay 1992). Where the run says little the factor stays near 1."""

from collections.abc import Iterable, Iterator
from dataclasses import astuple, dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.linalg.lapack import dtrtri

from planner.cell.cell import MeasurementSetup
from planner.common.determinism import even_positions
from planner.common.errors import NoSolutionError
from planner.common.units import Array
from planner.fit.assumptions import (
    CONVERGED_SIGMAS,
    PRIOR_FACTORS,
    ROUGHLY_CONVERGED_SIGMAS,
    SETTLED_CHANGE,
)
from planner.fit.noise import Noise, estimate_noise
from planner.fit.problem import FitProblem, FoldColumns, WhitenedColumns
from planner.fit.wild_rows import row_weights, unseen_weights
from planner.model.model import Model

FROZEN_NUMBERS = 200_000  # of a Jacobian, from which on it stands for those at the next steps too


@dataclass(frozen=True)
class Solution:
    """The minimum that the fit found.

    Attributes:
        errors: values of the parameters, (P,).
        factor: R (P, P), upper triangular, of rows per prior sigma with the prior: RᵀR is the information.
        cost: weighted sum of squares with the prior's.
    """

    errors: Array
    factor: Array
    cost: float

    @cached_property
    def inverse(self) -> Array:
        """Inverse (P, P) of the factor, upper triangular: a square root of the covariance per prior sigma."""
        return np.asarray(dtrtri(self.factor)[0]) if len(self.factor) else self.factor

    def root(self, prior: Array) -> Array:
        """Square root S (P, P) of the covariance, S Sᵀ, in the parameters' units."""
        return prior[:, None] * self.inverse


def solve(
    problem: FitProblem,
    start: Array | None = None,
    converged: float = CONVERGED_SIGMAS,
    fold: np.ndarray | None = None,
) -> Solution:
    """Fit the model's parameters; ``converged`` in standard deviations ends it.

    With the ``fold`` (n,) of its samples a large problem keeps what it was linearised about last by folds.

    Raises:
        NoSolutionError: the fit does not come to rest.
    """
    errors = np.zeros(len(problem.prior)) if start is None else np.array(start)
    return _descend(problem, errors, converged, fold)


@dataclass(frozen=True)
class _Triangle:
    """The problem linearised about some parameters, rows and residuals reduced to P + 1 rows, the prior included.

    ``factor`` (P, P) and ``right`` (P,) give the next step, ``factor``·z = ``right``; ``cost`` is where it stands now.
    Of a large problem its ``columns`` are kept.
    The columns are per prior sigma and the prior is in: the information is never below 1, its root by Cholesky exact
    enough.
    """

    factor: Array
    right: Array
    cost: float
    columns: WhitenedColumns | FoldColumns | None = None

    @classmethod
    def linearize(cls, problem: FitProblem, errors: Array, fold: np.ndarray | None) -> "_Triangle":
        """Linearise about errors (P,) [m, rad]; the cost is infinite where the model cannot follow them."""
        large = _is_large(problem)
        folds = FoldColumns.of(problem, errors, fold) if large and fold is not None else None
        columns = folds or problem.white_columns(errors)
        whole, z = columns.gram, errors / problem.prior
        if not np.all(np.isfinite(whole)):  # a step far beyond what the model can follow
            return cls(np.eye(len(z)), 0 * z, np.inf)
        factor = cholesky(whole[:-1, :-1] + np.eye(len(z)))
        right = solve_triangular(factor, whole[:-1, -1] - z, trans="T")
        return cls(factor, right, float(whole[-1, -1] + z @ z), columns if large else None)

    def triangular_factor(self, problem: FitProblem, errors: Array) -> "_Triangle | None":
        """Return the triangle of the kept columns and the residual at errors (P,); ``None`` if no columns were kept."""
        if self.columns is None:
            return None
        raw = problem.model.residual_in(problem.context, problem.targets, errors)
        white = problem.whitener.white(raw[..., None])[..., 0] * np.sqrt(problem.weight)[:, None]
        z = errors / problem.prior
        right = solve_triangular(self.factor, self.columns.along(white)[:-1] - z, trans="T")
        return replace(self, right=right, cost=float((white**2).sum() + z @ z))

    def keep_folds(self, problem: FitProblem) -> None:
        """Keep the columns of the folds, if there are any, for what predicts each by the others."""
        if isinstance(self.columns, FoldColumns):
            problem.memory.folds = self.columns

    def step(self, damping: float) -> Array:
        """Solve for the step, turned towards steepest descent by ``damping`` (Marquardt's scaling)."""
        if damping == 0.0:
            return np.asarray(solve_triangular(self.factor, self.right))
        brake = np.sqrt(damping) * np.linalg.norm(self.factor, axis=0)
        return np.asarray(
            np.linalg.lstsq(np.vstack([self.factor, np.diag(brake)]), np.append(self.right, 0 * brake))[0]
        )


def _descend(problem: FitProblem, errors: Array, converged: float, fold: np.ndarray | None = None) -> Solution:
    most_steps = 100  # of Gauss and Newton
    here, damping, raised = _Triangle.linearize(problem, errors, fold), 0.0, 2.0
    readings = len(problem) * problem.model.width
    for _ in range(most_steps):
        z = here.step(damping)
        trial = errors + problem.prior * z
        sigma = np.sqrt(max(1.0, here.cost / readings))  # a robot that is off by more than noise settles no finer
        length = float(np.linalg.norm(here.factor @ z))
        # 10.0: a step shorter than a standard deviation is at least so many times longer than the next (seen: 100)
        if damping == 0.0 and length < 10.0 * converged * sigma:  # the next step would be shorter than is asked
            here.keep_folds(problem)
            return Solution(trial, here.factor, here.cost - length**2)
        there = _next_triangle(problem, here, trial, length, damping, fold)
        # 3e-5: noise variances: so small a fall of the sum of squares tells nothing any more
        small = length < converged * sigma or abs(here.cost - there.cost) < 3e-5 * sigma**2
        if there.cost <= here.cost * (1 + 1e-9):
            damping, raised = _lower_damping(damping, here, z, there.cost), 2.0
            errors, here = trial, there
        else:
            damping, raised = max(raised * damping, 1e-3 if damping == 0.0 else 0.0), 2 * raised
        if small:
            here.keep_folds(problem)
            return Solution(errors, here.factor, here.cost)
    raise NoSolutionError(
        f"the fit did not come to rest in {most_steps} steps: the start is too far off, or the readings contradict "
        "each other (names of fixtures, points or rows that were exchanged do that)"
    )


def _lower_damping(damping: float, here: _Triangle, z: Array, cost: float) -> float:
    """Return the damping after a step that led down, as much lower as the step kept what it promised.

    Source: H. B. Nielsen, Damping parameter in Marquardt's method, IMM-REP-1999-05, equation 2.21.
    """
    promised = float(here.right @ here.right - np.sum((here.right - here.factor @ z) ** 2))
    ratio = (here.cost - cost) / max(promised, 1e-300)
    damping *= max(0.1, 1.0 - (2.0 * ratio - 1.0) ** 3)
    return damping if damping > 1e-7 else 0.0


def _is_large(problem: FitProblem) -> bool:
    """Tell whether the Jacobian is so large that what still holds at the next steps and rounds is not formed anew."""
    return len(problem) * problem.model.width * len(problem.prior) > FROZEN_NUMBERS


def _next_triangle(
    problem: FitProblem, here: _Triangle, trial: Array, length: float, damping: float, fold: np.ndarray | None
) -> _Triangle:
    """Linearise about a trial (P,) after a step of a length; the columns stay where the next step is far shorter.

    What they have changed by, times the residual, then stays in the minimum: a hundredth of a standard deviation.
    """
    frozen = here.triangular_factor(problem, trial) if damping == 0.0 else None
    # 50.0: times longer than the next is a step at least where a Jacobian stands for later ones
    if frozen is not None and 50.0 * float(np.linalg.norm(frozen.right)) < length:
        return frozen
    return _Triangle.linearize(problem, trial, fold)


@dataclass(frozen=True)
class Fit:
    """A model fitted to a problem.

    Attributes:
        problem: with the noise and prior sigmas as they were found.
        solution: parameters and information.
        effective: number of parameters that the readings, not the prior, decide.
        leverage: of the readings that noise and factors were settled by, (n, r), 0 … 1, where it was looked at.
    """

    problem: FitProblem
    solution: Solution
    effective: float
    leverage: Array | None = None

    def __repr__(self) -> str:
        """Say how much was fitted to how much."""
        return f"Fit({self.model!r}, samples={len(self.problem)})"

    @property
    def model(self) -> Model:
        """The model that was fitted."""
        return self.problem.model

    def count_in_full(self) -> "Fit":
        """Return the fit with rows that all count in full, its values as they are."""
        if np.all(self.problem.weight == 1.0):
            return self
        return replace(self, problem=replace(self.problem, weight=np.ones(len(self.problem))))

    @property
    def setup(self) -> MeasurementSetup:
        """The set-up of the model."""
        return self.model.setup

    @property
    def errors(self) -> Array:
        """Values of the parameters, (P,)."""
        return self.solution.errors

    @property
    def values(self) -> dict[str, float]:
        """The same by the parameters' names."""
        return dict(zip(self.model.names, self.errors.tolist(), strict=True))

    def at(self, names: Iterable[str]) -> Array:
        """Return the values of parameters ``names``, 0 for those that were not fitted."""
        values = self.values
        return np.array([values.get(name, 0.0) for name in names])


def fit(
    problem: FitProblem,
    start: Array | None = None,
    factors: Array | None = None,
    leverage: Array | None = None,
    fold: np.ndarray | None = None,
) -> Fit:
    """Fit the model of ``problem``, its noise, how much each row counts, and the factors on its prior sigmas.

    ``start`` are the values and ``factors`` the factors (P,) that the rounds begin with; ``leverage`` (n, r) is that of
    a fit of nearly the same columns, which stands for this one's where there are many readings; ``fold`` (n,) those of
    its samples, as :func:`solve` takes them.

    Raises:
        NoSolutionError: the fit does not come to rest.
    """
    look = subset_size(problem.model, 3_000)  # samples of a long run settle noise and factors
    long = len(problem) > 2 * look
    few = problem.take(even_positions(len(problem), look)) if long else problem
    prior, errors = problem.model.prior, start
    if factors is not None:
        few = few.with_model(few.model.with_prior(prior * factors))
    near = leverage is not None and leverage.shape == (len(few), few.model.width) and leverage.any()
    louder = 0.0 if near else np.inf  # relative change of the noise
    for _ in range(12):  # rounds at most of settling noise and factors
        solution = solve(few, errors, ROUGHLY_CONVERGED_SIGMAS)
        errors = solution.errors
        shrinkage = _shrinkage(solution)
        # 0.05: relative change of the noise up to which leverages of a large problem hold
        if leverage is None or louder > 0.05 or not _is_large(few):
            leverage = _leverage(few, solution)
        else:  # their sum, the number of parameters that the readings decide, is known without a look at each
            leverage = np.minimum(leverage * float((1 - shrinkage).sum()) / float(leverage.sum()), 1.0)
        weight = row_weights(few.white_residual(errors), leverage, few.weight)
        noise = estimate_noise(few.whitener, few.residual(errors), leverage, weight)
        model = few.model.with_prior(prior * prior_factors(few.model, prior, errors, shrinkage))
        louder = _change(noise, few.whitener.noise)
        change = max(louder, float(np.max(np.abs(model.prior / few.prior - 1), initial=0.0)))
        shifted = float(np.abs(weight - few.weight).max(initial=0.0))
        few = replace(few.with_noise(noise).with_model(model), weight=weight)
        # 0.05: change of how much a row counts that ends the rounds
        if change < SETTLED_CHANGE and shifted < 0.05:
            break
    whole = problem.with_noise(few.whitener.noise).with_model(few.model) if long else few
    if long and errors is not None:
        whole = replace(whole, weight=unseen_weights(whole.white_residual(errors)))
    solution = solve(whole, errors, fold=fold)
    return Fit(whole, solution, float((1 - _shrinkage(solution)).sum()), leverage)


def subset_size(model: Model, samples: int) -> int:
    """Return the number of samples, fewer if a reading has more than three numbers."""
    return samples * 3 // max(3, model.width)


def _leverage(problem: FitProblem, solution: Solution) -> Array:
    """Return the leverage of each reading, (n, r), 0 … 1."""
    root = solution.inverse
    if not len(root):
        return np.zeros((len(problem), problem.model.width))
    return problem.white_columns(solution.errors).factored.square_sums(root)


def _shrinkage(solution: Solution) -> Array:
    """Return the shrinkage of each parameter towards its prior, σ²(posterior) / σ²(prior), (P,), 0 … 1."""
    return np.asarray((solution.inverse**2).sum(axis=1))


def prior_groups(model: Model) -> Iterator[list[int]]:
    """Yield the positions of parameters that share a factor: same group and unit.

    Parameters of the gauge have none, nor have those whose sizes a person stated.
    """
    stated = dict(model.setup.robot.priors.sizes)
    groups = dict[tuple[str, str], list[int]]()
    for j, p in enumerate(model.parameters):
        if p.group != "gauge" and p.name not in stated:
            groups.setdefault((p.group, p.unit), []).append(j)
    yield from groups.values()


def prior_factors(model: Model, prior: Array, errors: Array, shrinkage: Array) -> Array:
    """Return the factor on each prior sigma that makes the run likeliest: Σ z² over the number of decided parameters.

    To both one more parameter is added that fits the prior (z = 1), so that the factor stays near 1 where the run
    decides little.
    """
    out = np.ones(len(prior))
    for which in prior_groups(model):
        decided = float((1 - shrinkage[which]).sum())
        square = (float(((errors[which] / prior[which]) ** 2).sum()) + 1.0) / (decided + 1.0)
        out[which] = np.clip(np.sqrt(square), *PRIOR_FACTORS)
    return out


def _change(a: Noise, b: Noise) -> float:
    return max(abs(float(x) / float(y) - 1) for x, y in zip(astuple(a), astuple(b), strict=True))
