"""What a compensated file does, measured on the numbers as printed, and what a person should look at."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from planner.common.numbers import number_of
from planner.common.summary import Summary, under_key
from planner.common.units import DEG, MM, UM, Array
from planner.compensation.correction import FlangeModel, NominalFlange, flange_deviation, near_singular
from planner.compensation.few_axes import FULL_AXES, ToolDeviation, ToolGoal, TurnsLeft
from planner.compensation.nominal_angles import SearchSeeds, solve_nominal_angles
from planner.compensation.targets import Note, Target, line_ranges, list_lines
from planner.compensation.tolerances import JOINT_OFF, PLACE_OFF, TOLD_JOINT_MOVE, UNEXPLAINED_TURN
from planner.kinematics.inverse_kinematics import rotation_between
from planner.kinematics.robot import Robot


def large_joint_motions(robot: Robot, targets: Sequence[Target], q: Array, q_new: Array) -> Iterator[Note]:
    """Yield (line, sentence) of targets whose joints move far from q to q_new, (n, N) [rad], for a small correction.

    The farthest are told one by one, the others counted.
    """
    shown = 8  # targets that are told one by one
    nominal = NominalFlange(robot)
    shift = np.linalg.norm(nominal.flange(q_new)[0] - nominal.flange(q)[0], axis=1)
    moved, size = q_new - q, np.abs(q_new - q).max(axis=1, initial=0.0)
    far = [int(k) for k in np.argsort(-size, kind="stable") if size[k] > TOLD_JOINT_MOVE]
    singular = near_singular(robot, q[far[:shown]]) if far else np.zeros(0, dtype=bool)
    for k, lost in zip(far[:shown], singular, strict=False):
        j = int(np.abs(moved[k]).argmax())
        because = ": the target is near a singular position" if lost else ", which its calibration asks for"
        yield (
            targets[k].line,
            f"joint {j + 1} moves by {robot.joint_text(j, moved[k, j], '.1f')} for a correction of "
            f"{shift[k] / MM:.2f} mm{because}; try it slowly",
        )
    if len(far) > shown:
        line = targets[far[shown]].line
        yield line, f"a joint moves by over {TOLD_JOINT_MOVE / DEG:g}° here and at {len(far) - shown - 1} more targets"


def rough_starts(robot: Robot, targets: Sequence[Target], q: Array) -> Iterator[Note]:
    """Yield (line, sentence) where joint angles beside poses are not those of the poses, at q (n, N) [rad]."""
    rows = [k for k, t in enumerate(targets) if t.pose is not None and t.pose.start is not None]
    off = np.array([q[k] - targets[k].pose.start for k in rows]).reshape(len(rows), robot.n_joints)  # type: ignore[union-attr]
    size = np.abs(off).max(axis=1, initial=0.0)
    if (size > TOLD_JOINT_MOVE).any():
        row = int(size.argmax())
        j = int(np.abs(off[row]).argmax())
        yield (
            targets[rows[row]].line,
            f"the joint angles beside {int((size > TOLD_JOINT_MOVE).sum())} of {len(rows)} poses are not those of the "
            f"poses and are written anew: joint {j + 1} moves by {robot.joint_text(j, off[row, j], '.1f')} here",
        )


def near_singular_angles(before: Sequence[Target], after: Sequence[Target]) -> Iterator[Note]:
    """Yield (line, sentence) of poses near B = ±90°, where A and C change by far more than the orientation does."""
    for old, new in zip(before, after, strict=True):
        if old.pose is None or new.pose is None or old.pose.spelling != "ZYX":
            continue
        was, is_ = old.pose.words / DEG, new.pose.words / DEG
        turn = float(np.linalg.norm(rotation_between(old.pose.T_BT[None, :3, :3], new.pose.T_BT[None, :3, :3])))
        if np.abs(new.pose.words - old.pose.words).max() > max(UNEXPLAINED_TURN, 3.0 * turn):
            yield (
                old.line,
                f"B stands near {np.sign(was[1]) * 90:.0f}°, where A and C mean almost the same: A {was[0]:.3f} became "
                f"{is_[0]:.3f} and C {was[2]:.3f} became {is_[2]:.3f}, the tool turns by {turn / DEG:.3f}° in all",
            )


@dataclass(frozen=True)
class CompensationReport:
    """What was done to a file.

    Attributes:
        joint_targets, poses: how many of each were corrected.
        notes: (line, sentence) that the person should know.
        shift_mean_m, shift_max_m: how far the nominal robot now stands from where the file said [m]: the error undone.
        moved_max_rad: largest correction of a joint [rad].
        left_m, left_rad: largest deviation of the calibrated robot as the numbers are printed [m, rad].
        corrected: lines of the targets that were corrected.
        kept: (line, why) of targets and moves that were left as they were.
        turns_left: what an arm with fewer than six axes cannot do, target by target.
    """

    joint_targets: int
    poses: int
    notes: tuple[Note, ...]
    shift_mean_m: float
    shift_max_m: float
    moved_max_rad: float
    left_m: float
    left_rad: float
    corrected: tuple[int, ...]
    kept: tuple[Note, ...] = ()
    turns_left: TurnsLeft | None = None

    def overview(self, name: str) -> Summary:
        """Return the corrections, with every line that the person should look at."""
        mean, most = self.shift_mean_m / MM, self.shift_max_m / MM
        moved = (
            f"{mean:.3f} mm on average, {most:.3f} mm at most; no joint by more than {self.moved_max_rad / DEG:.3f}°"
        )
        facts = [("lines", f"lines left as they were: {line_ranges(line for line, _ in self.kept)}")] * bool(self.kept)
        facts += [("moved", moved)] * bool(self.corrected)
        facts += [*under_key("look at", list_lines(name, self.notes))]
        facts += under_key("why left", (f"left as it was: {line}" for line in list_lines(name, self.kept)))
        details = [("lines", f"corrected lines: {line_ranges(self.corrected)}")] * bool(self.kept)
        if self.turns_left is None:
            off = f"{self.left_m / UM:.2f} µm and {self.left_rad * 1e6:.2f} µrad"
            details.append(("written", f"as the numbers are written at most {off} are left"))
        else:
            met, most_left = self.turns_left.sentences
            facts.insert(0, ("left", met))
            details.append(("", most_left))
        what = f"{number_of(self.joint_targets, 'joint target')} and {number_of(self.poses, 'pose')}"
        return Summary(f"{name}: {what} corrected", facts, details)


def report_of(
    robot: Robot,
    calibrated: FlangeModel,
    targets: list[Target],
    printed: list[Target],
    q: Array,
    q_new: Array,
    q_printed: Array,
    T_FT: Array,
) -> CompensationReport:
    """Say where the calibrated robot stands at the angles (n, N) [rad] that the ``printed`` targets give.

    ``T_FT``: the tools in the flange, (n, 4, 4) [m].
    """
    if not targets:  # a file that goes along with others of its program
        return CompensationReport(0, 0, (), 0.0, 0.0, 0.0, 0.0, 0.0, ())
    nominal = NominalFlange(robot)
    p, R = nominal.flange(q)
    poses = sum(t.pose is not None for t in targets)
    left, turned = flange_deviation(calibrated, q_printed, p, R)
    shift = np.linalg.norm(nominal.flange(q_printed)[0] - p, axis=1)
    return CompensationReport(
        joint_targets=len(targets) - poses,
        poses=poses,
        notes=(
            *large_joint_motions(robot, targets, q, q_new),
            *rough_starts(robot, targets, q),
            *near_singular_angles(targets, printed),
        ),
        shift_mean_m=float(shift.mean()),
        shift_max_m=float(shift.max(initial=0.0)),
        moved_max_rad=float(np.abs(q_new - q).max(initial=0.0)),
        left_m=float(left.max(initial=0.0)),
        left_rad=float(turned.max(initial=0.0)),
        corrected=tuple(sorted({t.line for t in targets})),
        turns_left=_remaining_turns(robot, calibrated, targets, q, q_printed, T_FT),
    )


def _remaining_turns(
    robot: Robot, calibrated: FlangeModel, targets: list[Target], q: Array, q_printed: Array, T_FT: Array
) -> TurnsLeft | None:
    if robot.n_joints >= FULL_AXES:
        return None
    goal = ToolGoal.of(NominalFlange(robot), q, T_FT)
    before, after = (ToolDeviation.at(goal, calibrated, v) for v in (q, q_printed))
    return TurnsLeft(robot.n_joints, tuple(t.line for t in targets), before, after)


def read_printed_angles(
    seeds: SearchSeeds, calibrated: FlangeModel, printed: list[Target], rows: np.ndarray, q: Array, q_new: Array
) -> tuple[Array, list[tuple[int, str]]]:
    """Return the angles (n, N) [rad] at which a controller stands at the printed targets, and which are wrong and why.

    They are compared with what was asked for; of an arm with fewer than six axes with what ``q_new`` gives.

    Args:
        seeds: of the nominal robot, as which the controller reads the file.
        calibrated: the robot as it is.
        printed: all targets of the corrected text.
        rows: indices of those that were corrected.
        q, q_new: their nominal and corrected angles, (n, N) [rad].
    """
    robot = seeds.robot
    found, problems = solve_nominal_angles(printed, seeds)
    angles = found[rows]
    said: dict[int, str] = dict(sorted(problems, reverse=True))
    p, R = NominalFlange(robot).flange(q) if robot.n_joints >= FULL_AXES else calibrated.flange(q_new)
    known = np.asarray(~np.isnan(angles).any(axis=1))
    far_m, far_rad = np.full(len(q), np.inf), np.full(len(q), np.inf)
    far_m[known], far_rad[known] = flange_deviation(calibrated, angles[known], p[known], R[known])
    wrong = []
    reach = sum(t.extent for t in robot.transforms if t.kind == "translation")
    for k, i in enumerate(rows):
        if not known[k]:
            wrong.append((k, f"read again, {said.get(printed[i].line, 'the pose is not reached')}"))
            continue
        off = np.abs(angles[k] - q_new[k])
        j = int(off.argmax())
        if off[j] > JOINT_OFF:
            stands = " instead of ".join(robot.joint_text(j, q[k, j], ".3f") for q in (angles, q_new))
            wrong.append((k, f"read again, joint {j + 1} would stand at {stands}"))
        elif max(far_m[k] - reach * _rounding(printed[i]), far_rad[k] - _rounding(printed[i])) > PLACE_OFF:
            wrong.append((k, f"read again, {far_m[k] / UM:.1f} µm and {far_rad[k] * 1e6:.1f} µrad are left"))
    return angles, wrong


def _rounding(target: Target) -> float:
    """Return by how much the flange may turn from the rounding of a target's joint angles alone [rad]."""
    return 0.0 if target.q is None else sum(0.5 * slot.unit * 10.0**-slot.decimals for slot in target.slots)
