"""Residuals of a gauge with a frame of its own (tracker, socket plate), with or without the probe's orientation."""

from dataclasses import dataclass, replace

import numpy as np

from planner.placing.inputs import Stand
from planner.placing.rotations import exp3, log3, skew
from planner.units import Array


@dataclass(frozen=True)
class Frames:
    """k sets of frames: R_BG (k, S, 3, 3), p_BG (k, S, 3), p_FM (k, T, 3), R_FM (k, T, 3, 3)."""

    R_BG: Array
    p_BG: Array
    p_FM: Array
    R_FM: Array

    def packed(self) -> Array:
        """Return the states (k, D)."""
        k = len(self.R_BG)
        return np.concatenate([v.reshape(k, -1) for v in (self.R_BG, self.p_BG, self.p_FM, self.R_FM)], axis=1)


def unpacked(state: Array, s: Stand) -> Frames:
    """Return the frames of states (k, D)."""
    k, S, T = len(state), s.n_places, s.n_points
    R_BG, p_BG, p_FM, R_FM = np.split(state, np.cumsum([9 * S, 3 * S, 3 * T]), axis=1)
    return Frames(R_BG.reshape(k, S, 3, 3), p_BG.reshape(k, S, 3), p_FM.reshape(k, T, 3), R_FM.reshape(k, T, 3, 3))


@dataclass(frozen=True)
class FrameProblem:
    """R_BF p_FM + p_BF = R_BG p_GM + p_BG, and R_BF R_FM = R_BG R_GM where the probe gives its orientation.

    A step is (turns of R_BG in the base's axes (3S), p_BG (3S), p_FM (3T), turns of R_FM in the flange's axes (3T)).

    Attributes:
        stand: flange poses.
        p_GM: readings, (n, 3) [m]; ``R_GM`` (n, 3, 3) or ``None``.
        free: which columns of the step move, bool; the last 3T are there only with orientation.
        per_radian: what a radian counts [m].
    """

    stand: Stand
    p_GM: Array
    R_GM: Array | None
    free: np.ndarray
    per_radian: float = 1.0

    def take(self, which: np.ndarray) -> "FrameProblem":
        """Return the problem of only the rows ``which``."""
        R_GM = None if self.R_GM is None else self.R_GM[which]
        return replace(self, stand=self.stand.take(which), p_GM=self.p_GM[which], R_GM=R_GM)

    def evaluate(self, state: Array) -> tuple[Array, Array]:
        """Return residuals (k, n, 3 or 6) [m] and derivatives."""
        s, f, k = self.stand, unpacked(state, self.stand), len(state)
        S, T, n = s.n_places, s.n_points, len(s)
        A = f.R_BG[:, s.place]
        reading = np.matmul(A, self.p_GM[..., None])[..., 0]
        r = s.carried(f.p_FM) - reading - f.p_BG[:, s.place]
        d = 3 if self.R_GM is None else 6
        J = np.zeros((k, n, d, 6 * S + (3 if d == 3 else 6) * T))
        row, axis = np.arange(n)[:, None, None], np.arange(3)[None, :, None]
        of_place, of_point = 3 * s.place[:, None, None] + np.arange(3), 3 * s.point[:, None, None] + np.arange(3)
        J[:, row, axis, of_place] = skew(reading)
        J[:, row, axis, 3 * S + of_place] = -np.eye(3)
        J[:, row, axis, 6 * S + of_point] = s.R_BF
        if self.R_GM is not None:
            probe = np.matmul(s.R_BF, f.R_FM[:, s.point])
            turn = log3(np.matmul(probe, np.matmul(A, self.R_GM).swapaxes(-1, -2)))
            r = np.concatenate([r, self.per_radian * turn], axis=2)
            J[:, row, 3 + axis, of_place] = -self.per_radian * np.eye(3)  # exact where the residual is small
            J[:, row, 3 + axis, 6 * S + 3 * T + of_point] = self.per_radian * s.R_BF
        return r, J[..., self.free]

    def moved(self, state: Array, step: Array) -> Array:
        """Return the moved states (k, D)."""
        s, k = self.stand, len(state)
        S, T = s.n_places, s.n_points
        full = np.zeros((k, 6 * S + 6 * T))
        full[:, : len(self.free)][:, self.free] = step
        turn_G, p_BG, p_FM, turn_M = (
            v.reshape(k, -1, 3) for v in np.split(full, np.cumsum([3 * S, 3 * S, 3 * T]), axis=1)
        )
        f = unpacked(state, s)
        return Frames(exp3(turn_G) @ f.R_BG, f.p_BG + p_BG, f.p_FM + p_FM, exp3(turn_M) @ f.R_FM).packed()
