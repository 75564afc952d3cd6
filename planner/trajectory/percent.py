"""Point-to-point moves at a tool-point speed: which share of the axis speeds keeps each leg within it."""

import numpy as np
from numpy.typing import ArrayLike

from planner.trajectory.limits import Limits, ToolJacobian, checked
from planner.units import Array, frozen

JOINT_STEP = 0.01  # [rad] between two samples of a leg
MARGIN = 1.0 + 2e-4  # what the tool's speed between two samples may exceed them by


def axis_percent(path_q: ArrayLike, *, tool_speed: ArrayLike, tool_jacobian: ToolJacobian, limits: Limits) -> Array:
    """Return for each leg (m-1,) the highest axis percentage, to 100, that keeps the tool point within tool_speed.

    A synchronised point-to-point move at fraction f takes T/f with T = max_j |Δq_j|/speed_j; its tool point moves at up
    to f · max_σ |J(q(σ)) Δq| / T. tool_speed is one or (m-1,) [m/s], inf for none. Raises InputError like
    plan_trajectory.
    """
    m = len(np.asarray(path_q))
    request = checked(path_q, np.ones(m, dtype=bool), 0.0, tool_speed, 0.0, len(limits.speed))
    q, limit = request.path_q, request.tool_speed
    leg = np.diff(q, axis=0)
    quickest = (np.abs(leg) / limits.speed).max(axis=1)
    count = np.ceil(np.abs(leg).max(axis=1) / JOINT_STEP).astype(np.intp) + 1
    run = np.repeat(np.arange(m - 1), count)
    begin = np.cumsum(count) - count
    share = (np.arange(len(run)) - begin[run]) / np.maximum(count - 1, 1)[run]
    jacobian = tool_jacobian(q[run] + share[:, None] * leg[run])
    travel = np.linalg.norm(np.einsum("nij,nj->ni", jacobian, leg[run]), axis=1)
    peak = np.maximum.reduceat(travel, begin) * MARGIN
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction = np.where(peak > 0.0, limit * quickest / peak, 1.0)
    return frozen(100.0 * np.minimum(fraction, 1.0))
