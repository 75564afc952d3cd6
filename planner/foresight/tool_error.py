"""How far the tool of a robot is off anywhere in its workspace, for errors that are known by their covariance."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.candidates.shell import box
from planner.cell import Cable, Cell
from planner.model import Model, Parameter
from planner.rig import rig_of
from planner.units import Array, frozen

STATES = 2000  # joint states at which the tool is looked at
FRAME = 6  # columns that only say where the base stands


@dataclass(frozen=True)
class ToolError:
    """Mean square error of the tool per squared parameter errors, (P, P), in the order of ``names``.

    Errors that a new alignment of the base takes away are left out: no gauge that stands where it likes sees them, and
    every cell aligns its work pieces.
    """

    names: tuple[str, ...]
    square: Array

    @classmethod
    def of(cls, cell: Cell, unknown: Sequence[Parameter] = (), seed: int = 0) -> "ToolError":
        """Look at the first tool point, at states uniform over joint space in which it is above the floor.

        Args:
            cell: the cell.
            unknown: effects beside the robot's geometry.
            seed: of the states.
        """
        q = uniform(cell, STATES, seed)
        first = rig_of(cell).point_names[:1]
        rig = replace(rig_of(replace(cell, fixtures=cell.fixtures[:1])), kind="position", point_names=first)
        model = Model.of(rig, frozenset({"tool"})).plus(list(unknown))
        rows = model.jacobian(q).reshape(-1, len(model.names))
        frame, own = np.linalg.qr(rows[:, :FRAME])[0], rows[:, FRAME:]
        left = own - frame @ (frame.T @ own)
        return cls(model.names[FRAME:], frozen(left.T @ left / len(q)))

    def weight(self, names: Sequence[str]) -> Array:
        """Return the matrix for parameters ``names``, (K, K); what does not move the tool has zeros."""
        known = [n for n in self.names if n in names]
        here, there = [self.names.index(n) for n in known], [list(names).index(n) for n in known]
        out = np.zeros((len(names), len(names)))
        out[np.ix_(there, there)] = self.square[np.ix_(here, here)]
        return out

    def rms(self, names: Sequence[str], covariance: Array) -> float:
        """Return the root mean square error of the tool [m] under a covariance (K, K) of ``names`` [m, rad, …]."""
        return float(np.sqrt(max((self.weight(names) * covariance).sum(), 0.0)))


def reach(cell: Cell) -> tuple[Array, Array]:
    """Return the range of each joint, both ends (N,) [rad]: one turn about home within the limits, cable or not."""
    return box(replace(cell, cable=Cable((), None)))


def uniform(cell: Cell, count: int, seed: int) -> Array:
    """Joint states (n, N) [rad] with the tool above the floor, within one turn about home and the joint limits."""
    q = np.random.default_rng(seed).uniform(*reach(cell), (count, cell.robot.n_joints))
    if cell.base.floor is None:
        return q
    return np.asarray(q[cell.map_position(q) @ cell.base.R_WB[2] > cell.base.floor])
