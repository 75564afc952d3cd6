"""By how much each joint really stands elsewhere than its controller shows, as the released robot has it."""

import numpy as np

from planner.common.units import to_deg
from planner.identification.calibration import Calibration


def joint_zeros_text(c: Calibration) -> str:
    """Return the joint zeros [deg] with their standard deviations; empty where the run shows none.

    A controller's angle q turns the model by A q + θ₀, so errors of θ are A times errors of q. A joint that the run
    does not show, or that is coupled to such a joint, has none; one whose zero also stands for other errors bears a *.
    """
    if c.released is None:
        return ""
    robot, fit = c.fit.model.setup.robot, c.released.fit
    names = [f"theta{k + 1}" for k in range(robot.n_joints)]
    seen = {e.name: "*" if e.absorbs else "" for e in c.estimates if e.identifiable}
    values = dict(zip(fit.model.names, map(float, fit.errors), strict=True))
    turn = np.linalg.inv(robot.sense_matrix)
    zero = turn @ np.array([values.get(n, 0.0) for n in names])
    std = np.sqrt(((turn @ c.released.spread(names)) ** 2).sum(axis=1))
    shown = (turn == 0.0) | np.array([n in seen for n in names])
    parts = [
        f"joint {k + 1} {to_deg(zero[k]):+.3f} ± {to_deg(std[k]):.3f}°{seen[n]}"
        for k, n in enumerate(names)
        if shown[k].all()
    ]
    star = "; * also stands for errors that the run does not show" if any(seen.get(n) for n in names) else ""
    return f"{', '.join(parts)} (add it to the angle that is shown{star})" if parts else ""
