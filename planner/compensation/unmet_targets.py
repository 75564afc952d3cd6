"""Why targets cannot be corrected, and what an arm with fewer than six axes cannot do at those that can."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from planner.common.units import DEG, Array
from planner.compensation.correction import Correction, NominalFlange, move_limit
from planner.compensation.few_axes import FULL_AXES, ToolDeviation, ToolGoal
from planner.compensation.nominal_angles import flange_of
from planner.compensation.targets import CartesianTarget, Note, Target
from planner.compensation.tolerances import MISSED_TURN
from planner.kinematics.robot import Robot


def turn_notes(nominal: Robot, targets: Sequence[Target], q: Array) -> list[Note]:
    """Say of poses how far an arm with fewer than six axes is from the turn that they ask for, uncorrected already."""
    at = [k for k, t in enumerate(targets) if t.pose is not None]
    if nominal.n_joints >= FULL_AXES or not at:
        return []
    poses = [p for t in targets if (p := t.pose) is not None]
    T = flange_of(poses)
    off = ToolDeviation.at(
        ToolGoal(np.array([p.T_FT for p in poses]), *_tool_of(T, poses)), NominalFlange(nominal), q[at]
    )
    return [
        (
            targets[k].line,
            f"an arm of {nominal.n_joints} axes cannot turn its tool as this pose asks: its axis stays "
            f"{off.tilt[i] / DEG:.2f}° off, and its turn about the axis {off.spin[i] / DEG:.2f}°; the place is met",
        )
        for i, k in enumerate(at)
        if max(off.tilt[i], off.spin[i]) > MISSED_TURN
    ]


def _tool_of(T_BF: Array, poses: Sequence[CartesianTarget]) -> tuple[Array, Array]:
    """Return tool points (n, 3) [m] and turns (n, 3, 3) in the base frame, of flanges (n, 4, 4) that have tools."""
    T = T_BF @ np.array([p.T_FT for p in poses])
    return T[:, :3, 3], T[:, :3, :3]


def target_problems(lines: list[int], nominal: Robot, c: Correction) -> list[Note]:
    """Say of every target that cannot be used why."""
    problems = []
    for k in np.flatnonzero(~c.usable):
        where = ": the target is near a singular position" if c.singular[k] else ""
        if not c.within[k] and c.solved[k]:
            j = int(np.argmax(np.maximum(nominal.q_lower - c.q[k], c.q[k] - nominal.q_upper)))
            low, up = nominal.q_lower[j] / DEG, nominal.joint_text(j, nominal.q_upper[j], "g")
            why = f"joint {j + 1} would have to stand at {nominal.joint_text(j, c.q[k, j])}; {low:g} … {up} are allowed"
        elif c.solved[k]:
            j = int(np.abs(c.moved[k]).argmax())
            why = (
                f"joint {j + 1} would have to move by {nominal.joint_text(j, c.moved[k, j], '.1f')}, further than "
                f"{nominal.joint_text(j, move_limit(nominal), 'g')}{where or ', which is more than a correction'}"
            )
        else:
            ends = "the arm is at a singular position or at the end of its reach"
            beyond = "the calibrated robot does not reach it within its limits"
            why = (
                f"{c.after.distance[k] * 1e6:.1f} µm and {c.residual_rad[k] * 1e6:.1f} µrad are left: "
                f"{ends if c.singular[k] else beyond}"
            )
        problems.append((lines[k], why))
    return problems


def problems_summary(path: Path, problems: Sequence[Note], targets: Sequence[Target]) -> str:
    """Return the sentence above the list of targets that cannot be corrected, and what would help."""
    help_ = (
        "; move them away from limits and singular positions (a wrist that is straight)"
        if any("singular" in why or "allowed" in why for _, why in problems)
        else ""
    )
    return f"{path.name}: {len(problems)} of {len(targets)} targets have no fake target near the nominal one{help_}"
