"""The gauges as the world has them: what they read of a measured point, and how that moves with what places them."""

from dataclasses import dataclass

import numpy as np

from tests.simulation.generator.arm import screw


@dataclass(frozen=True, eq=False)
class Station:
    """One gauge; ``kind`` edbb: distance to ``place`` (3,) plus ``zero``; tracker: R (3, 3), ``place`` of its frame.

    balls: reads the measured point in the base frame, to be held against the ball centres ``balls`` (n, 3).
    """

    kind: str
    place: np.ndarray
    R: np.ndarray
    zero: float = 0.0
    balls: np.ndarray | None = None

    def read(self, x):
        """Reading (n, k) [m] of measured points (n, 3)."""
        if self.kind == "edbb":
            return np.linalg.norm(x - self.place, axis=1, keepdims=True) + self.zero
        return (x - self.place) @ self.R if self.kind == "tracker" else x

    def columns(self, arm, q, errors, tool):
        """Jacobian (n, k, P) of the reading by geometry, tool and what places the gauge, and the P names."""
        stance = arm.walk(q, errors, arm.geometry)
        x = stance.p + np.einsum("ijn,j->in", stance.R, tool)
        motions = [screw(arm, stance, name, x) for name in arm.geometry] + [stance.R[:, k] for k in range(3)]
        names = [*arm.geometry, "map_x", "map_y", "map_z"]
        J = np.stack([np.broadcast_to(m, x.shape) for m in motions], axis=2)  # (3, n, P)
        J = np.moveaxis(J, 1, 0)
        if self.kind == "edbb":
            e = (x.T - self.place) / np.linalg.norm(x.T - self.place, axis=1, keepdims=True)
            rows = np.einsum("ni,nip->np", e, J)
            rows = np.concatenate([rows, -e, np.ones((len(e), 1))], axis=1)
            return rows[:, None, :], (*names, "fixture_A_x", "fixture_A_y", "fixture_A_z", "zero")
        about = self.balls if self.balls is not None else x.T
        J = np.concatenate([J, _frame(about)], axis=2)
        frame = tuple(f"frame_{w}{c}" for w in ("", "r") for c in "xyz")
        return (np.einsum("ij,nip->njp", self.R, J) if self.kind == "tracker" else J), (*names, *frame)


def _frame(x):
    """Motion (n, 3, 6) of points fixed in a frame that moves along and turns about the base's axes."""
    eye = np.broadcast_to(np.eye(3), (len(x), 3, 3))
    turns = np.stack([np.cross(np.eye(3)[k], x) for k in range(3)], axis=2)
    return np.concatenate([eye, turns], axis=2)
