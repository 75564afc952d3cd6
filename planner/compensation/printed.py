"""The corrected file is read again, as a file of its own, and compared with what was to be written."""

import numpy as np

from planner.common.units import DEG, UM, Array
from planner.compensation.correction import NominalPoser, Poser, flange_deviation
from planner.compensation.nominal_angles import SearchSeeds, solve_nominal_angles
from planner.compensation.targets import Note, Target

JOINTS = 1e-3  # [rad] of a joint between what is read and what was meant: another turn is 2π, another shape far more
PLACE = 5e-6  # [m and rad] of the calibrated flange, from rounding alone


def read_printed(
    seeds: SearchSeeds, calibrated: Poser, printed: list[Target], rows: np.ndarray, q: Array, q_new: Array
) -> tuple[Array, list[tuple[int, str]]]:
    """Return the angles (n, N) [rad] at which a controller stands at the printed targets, and which are wrong and why.

    Args:
        seeds: of the nominal robot, as which the controller reads the file.
        calibrated: the robot as it is.
        printed: all targets of the corrected text.
        rows: indices of those that were corrected.
        q, q_new: their nominal and corrected angles, (n, N) [rad].
    """
    robot = seeds.robot
    found, problems = solve_nominal_angles(robot, printed, seeds)
    angles = found[rows]
    said: dict[int, str] = dict(_by_line(problems))
    p, R = NominalPoser(robot).flange(q)
    known = np.asarray(~np.isnan(angles).any(axis=1))
    far_m, far_rad = np.full(len(q), np.inf), np.full(len(q), np.inf)
    far_m[known], far_rad[known] = flange_deviation(robot, calibrated, angles[known], p[known], R[known])
    wrong = []
    for k, i in enumerate(rows):
        if not known[k]:
            wrong.append((k, f"read again, {said.get(printed[i].line, 'the pose is not reached')}"))
            continue
        off = np.abs(angles[k] - q_new[k])
        j = int(off.argmax())
        if off[j] > JOINTS:
            stands = f"{angles[k, j] / DEG:.3f}° instead of {q_new[k, j] / DEG:.3f}°"
            wrong.append((k, f"read again, joint {j + 1} would stand at {stands}"))
        elif max(far_m[k], far_rad[k]) > PLACE:
            wrong.append((k, f"read again, {far_m[k] / UM:.1f} µm and {far_rad[k] * 1e6:.1f} µrad are left"))
    return angles, wrong


def _by_line(problems: list[Note]) -> list[Note]:
    return sorted(problems, reverse=True)
