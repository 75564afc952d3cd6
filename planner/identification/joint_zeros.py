"""By how much each joint really stands elsewhere than its controller shows, as the run shows it."""

import numpy as np

from planner.common.units import to_deg
from planner.identification.calibration import Calibration


def joint_zeros_text(c: Calibration) -> str:
    """Return the joint zeros [deg] with their standard deviations; empty where the run shows none.

    A controller's angle q turns the model by A q + θ₀, so errors of θ are A times errors of q. A joint that the run
    does not show, or that is coupled to such a joint, has none; one whose zero also stands for other errors bears a *.
    """
    robot = c.setup.robot
    names = [f"theta{k + 1}" for k in range(robot.n_joints)]
    seen = {e.name: e for e in c.estimates if e.identifiable}
    shift = np.array([seen[n].value - seen[n].nominal if n in seen else 0.0 for n in names])
    std = np.array([(seen[n].std or 0.0) if n in seen else 0.0 for n in names])
    turn = np.linalg.inv(robot.sense_matrix)
    zero, sigma = to_deg(turn @ shift), to_deg(np.sqrt(turn**2 @ std**2))
    shown = ((turn == 0.0) | np.array([n in seen for n in names])).all(axis=1)
    if not shown.any():
        return ""
    stars = ["*" if n in seen and seen[n].absorbs else "" for n in names]
    parts = [f"joint {k + 1} {zero[k]:+.3f} ± {sigma[k]:.3f}°{stars[k]}" for k in np.flatnonzero(shown)]
    unseen = ", ".join(str(k + 1) for k in np.flatnonzero(~shown))
    remarks = [
        "add it to the angle that is shown",
        "* also stands for errors that the run does not show" if any(stars) else "",
        f"not seen: joint {unseen}" if unseen else "",
    ]
    return f"{', '.join(parts)} ({'; '.join(filter(None, remarks))})"
