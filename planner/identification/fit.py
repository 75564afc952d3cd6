"""The fit: parameters, the size of the noise and the size of the errors to expect, all from the same run.

The prior sizes in the robot's file say how large an error of each kind usually is. How far *this* robot is off is
learnt from the run as well: every kind (lengths, angles, compliances) has one common factor on its prior sizes, at
the value that makes the run likeliest (MacKay 1992, the evidence). Where the run says little it stays near 1.
"""

from collections.abc import Iterator
from dataclasses import astuple, dataclass, replace

import numpy as np

from planner.identification.noise import Noise, estimated
from planner.identification.problem import Problem
from planner.identification.solve import ROUGH, Solution, solve
from planner.model import Model, Parameter
from planner.repeatable import evenly
from planner.units import Array

ROUNDS = 12
SETTLED = 0.02  # relative change of noise and factors that ends the rounds
FACTORS = (0.1, 50.0)  # an error of a kind is never believed to be smaller or larger than this times its prior size
LOOK = 3_000  # samples of a long run that settle noise and factors


@dataclass(frozen=True)
class Fit:
    """A model fitted to a problem.

    Attributes:
        problem: with the noise and prior sizes as they were found.
        solution: parameters and information.
        effective: number of parameters that the readings, not the prior, decide.
        outliers: samples whose residual the noise does not explain, (m,) int.
    """

    problem: Problem
    solution: Solution
    effective: float
    outliers: np.ndarray

    @property
    def model(self) -> Model:
        """The model that was fitted."""
        return self.problem.model

    @property
    def errors(self) -> Array:
        """Values of the parameters, (P,)."""
        return self.solution.errors


def fit(
    problem: Problem,
    robust: bool = False,
    start: Array | None = None,
    settle: bool = True,
    factors: Array | None = None,
) -> Fit:
    """Fit the model of ``problem``, its noise and the factors on its prior sizes (not with ``settle`` false).

    ``start`` are the values and ``factors`` the factors (P,) that the rounds begin with.

    Raises:
        NoSolutionError: the fit does not come to rest.
    """
    look = fewer(problem.model, LOOK)
    long = len(problem) > 2 * look
    few = problem.take(evenly(len(problem), look)) if long else problem
    prior, errors = problem.model.prior, start
    if factors is not None:
        few = few.with_model(_with_prior(few.model, prior * factors))
    for _ in range(ROUNDS if settle else 0):
        solution = solve(few, errors, ROUGH)
        errors = solution.errors
        weight = _weights(few, errors) if robust else few.weight
        shrunk = _undecided(solution)
        noise = estimated(few.whitener, few.residual(errors) * np.sqrt(weight)[:, None], _leverage(few, solution))
        model = _with_prior(few.model, prior * _factors(few.model, prior, errors, shrunk))
        change = max(
            _change(noise, few.whitener.noise), float(np.max(np.abs(model.prior / few.prior - 1), initial=0.0))
        )
        few = replace(few.with_noise(noise).with_model(model), weight=weight)
        if change < SETTLED:
            break
    whole = problem.with_noise(few.whitener.noise).with_model(few.model) if long else few
    if long and robust and errors is not None:
        whole = replace(whole, weight=_weights(whole, errors))
    solution = solve(whole, errors)
    return Fit(whole, solution, float((1 - _undecided(solution)).sum()), _outliers(whole, solution))


def fewer(model: Model, samples: int) -> int:
    """So many samples, or fewer where each of them brings more than three numbers."""
    return samples * 3 // max(3, model.width)


def _leverage(problem: Problem, solution: Solution) -> Array:
    """How much each reading holds its own prediction, (n, r), 0 … 1."""
    root = np.linalg.inv(solution.factor)

    def one(part: slice) -> Array:
        return np.asarray(((problem.piece(part, solution.errors).rows @ root) ** 2).sum(axis=2))

    return np.concatenate(list(problem.over_pieces(one)))


def _undecided(solution: Solution) -> Array:
    """Share of each parameter's prior variance that is left after the readings, (P,), 0 … 1."""
    root = np.linalg.inv(solution.factor)
    return np.asarray((root**2).sum(axis=1))


def kinds(model: Model) -> Iterator[list[int]]:
    """Positions of the parameters that share a factor: same group, same unit; what places the gauge has none."""
    labels = [(p.group, p.unit) for p in model.parameters]
    for label in dict.fromkeys(labels):
        if label[0] != "gauge":
            yield [j for j, other in enumerate(labels) if other == label]


def _factors(model: Model, prior: Array, errors: Array, shrunk: Array) -> Array:
    """Factor of each prior size at which the run is likeliest: Σ z² over the number of well-decided parameters.

    One decided parameter's worth of the prior itself (factor 1) is added, so that few or faint ones keep it.
    """
    out = np.ones(len(prior))
    for which in kinds(model):
        decided = float((1 - shrunk[which]).sum())
        square = (float(((errors[which] / prior[which]) ** 2).sum()) + 1.0) / (decided + 1.0)
        out[which] = np.clip(np.sqrt(square), *FACTORS)
    return out


def _with_prior(model: Model, prior: Array) -> Model:
    parameters = [replace(p, prior=float(s)) for p, s in zip(model.parameters, prior, strict=True)]
    return replace(model, parameters=tuple[Parameter, ...](parameters))


def _change(a: Noise, b: Noise) -> float:
    return max(abs(float(x) / float(y) - 1) for x, y in zip(astuple(a), astuple(b), strict=True))


HUBER = 1.5  # in standard deviations: 95 % as sharp as least squares where the noise is normal
FAR = 4.5  # standard deviations, of one reading in about 150 000


def _size(problem: Problem, errors: Array) -> Array:
    """Residual of each sample in standard deviations of the middle half of them, (n,)."""
    white = problem.white_residual(errors)
    size = np.sqrt((white**2).mean(axis=1))
    return np.asarray(size / max(float(np.median(size)) / MEDIAN[white.shape[1]], 1e-300))


MEDIAN = {1: 0.6745, 3: 0.8880, 6: 0.9441}  # of the root mean square of r standard normal numbers


def _weights(problem: Problem, errors: Array) -> Array:
    """Huber's weights, (n,)."""
    return np.minimum(1.0, HUBER / np.maximum(_size(problem, errors), 1e-12))


def _outliers(problem: Problem, solution: Solution) -> np.ndarray:
    return np.flatnonzero(_size(problem, solution.errors) > FAR)
