"""A primal-dual interior-point method for the relaxations: a dozen or two dense Newton systems.

Predictor and corrector of Mehrotra 1992 with the direction of Helmberg, Rendl, Vanderbei, Wolkowicz 1996 (HKM). The
primal stays feasible throughout; the dual gets there by itself. Nothing here is trusted: :mod:`.certificate` checks.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.linalg.lapack import dtrtrs

from planner.common.progress import UNLIMITED, LastStart, TimeLimit
from planner.common.units import Array
from planner.design.selection.relaxation import RelaxationProblem

BACKED_SHARE = 0.95  # of the way to the boundary that a step may go: all of it would leave the inside


@dataclass(frozen=True)
class _PrimalDual:
    """Unknowns z, matrix duals X, slack duals x."""

    z: Array
    X: list[Array]
    x: Array


def solve_interior_point(
    problem: RelaxationProblem, z: Array, tolerance: float, limit: TimeLimit = UNLIMITED
) -> tuple[Array, list[Array]]:
    """Return (z, X) with a relative duality gap of about ``tolerance``, from a strictly feasible z."""
    slack = problem.slacks(z)
    mu = max(abs(problem.objective(z)), 1.0) / (len(slack) + 1)
    point = _PrimalDual(z, [mu * _inverse(S) for S in problem.matrices(z)], mu / slack)
    for _ in range(60):  # Newton steps at most
        if limit.must_stop(LastStart.CHOICE, "the bound of the certificate holds, but is not as tight as it can be"):
            break  # any duals prove a bound
        gap, degree = _duality_gap(problem, point)
        scale = 1.0 if problem.logarithmic else abs(problem.objective(point.z))
        hessian, slope = _newton_system(problem, point)
        residual = slope - problem.pull(point.X) - problem.slack_pull(point.x, len(slope))
        if gap < tolerance * scale and np.max(np.abs(residual * point.z)) < tolerance * scale:
            break
        new = _take_step(problem, point, hessian, slope, gap / degree)
        if new is None:
            break
        point = new
    return point.z, point.X


def _duality_gap(problem: RelaxationProblem, point: _PrimalDual) -> tuple[float, int]:
    matrices, slack = problem.matrices(point.z), problem.slacks(point.z)
    total = float(slack @ point.x) + sum(float(np.sum(S * X)) for S, X in zip(matrices, point.X, strict=True))
    return total, len(slack) + sum(len(S) for S in matrices)


def _newton_system(problem: RelaxationProblem, point: _PrimalDual) -> tuple[Array, Array]:
    """The normal matrix of the Newton step and the slope of the objective."""
    inverses = [_inverse(S) for S in problem.matrices(point.z)]
    hessian = problem.coupling(inverses, point.X)
    problem.add_slack_coupling(point.x / problem.slacks(point.z), hessian)
    slope = problem.slope(point.z, hessian)
    return hessian, slope


def _inverse(matrix: Array) -> Array:
    inverse = np.linalg.inv(matrix)
    return np.asarray((inverse + inverse.T) / 2)


def _take_step(
    problem: RelaxationProblem, point: _PrimalDual, hessian: Array, slope: Array, mu: float
) -> _PrimalDual | None:
    """One predictor-corrector step, or None when rounding has the last word."""
    scale = 1.0 / np.sqrt(np.diag(hessian))
    system = hessian * scale * scale[:, None]
    system[np.diag_indices_from(system)] += 1e-13
    try:
        factor = cho_factor(system, lower=True, overwrite_a=True)
        matrices, slack = problem.matrices(point.z), problem.slacks(point.z)
        inverses = [_inverse(S) for S in matrices]
        primal_roots, dual_roots = ([_cholesky(m) for m in which] for which in (matrices, point.X))
        none = [np.zeros_like(S) for S in inverses]
        args = problem, point, (factor, scale), slope, inverses, slack
        dz, dX, dx = _newton_direction(*args, 0.0, none, np.zeros_like(slack))
        dS, ds = problem.changes(dz), problem.slacks(dz)
        ahead = _PrimalDual(
            point.z + _step_limit(primal_roots, dS, slack, ds) * dz,
            *_advance_duals(point, dX, dx, _step_limit(dual_roots, dX, point.x, dx)),
        )
        sigma = min(1.0, max(_duality_gap(problem, ahead)[0] / _duality_gap(problem, point)[0], 0.0)) ** 3
        sigma = max(sigma, 1e-6)
        second = [_symmetrise(a @ b @ S) for a, b, S in zip(dX, dS, inverses, strict=True)]
        dz, dX, dx = _newton_direction(*args, sigma * mu, second, dx * ds / slack)
        primal = BACKED_SHARE * _step_limit(primal_roots, problem.changes(dz), slack, problem.slacks(dz))
        dual = BACKED_SHARE * _step_limit(dual_roots, dX, point.x, dx)
    except np.linalg.LinAlgError:
        return None
    primal, dual = min(1.0, primal), min(1.0, dual)
    if problem.curved:  # a curved objective ties the two together
        primal = dual = min(primal, dual)
    if primal < 1e-8 and dual < 1e-8:
        return None
    return _PrimalDual(point.z + primal * dz, *_advance_duals(point, dX, dx, dual))


def _newton_direction(
    problem: RelaxationProblem,
    point: _PrimalDual,
    system: tuple[tuple[Array, bool], Array],
    slope: Array,
    inverses: list[Array],
    slack: Array,
    target: float,
    second: list[Array],
    second_slack: Array,
) -> tuple[Array, list[Array], Array]:
    """Newton direction towards complementarity ``target``, with second-order terms."""
    (factor, scale), wanted = system, target / slack - second_slack
    aims = [target * S - c for S, c in zip(inverses, second, strict=True)]
    right = problem.slack_pull(wanted, len(slope)) - slope + problem.pull(aims)
    dz = scale * cho_solve(factor, scale * right)
    changes = problem.changes(dz)
    dX = [aim - X - _symmetrise(X @ dS @ S) for aim, X, dS, S in zip(aims, point.X, changes, inverses, strict=True)]
    dx = wanted - point.x - point.x / slack * problem.slacks(dz)
    return np.asarray(dz), dX, np.asarray(dx)


def _cholesky(matrix: Array) -> Array:
    return np.asarray(np.linalg.cholesky(matrix), dtype=float)


def _symmetrise(matrix: Array) -> Array:
    return np.asarray((matrix + matrix.T) / 2)


def _advance_duals(point: _PrimalDual, dX: list[Array], dx: Array, length: float) -> tuple[list[Array], Array]:
    return [X + length * d for X, d in zip(point.X, dX, strict=True)], point.x + length * dx


def _step_limit(roots: list[Array], changes: list[Array], slack: Array, slack_change: Array) -> float:
    """Largest step before matrices, given by their Cholesky factors, or slacks leave their cone, at most 1 / 0.95."""
    rooms = [_matrix_step_limit(root, change) for root, change in zip(roots, changes, strict=True)]
    return min(1.0 / BACKED_SHARE, _vector_step_limit(slack, slack_change), *rooms)


def _vector_step_limit(value: Array, change: Array) -> float:
    shrinking = change < 0
    return float(np.min(-value[shrinking] / change[shrinking])) if shrinking.any() else np.inf


def _matrix_step_limit(root: Array, change: Array) -> float:
    """Largest a with L L' + a change positive semidefinite, L = ``root``."""
    half = dtrtrs(root, change, lower=1)[0]
    least = float(np.linalg.eigvalsh(dtrtrs(root, half.T, lower=1)[0])[0])
    return -1.0 / least if least < 0 else np.inf
