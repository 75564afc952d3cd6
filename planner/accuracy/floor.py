"""What even a perfect robot model would show: the nests' and the tracker's noise, and the arm's repeatability."""

from dataclasses import dataclass

import numpy as np

from planner.accuracy.tracker import Registered
from planner.cell import Cell
from planner.model import Model
from planner.placing.rotations import skew
from planner.run import Run
from planner.units import Array, to_mm


@dataclass(frozen=True)
class Floor:
    """Root mean square distances over the poses [m], as declared: by the nests, by the tracker, by the arm."""

    nests: float
    tracker: float
    arm: float

    @property
    def all(self) -> float:
        """All three together [m]."""
        return float(np.sqrt(self.nests**2 + self.tracker**2 + self.arm**2))

    def text(self) -> str:
        """Say it in a sentence."""
        whole, nests, tracker, arm = (float(to_mm(v)) for v in (self.all, self.nests, self.tracker, self.arm))
        first = f"{nests:.3f} by the nests' readings, " if nests else ""
        return (
            f"{whole:.3f} mm rms is what a perfect model would show: {first}{tracker:.3f} by the tracker's noise, "
            f"{arm:.3f} by the arm's repeatability"
        )


def floor_of(cell: Cell, run: Run, frame: Registered, by_nests: bool = True) -> Floor:
    """Work it out for the poses of a run with positions; without ``by_nests`` the model stands by no nest."""
    assert run.readings.position is not None
    model, noise = Model.from_cell(cell), cell.gauge.noise
    shaken = (model.joint_rows(run.samples) ** 2).sum(axis=(1, 2)).mean()
    nests = frame_doubt(frame, frame.seen(run.readings.position), noise)
    return Floor(
        float(np.sqrt((nests**2).mean())) * by_nests,
        float(np.sqrt(3.0) * noise),
        float(model.rig.joint_sigma * np.sqrt(shaken)),
    )


def frame_doubt(frame: Registered, p_WM: Array, noise: float) -> Array:
    """Root mean square distance (n,) [m] by which nests read with ``noise`` [m] put points p_WM (n, 3) wrongly."""
    own = _rigid(frame.p_WN).reshape(-1, 6)
    rows = _rigid(p_WM)
    covariance = noise**2 * np.linalg.inv(own.T @ own)
    return np.asarray(np.sqrt(np.einsum("nij,jk,nik->n", rows, covariance, rows)))


def _rigid(p: Array) -> Array:
    """How points (n, 3) move with a small shift and turn of their frame, (n, 3, 6)."""
    return np.concatenate([np.broadcast_to(np.eye(3), (len(p), 3, 3)), -skew(p)], axis=2)
