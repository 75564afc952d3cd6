"""Joint samples in the spherical shell about a place, with a density that stays known: uniform over joint space.

The first joint carries the measurement application point round a circle, so for any angles of the other joints
the parts of the first axis that lie in the shell are arcs in closed form. Laid end to end, the arcs of all samples
are one line on which equidistant points are as dense as uniform joint samples that were tested one by one.
"""

from collections.abc import Callable

import numpy as np

from planner.cell.cell import Cell
from planner.cell.gauge_types import JointSamples
from planner.common.errors import InputError
from planner.common.sequences import sobol_points
from planner.common.units import Array
from planner.runs.run import Mounting

PER_ARC = 4.0  # mean number of points on an arc that is not empty


def shell_points(cell: Cell, seed: int) -> Callable[[int], Array]:
    """Return what draws low-discrepancy points over all joints but the first, which the arcs choose.

    Raises:
        InputError: another joint's axis is coupled to the first one's, so that its circle is none.
    """
    if np.any(cell.robot.sense_matrix[1:, 0]):
        raise InputError(f"{cell.robot.path}: a joint is coupled to joint 1; candidates need joint 1 to turn alone")
    return sobol_points(cell.robot.n_joints - 1, seed)


def sample_shell(cell: Cell, mounting: Mounting, points: Array) -> JointSamples:
    """Bring low-discrepancy points into the shell of one fixture.

    Args:
        cell: the cell.
        mounting: how the gauge is held.
        points: samples of all joints but the first in the unit cube, (m, N − 1).
    """
    cell, p_BX = cell.at(mounting), cell.fixtures[mounting.fixture].p_BX
    lower, upper = cell.sampling_range
    q = np.empty((len(points), cell.robot.n_joints))
    q[:, 0], q[:, 1:] = 0.0, lower[1:] + points * (upper - lower)[1:]
    start, length = _arcs_in_shell(cell, p_BX, q, lower[0], upper[0])
    return _sample_arcs(q, start, length, float(upper[0] - lower[0]))


def _sample_arcs(q: Array, start: Array, length: Array, full: float) -> JointSamples:
    """Place equidistant points on the concatenated arcs (m, A) of the samples q (m, N)."""
    ends = np.cumsum(length.ravel())
    used = np.count_nonzero(length)
    if used == 0:
        return JointSamples(q[:0], len(q))
    spacing = ends[-1] / (PER_ARC * used)
    s = (np.arange(int(PER_ARC * used)) + 0.5) * spacing
    arc = np.minimum(np.searchsorted(ends, s, side="right"), len(ends) - 1)
    out = q[arc // length.shape[1]].copy()
    out[:, 0] = start.ravel()[arc] + (s - (ends[arc] - length.ravel()[arc]))
    return JointSamples(out, max(len(out), round(len(q) * full / spacing)))


def _arcs_in_shell(cell: Cell, p_BX: Array, q: Array, lower: float, upper: float) -> tuple[Array, Array]:
    """Arcs of the first joint that lie in the shell, for q with q1 = 0: start and length, (m, A) [rad].

    L² = h² + r² + f² − 2 r f cos φ: h along axis 1, r and f the distances of the MAP and the fixture from it,
    φ the angle between them.
    """
    chain, sense = cell.chain, float(cell.robot.sense_matrix[0, 0])
    first = next(k for k, t in enumerate(chain.transforms) if t.joint == 0)
    motion = chain.forward(cell.robot.theta(q[:1]))
    u, c = motion.u[first, :, 0], motion.p[first, :, 0]
    x, f = cell.map_position(q) - c, p_BX - c
    e1 = f - (f @ u) * u
    f_radial = float(np.linalg.norm(e1))
    e1 = e1 / f_radial if f_radial > 1e-9 else np.linalg.svd(u[None])[2][1]
    along, across = x @ e1, x @ np.cross(u, e1)
    r, phi0 = np.hypot(along, across), np.arctan2(across, along)
    square = (x @ u - f @ u) ** 2 + r**2 + f_radial**2
    scale = np.maximum(2 * r * f_radial, 1e-12)
    shortest, longest = cell.gauge.planned_range
    near = np.arccos(np.clip((square - shortest**2) / scale, -1, 1))
    far = np.arccos(np.clip((square - longest**2) / scale, -1, 1))
    starts, ends = np.stack([near, -far], axis=1) - phi0[:, None], np.stack([far, -near], axis=1) - phi0[:, None]
    if sense < 0:
        starts, ends = -ends, -starts
    turns = 2 * np.pi * np.arange(np.floor((lower - np.pi) / (2 * np.pi)), np.ceil((upper + np.pi) / (2 * np.pi)) + 1)
    start = np.maximum(starts[:, :, None] + turns, lower).reshape(len(q), -1)
    end = np.minimum(ends[:, :, None] + turns, upper).reshape(len(q), -1)
    return start, np.maximum(end - start, 0.0)
