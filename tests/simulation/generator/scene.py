"""A scene: the whole course of a measurement as effects see it, and where the true arm stands in it."""

from dataclasses import dataclass

import numpy as np

from tests.simulation.generator.arm import Arm, moment_of_weight, screw

CHUNK = 20_000  # rows a pass, to bound the memory of long runs


@dataclass(frozen=True, eq=False)
class Scene:
    """n samples in the order of time; per joint (n, N), in SI units.

    ``q``: angles as read; ``command``: as commanded; ``speed`` [rad/s], zero in a static run; ``direction``: sign of
    the last motion; ``warmth`` [K] above the start; ``payload`` [kg] on the flange; ``force`` [N] pull along the bar
    towards ``fixture`` (3,) [m]; ``tool`` (3,) true measured point and ``tool_com`` in the flange frame [m];
    ``mass`` (N,) true link masses [kg]; ``gauge``: edbb, tracker or balls; ``moving``: a continuous run.
    """

    arm: Arm
    gauge: str
    moving: bool
    t: np.ndarray
    q: np.ndarray
    command: np.ndarray
    speed: np.ndarray
    direction: np.ndarray
    session: np.ndarray
    warmth: np.ndarray
    payload: np.ndarray
    force: np.ndarray
    fixture: np.ndarray
    tool: np.ndarray
    tool_mass: float
    tool_com: np.ndarray
    mass: np.ndarray

    def joint(self, j):
        """Angle (n,) of joint j (from 1) as read."""
        return self.q[:, j - 1]

    def moments(self, name, only="all"):
        """Moment (n,) [N m] about a slot of weight and bar force; ``only`` = ``payload``: a 1 kg load at the tool."""
        return np.concatenate([self._moments(name, rows, only) for rows in self.chunks()])

    def _moments(self, name, rows, only):
        stance = self.arm.walk(self.q[rows], {}, [name])
        centre = stance.p + np.einsum("ijn,j->in", stance.R, self.tool_com)
        if only == "payload":
            return moment_of_weight(self.arm, stance, name, 0 * self.mass, [(1.0, centre)])
        loads = [(self.tool_mass + self.payload[rows], centre)]
        moment = moment_of_weight(self.arm, stance, name, self.mass, loads)
        if np.any(self.force[rows]):
            x = stance.p + np.einsum("ijn,j->in", stance.R, self.tool)
            bar = self.fixture[:, None] - x
            pull = self.force[rows] * bar / np.linalg.norm(bar, axis=0)
            moment = moment + np.sum(screw(self.arm, stance, name, x) * pull, axis=0)
        return moment

    def points(self, deltas):
        """Measured point (n, 3) [m] of the arm whose slots are moved by ``deltas`` (numbers or (n,))."""
        parts = []
        for rows in self.chunks():
            here = {k: (v[rows] if np.ndim(v) else v) for k, v in deltas.items()}
            stance = self.arm.walk(self.q[rows], here)
            parts.append((stance.p + np.einsum("ijn,j->in", stance.R, self.tool)).T)
        return np.concatenate(parts)

    def chunks(self):
        """Slices over the samples."""
        return [slice(k, k + CHUNK) for k in range(0, len(self.q), CHUNK)]


def total(*parts):
    """Sum of several mappings of slot → motion."""
    out = {}
    for part in parts:
        for name, value in part.items():
            out[name] = out.get(name, 0.0) + value
    return out
