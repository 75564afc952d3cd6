"""Robots drawn as the plan expects them, and what readings leave of their errors."""

import numpy as np

from planner.common.units import Array
from planner.effects.usual_errors import TYPICAL_FACTOR, usual_factors


def draw_remaining_errors(white: Array, usual: np.ndarray, doubt: float) -> Array:
    """Return what readings ``white`` (n, P) leave of the errors of each robot drawn, (P, robots).

    Args:
        white: rows in standard deviations per error of unit size; without rows these are robots before the session.
        usual: family (P,) int of the errors of which most robots have little and few much; −1 of all others.
        doubt: as of :class:`planner.design.expected_errors.ExpectedErrors`.
    """
    robots = 1000  # drawn: a 95 % quantile over them is known to 3 per cent
    rng = np.random.default_rng(12)  # a fixed seed: the same errors give the same limits
    rare = usual >= 0
    rest, own = white[:, ~rare], white[:, rare]
    root = np.linalg.inv(np.linalg.cholesky(rest.T @ rest + np.eye(rest.shape[1])))
    taken_up = root.T @ (root @ (rest.T @ own))  # by the others, of each of these errors
    factors, probability = usual_factors()
    # each family's sizes as often as they are likely, so that the limit hangs less on the draws
    even = np.tile((np.arange(robots) + 0.5) / robots, (usual.max(initial=-1) + 1, 1))
    drawn = factors[np.searchsorted(np.cumsum(probability)[:-1], rng.permuted(even, axis=1))]
    sizes = drawn[usual[rare]].T / TYPICAL_FACTOR
    seen = sizes[:, :, None] * (own.T @ (own - rest @ taken_up)) * sizes[:, None]
    normal = rng.standard_normal((robots, len(sizes.T), 1))
    left = np.linalg.solve(np.linalg.cholesky(seen + np.eye(len(sizes.T))).transpose(0, 2, 1), normal)[..., 0]
    out = np.empty((len(usual), robots))
    out[rare] = (sizes * left).T
    out[~rare] = root.T @ rng.standard_normal((len(root), robots)) - taken_up @ out[rare]
    return out * (np.exp(doubt * rng.standard_normal(robots)) if len(white) else 1.0)
