"""What a compensated file does, measured on the numbers as they are printed."""

from dataclasses import dataclass, field

import numpy as np

from planner.compensation.inverse import Problem, flange_of
from planner.compensation.poser import NominalPoser, Poser
from planner.compensation.solving import deviation, solve
from planner.compensation.targets import Target
from planner.compensation.text import listed
from planner.robot import Robot
from planner.units import DEG, MM, UM, Array


@dataclass(frozen=True)
class CompensationReport:
    """What was done to a file.

    Attributes:
        joint_targets, poses: how many of each were corrected.
        notes: (line, sentence) that the person should know.
        shift_mean_m, shift_max_m: how far the nominal robot now stands from where the file said [m]: the error undone.
        moved_max_rad: largest correction of a joint [rad].
        left_m, left_rad: largest deviation of the calibrated robot as the numbers are printed [m, rad].
        kept: (line, why) of targets that were left as they were.
    """

    joint_targets: int
    poses: int
    notes: tuple[tuple[int, str], ...]
    shift_mean_m: float
    shift_max_m: float
    moved_max_rad: float
    left_m: float
    left_rad: float
    kept: tuple[Problem, ...] = field(default=())


def report_of(
    robot: Robot, calibrated: Poser, targets: list[Target], printed: list[Target], q: Array, q_new: Array
) -> CompensationReport:
    """Read the printed numbers back, and say where the calibrated robot stands with them."""
    nominal = NominalPoser(robot)
    p, R = nominal.flange(q)
    q_printed = q_new.copy()
    for i, t in enumerate(printed):
        q_printed[i] = q_new[i] if t.q is None else t.q
    at = [i for i, t in enumerate(printed) if t.pose is not None]
    if at:
        T = flange_of([pose for t in printed if (pose := t.pose) is not None])
        q_printed[at], _ = solve(robot, nominal, q_new[at], T[:, :3, 3], T[:, :3, :3])
    left, turned = deviation(robot, calibrated, q_printed, p, R)
    shift = np.linalg.norm(nominal.flange(q_printed)[0] - p, axis=1)
    return CompensationReport(
        joint_targets=len(targets) - len(at),
        poses=len(at),
        notes=(),
        shift_mean_m=float(shift.mean()) if len(shift) else 0.0,
        shift_max_m=float(shift.max(initial=0.0)),
        moved_max_rad=float(np.abs(q_new - q).max(initial=0.0)),
        left_m=float(left.max(initial=0.0)),
        left_rad=float(turned.max(initial=0.0)),
    )


def summary(name: str, report: CompensationReport) -> str:
    """Return what was done, with every line that the person should look at."""
    lines = [
        f"{name}: {report.joint_targets} joint targets and {report.poses} poses corrected by "
        f"{report.shift_mean_m / MM:.3f} mm on average, {report.shift_max_m / MM:.3f} mm at most; "
        f"no joint moved by more than {report.moved_max_rad / DEG:.3f}°",
        f"as printed {report.left_m / UM:.2f} µm and {report.left_rad * 1e6:.2f} µrad of error are left at most",
    ]
    lines += listed(name, report.notes)
    lines += (f"left as it was: {line}" for line in listed(name, report.kept))
    return "\n".join(lines)
