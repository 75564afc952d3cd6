"""Poses of a table against the joint angles beside them: place, orientation, and its convention."""

from collections.abc import Sequence

import numpy as np

from planner.common.errors import InputError
from planner.common.units import DEG, MM, Array
from planner.compensation.correction import NominalFlange
from planner.compensation.few_axes import FULL_AXES
from planner.compensation.orientation_conventions import agreeing_conventions, turn_of_tool, turns_between
from planner.compensation.rotations import frame, inverse, to_euler
from planner.compensation.targets import CartesianTarget, Target, TargetReading
from planner.compensation.tolerances import CONVENTION_OFF, START_OFF, START_TURN
from planner.programs.languages.statements import Slot

PoseRow = tuple[int, tuple[Slot, ...], CartesianTarget]
"""Line, places of the numbers, and the pose of a row."""
_NAME_FRAMES = "name its tool and its base (--tool, --base; six zeros where it is the flange in the robot's own frame)"


def take_poses(rows: Sequence[PoseRow], spelling: str, reading: TargetReading) -> None:
    """Note the poses of a table; those that contradict the joint angles beside them are left, with the reason.

    Raises:
        InputError: the orientations are written in another convention than the columns say, which is named.
    """
    poses = [pose for _, _, pose in rows]
    T_BT, T_FT = np.array([p.T_BT for p in poses]), np.array([p.T_FT for p in poses])
    flange = frame(*NominalFlange(reading.robot).flange(np.array([p.start for p in poses])))
    T_wanted = inverse(np.array([p.T_WB for p in poses])) @ flange @ T_FT
    off = np.linalg.norm(T_BT[:, :3, 3] - T_wanted[:, :3, 3], axis=1)
    turn = turns_between(T_BT[:, :3, :3], T_wanted[:, :3, :3])
    _refuse_other_convention(rows, spelling, reading, turn, T_wanted[:, :3, :3])
    named = reading.frames.T_FT is not None or reading.frames.T_WB is not None
    turns_count = reading.robot.n_joints >= FULL_AXES  # others do not have every turn
    for (number, slots, pose), far, turned in zip(rows, off, turn, strict=True):
        if far > START_OFF and not named:
            said = f"the pose is {far / MM:.0f} mm from where the arm stands at its joint angles"
            reading.leave(number, f"{said}: {_NAME_FRAMES}")
        elif turned > START_TURN and turns_count and not named:
            said = f"the pose is turned by {turned / DEG:.0f}° from the tool at its joint angles"
            reading.leave(number, f"{said}: is it A, B, C (Z-Y'-X\") or qw, qx, qy, qz? else {_NAME_FRAMES}")
        else:
            reading.add(Target(number, slots, pose=pose))
    if named:
        _doubt_frames([number for number, _, _ in rows], off, turn * turns_count, reading)


def _doubt_frames(lines: Sequence[int], off: Array, turn: Array, reading: TargetReading) -> None:
    """Note where the tool and base that are named bring poses away from the joint angles beside them."""
    far = np.flatnonzero((off > START_OFF) | (turn > START_TURN))
    if far.size:
        reading.notes.append(
            (
                lines[int(far[0])],
                f"by this tool and base {far.size} of {len(lines)} poses are up to {off.max() / MM:.0f} mm and "
                f"{turn.max() / DEG:.0f}° from where the arm stands at the joint angles next to them: are "
                "they right (mm and degrees), and are the angles those of these poses?",
            )
        )


def _refuse_other_convention(
    rows: Sequence[PoseRow], spelling: str, reading: TargetReading, turn: Array, R_wanted: Array
) -> None:
    """Refuse a table whose orientations agree with its joint angles in another convention alone.

    Raises:
        InputError: naming the convention, or the tool by which all rows agree.
    """
    if turn.max() < CONVENTION_OFF:
        return
    count, most = int((turn >= CONVENTION_OFF).sum()), turn.max() / DEG
    said = (
        f"{reading.name}: the orientation of {count} of {len(rows)} poses contradicts the joint angles beside it, by "
        f"{most:.0f}° at most"
    )
    words = np.array([pose.words for _, _, pose in rows])
    if found := agreeing_conventions(words, R_wanted):
        more = "".join(f", and as {other.name}" for other in found[1:3])
        written = "A, B, C (Z-Y'-X\", moving axes)" if spelling == "ZYX" else "quaternions w, x, y, z"
        agree = f"the columns say {written}; read as {found[0].name}{more} all agree"
        raise InputError(f"{said}: {agree}; {found[0].cure}")
    R_FT = turn_of_tool(np.array([pose.T_BT[:3, :3] for _, _, pose in rows]), R_wanted)
    if R_FT is not None:
        T_FT = rows[0][2].T_FT
        numbers = [*T_FT[:3, 3] / MM, *to_euler((T_FT[:3, :3] @ R_FT)[None], np.zeros((1, 3)), "ZYX")[0] / DEG]
        tool = ",".join(f"{v + 0.0:.4g}" for v in numbers)
        raise InputError(
            f"{said}. All agree with a tool that is turned: --tool={tool} (mm and degrees), if it is that one"
        )
