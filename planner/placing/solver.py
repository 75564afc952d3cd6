"""Robust Levenberg–Marquardt over many starts at once, and which directions the data leave open."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from planner.placing.inputs import IntArray
from planner.units import Array

# scale of a block's norm of d unit normals: its median (square root of the χ² median)
_MEDIAN = {1: 0.6745, 3: 1.5382, 6: 2.3126}
_SMALLEST = 4e-3  # [m] nominal robots are wrong by up to five times this: no such residual is called an outlier
_HUBER, _TUKEY = 1.5, 4.7


class Problem(Protocol):
    """Residuals of n rows, each a block of d numbers [m], over k states at once."""

    def evaluate(self, state: Array) -> tuple[Array, Array]:
        """Return residuals (k, n, d) [m] and their derivatives (k, n, d, P) at states (k, D)."""

    def moved(self, state: Array, step: Array) -> Array:
        """Return the states (k, D) moved by steps (k, P)."""


@dataclass(frozen=True)
class Refined:
    """States (k, D), block norms of their residuals (k, n) [m], and derivatives (k, n, d, P)."""

    state: Array
    error: Array
    jacobian: Array

    def take(self, which: Array) -> "Refined":
        """Return only the states at ``which``."""
        return Refined(self.state[which], self.error[which], self.jacobian[which])


def scale_of(error: Array, d: int) -> Array:
    """Return the standard deviation of one number from the medians of block norms (..., n), (..., 1) [m]."""
    return np.asarray(np.maximum(np.median(error, axis=-1, keepdims=True) / _MEDIAN[d], _SMALLEST))


def cut_of(d: int) -> float:
    """Return the multiple of the scale from which a block of d numbers is an outlier."""
    return 3.5 + 1.2 * float(np.sqrt(d))


def refine(problem: Problem, state: Array, schedule: tuple[tuple[int, str], ...], floor: float = 0.0) -> Refined:
    """Refine k states by Levenberg–Marquardt with weights that follow the residual.

    Args:
        problem: gives residuals and derivatives.
        state: starts, (k, D).
        schedule: rounds (iterations, weights): ``huber`` converges from afar, ``tukey`` forgets outliers. The scale
            of the weights is the residual's median, found anew for each round.
        floor: directions that move the readings by less than this per unit (rms) are held where they are.

    Source: Marquardt, SIAM 11 (1963); Holland and Welsch, Comm. Stat. A6 (1977), for the weights.
    """
    r, J = problem.evaluate(state)
    d = r.shape[2]
    for iterations, kind in schedule:
        scale = scale_of(np.linalg.norm(r, axis=2), d)
        damping = np.full(len(state), 1e-3)
        for _ in range(iterations):
            weight, cost = _weights(np.linalg.norm(r, axis=2) / scale, kind, d)
            trial = problem.moved(state, _step(r, J, weight, damping, floor))
            r_new, J_new = problem.evaluate(trial)
            _, cost_new = _weights(np.linalg.norm(r_new, axis=2) / scale, kind, d)
            better = cost_new <= cost
            state = np.where(better[:, None], trial, state)
            r = np.where(better[:, None, None], r_new, r)
            J = np.where(better[:, None, None, None], J_new, J)
            damping = np.clip(np.where(better, damping * 0.1, damping * 10.0), 1e-12, 1e6)
            if np.all(np.abs(cost_new - cost) <= 1e-13 * cost):
                break
    return Refined(state, np.linalg.norm(r, axis=2), J)


def best_first(found: Refined, d: int) -> IntArray:
    """Return the order of the states, best first: squared residuals, each cut off at the smallest scale's limit."""
    limit = cut_of(d) * scale_of(found.error, d).min()
    cost = (np.minimum(found.error, limit) ** 2).sum(axis=1)
    # beyond the limit all are alike: the median decides there; equal costs keep the order of the starts
    return np.lexsort((np.median(found.error, axis=1), np.round(cost / limit**2, 9)))


def open_directions(jacobian: Array, limit: float) -> Array:
    """Return the directions (m, P) that move no reading by more than ``limit`` per unit, rms; jacobian (n, d, P)."""
    flat = jacobian.reshape(-1, jacobian.shape[-1])
    values, vectors = np.linalg.eigh(flat.T @ flat / max(1, len(jacobian)))
    return np.asarray(vectors[:, values < limit**2].T)


def _weights(u: Array, kind: str, d: int) -> tuple[Array, Array]:
    """Return weights (k, n) and costs (k,) of scaled block norms u (k, n)."""
    if kind == "huber":
        c = _HUBER * np.sqrt(d)
        big = u > c
        safe = np.where(big, u, 1.0)
        return np.where(big, c / safe, 1.0), np.where(big, 2 * c * u - c * c, u * u).sum(axis=1)
    c = cut_of(d)
    inside = np.clip(1.0 - (u / c) ** 2, 0.0, None)
    return inside**2, (c * c / 3.0 * (1.0 - inside**3)).sum(axis=1)


def _step(r: Array, J: Array, weight: Array, damping: Array, floor: float) -> Array:
    """Return the damped step (k, P) within the directions that the data see."""
    k, n, d, P = J.shape
    flat = J.reshape(k, n * d, P)
    weighted = (J * weight[:, :, None, None]).reshape(k, n * d, P).transpose(0, 2, 1)
    values, V = np.linalg.eigh(weighted @ flat)
    gradient = (weighted @ r.reshape(k, n * d, 1))[:, :, 0]
    largest = np.maximum(values[:, -1:], 1e-300)
    seen = values > np.maximum(floor**2 * n, 1e-14 * largest)
    along = np.einsum("kpi,kp->ki", V, gradient) / (np.maximum(values, 0.0) + damping[:, None] * largest)
    return np.asarray(-np.einsum("kpi,ki->kp", V, np.where(seen, along, 0.0)))
