"""The last steps of a fit under load: what a parameter changes of the torques counts, and turns are weighed as such.

Held torques make a fit quick and its rows those of every other one. But a fixture that stands a millimetre higher turns
a bar of 130 mm by half a degree and all of its moments with it, so that how well the compliances are known depends on
how well the fixtures are: here the rows are whole. And the readings of a turn share their noise: each sense of a circle
is one block, with the noise of its averages and, common to all loads, the error that a pose has without load.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, solve_triangular

from planner.identification.problem import Problem
from planner.loaded.balance import with_torque
from planner.model import Model
from planner.rig import Targets
from planner.run import Run, Samples
from planner.units import Array, frozen

STEPS = 12
STILL = 1e-3  # standard deviations: a step that changes nothing
NUDGE = 0.1  # of the prior size, for the derivative of the torques


@dataclass(frozen=True)
class Refined:
    """Errors (P,), their covariance (P, P), and the residuals reading − prediction (n,) [m]."""

    errors: Array
    covariance: Array
    residual: Array


def refined(problem: Problem, run: Run, errors: Array, turns: Sequence[Array]) -> Refined:
    """Go on from ``errors`` (P,) until nothing changes, the torques being those in balance (Gauss and Newton).

    Args:
        problem: with the noise and prior sizes as they were found, its compliances by held torques.
        run: of the problem, the rows of ``turns`` last.
        errors: where to begin.
        turns: covariance of the averages over A angles for the K loads of each block, (K, A, A) [m²], in the order of
            the run.
    """
    model, prior, declared = problem.model, problem.prior, problem.whitener.covariance(slice(None))[:, 0, 0]
    first = len(run) - sum(len(c) * c.shape[1] for c in turns)
    size, inverse = 1.0, np.diag(prior**-2.0)
    turned = torque_rows(model, run.samples, errors, prior)  # once: they change by parts of themselves
    for _ in range(STEPS):
        about = model.linear(with_torque(run.samples, model, errors), problem.targets, errors)
        rows, residual = about.rows[:, 0] + turned, about.residual[:, 0]
        columns = np.column_stack([rows, residual])
        white = np.concatenate(list(_whitened(columns, size * declared, first, turns)))
        inverse = white[:, :-1].T @ white[:, :-1] + np.diag(prior**-2.0)
        covariance = _inverse(inverse, prior)
        step = covariance @ (white[:, :-1].T @ white[:, -1] - errors / prior**2)
        errors = errors + step
        left = white[:first, -1] - white[:first, :-1] @ step
        spare = first - float(np.einsum("ni,ij,nj->", white[:first, :-1], covariance, white[:first, :-1]))
        before, size = size, size * float((left**2).sum()) / max(1.0, spare)
        still = np.abs(step / np.sqrt(np.diag(covariance))).max() < STILL
        if still and abs(size / before - 1.0) < STILL:
            break
    left = model.residual(with_torque(run.samples, model, errors), problem.targets, errors)[:, 0]
    return Refined(frozen(errors), frozen(_inverse(inverse, prior)), frozen(left))


def _whitened(columns: Array, variance: Array, first: int, turns: Sequence[Array]) -> Iterator[Array]:
    """Columns (n, C) in standard deviations: rows without load each by itself, then the blocks of turns."""
    yield columns[:first] / np.sqrt(variance[:first, None])
    for noise in turns:
        part = slice(first, first + len(noise) * noise.shape[1])
        yield whitened_turns(columns[part], noise, variance[part])
        first = part.stop


def whitened_turns(columns: Array, noise: Array, pose: Array) -> Array:
    """Return columns (K·A, C) of the K loads of a circle in one sense, in independent standard deviations.

    Args:
        columns: of the rows, load by load.
        noise: covariance of the averages over the A angles, for each load (K, A, A) [m²].
        pose: variance of the error that a pose has with any load, (K·A,) [m²]; it is common to the loads.
    """
    K, A = noise.shape[:2]
    common = np.diag(pose.reshape(K, A).mean(axis=0))
    block = np.kron(np.ones((K, K)), common) + block_diag(*noise)
    return np.asarray(solve_triangular(np.linalg.cholesky(block), columns, lower=True))


def torque_rows(model: Model, samples: Samples, errors: Array, prior: Array) -> Array:
    """Return what each parameter changes of the readings by way of the torques, (n, P), about ``errors``.

    The model's compliances are by held torques; ``prior`` (P,) are the sizes by which the torques are tried.
    """
    nothing = Targets(length=np.zeros(len(samples)))

    def read(torques_by: Array) -> Array:
        return np.asarray(-model.residual(with_torque(samples, model, torques_by), nothing, errors)[:, 0])

    out, here = np.empty((len(samples), len(prior))), read(errors)
    for k, size in enumerate(NUDGE * prior):
        moved = errors.copy()
        moved[k] += size
        out[:, k] = (read(moved) - here) / size
    return out


def _inverse(information: Array, prior: Array) -> Array:
    scale = np.outer(prior, prior)
    return np.asarray(np.linalg.inv(information * scale) * scale)
