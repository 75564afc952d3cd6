"""Geometry alone, by a least-squares fit of one's own: six small motions of each link, the tool, the gauge's place."""

from dataclasses import dataclass

import numpy as np

from tests.independent_arms.arm import TOOL
from tests.independent_arms.chain import frames, points, rotations
from tests.independent_arms.runs import FIXTURE, JOINTS

PRIOR_LINK = np.array([1e-3] * 3 + [1e-3] * 3)  # m, rad, one sigma: usual of arms that nobody has calibrated
STEPS, NOISE_ROUNDS, STEP, MOST_ROWS = 4, 3, 1e-6, 400


@dataclass(frozen=True)
class Geometry:
    """Link twists (7, 1, 6) and tool point (3,) of an arm whose only errors are those of its geometry."""

    link: np.ndarray
    tool: np.ndarray

    def points(self, arm, q):
        return points(frames(arm, q, np.broadcast_to(self.link, (7, len(q), 6)))[6], self.tool)


def _geometry(x):
    link = np.zeros((7, 1, 6))
    link[1:, 0] = x[:36].reshape(6, 6)
    return Geometry(link, TOOL + x[36:39])


def rigid(source, target):
    """Rotation and shift that bring points ``source`` best onto ``target`` (Kabsch)."""
    ms, mt = source.mean(0), target.mean(0)
    u, _, vt = np.linalg.svd((source - ms).T @ (target - mt))
    sign = np.diag([1, 1, np.sign(np.linalg.det(u @ vt))])
    turn = (u @ sign @ vt).T
    return turn, mt - turn @ ms


def fit_geometry(arm, columns):
    """The likeliest geometry of a run, given as columns; the size of what is left is found with it."""
    every = max(1, len(columns["t_s"]) // MOST_ROWS)  # neighbours of a driven run say the same
    columns = {name: values[::every] for name, values in columns.items()}
    q = np.radians(np.stack([columns[c] for c in JOINTS], 1))
    if "length_mm" in columns:
        model, start, prior = _bar(arm, q, columns["length_mm"] / 1e3)
    else:
        model, start, prior = _tracker(arm, q, np.stack([columns[f"{a}_mm"] for a in "xyz"], 1) / 1e3)
    x, noise = start, 3e-4
    for _ in range(NOISE_ROUNDS):
        for _ in range(STEPS):
            left = model(x)
            slope = np.stack([(model(x + STEP * unit) - left) / STEP for unit in np.eye(len(x))], 1)
            normal = slope.T @ slope / noise**2 + np.diag(prior**-2.0)
            x = x - np.linalg.solve(normal, slope.T @ left / noise**2 + (x - start) / prior**2)
        freedom = np.trace(np.linalg.solve(normal, slope.T @ slope / noise**2))
        noise = max(np.sqrt(np.sum(model(x) ** 2) / max(len(left) - freedom, 1)), 2e-6)
    return _geometry(x)


def _bar(arm, q, length):
    def model(x):
        line = _geometry(x).points(arm, q) - FIXTURE - x[39:42]
        return np.linalg.norm(line, axis=1) + x[42] - length

    prior = np.concatenate([np.tile(PRIOR_LINK, 6), [1e-3] * 3, [5e-3] * 3, [1e-3]])
    return model, np.zeros(43), prior


def _tracker(arm, q, place):
    turn, shift = rigid(place, points(frames(arm, q)[6], TOOL))
    roughly = place @ turn.T + shift

    def model(x):
        moved = roughly @ rotations(x[42:45][None])[0].T + x[39:42]
        return (_geometry(x).points(arm, q) - moved).ravel()

    prior = np.concatenate([np.tile(PRIOR_LINK, 6), [1e-3] * 3, [0.1] * 3, [0.05] * 3])
    return model, np.zeros(45), prior
