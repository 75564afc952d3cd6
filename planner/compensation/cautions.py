"""Targets that are corrected, and that a person should look at all the same."""

from collections.abc import Iterator, Sequence

import numpy as np

from planner.compensation.poser import NominalPoser
from planner.compensation.rotations import turn_between
from planner.compensation.targets import Target
from planner.robot import Robot
from planner.units import DEG, MM, Array

FAR = 2.0 * DEG  # a joint that moves by more for a correction of millimetres is near a singular position
TURNED = 1.0 * DEG  # change of A or C that no correction of the orientation explains
SHOWN = 8  # targets that are told one by one
Note = tuple[int, str]


def far_moved(robot: Robot, targets: Sequence[Target], q: Array, q_new: Array) -> Iterator[Note]:
    """Yield (line, sentence) of targets whose joints move far from q to q_new, (n, N) [rad], for a small correction.

    The farthest are told one by one, the others counted.
    """
    nominal = NominalPoser(robot)
    shift = np.linalg.norm(nominal.flange(q_new)[0] - nominal.flange(q)[0], axis=1)
    moved, size = q_new - q, np.abs(q_new - q).max(axis=1, initial=0.0)
    far = [int(k) for k in np.argsort(-size, kind="stable") if size[k] > FAR]
    for k in far[:SHOWN]:
        j = int(np.abs(moved[k]).argmax())
        yield (
            targets[k].line,
            f"joint {j + 1} moves by {moved[k, j] / DEG:.1f}° for a correction of {shift[k] / MM:.2f} mm: the target "
            "is near a singular position; try it slowly",
        )
    if len(far) > SHOWN:
        line = targets[far[SHOWN]].line
        yield line, f"a joint moves by over {FAR / DEG:g}° here and at {len(far) - SHOWN - 1} more targets"


def turned_words(before: Sequence[Target], after: Sequence[Target]) -> Iterator[Note]:
    """Yield (line, sentence) of poses whose A and C change by far more than the orientation that they spell."""
    for old, new in zip(before, after, strict=True):
        if old.pose is None or new.pose is None or old.pose.spelling != "abc":
            continue
        was, is_ = old.pose.words / DEG, new.pose.words / DEG
        turn = float(np.linalg.norm(turn_between(old.pose.T_BT[None, :3, :3], new.pose.T_BT[None, :3, :3])))
        if np.abs(new.pose.words - old.pose.words).max() > max(TURNED, 3.0 * turn):
            yield (
                old.line,
                f"B stands near {np.sign(was[1]) * 90:.0f}°, where A and C mean almost the same: A {was[0]:.3f} became "
                f"{is_[0]:.3f} and C {was[2]:.3f} became {is_[2]:.3f}, the tool turns by {turn / DEG:.3f}° in all",
            )
