"""How far the tools of a program, or one that a person names, stand from the tool point that was measured."""

from collections.abc import Iterator, Sequence

import numpy as np

from planner.common.numbers import number_of
from planner.common.units import Array, to_mm
from planner.compensation.targets import Target, group_tool_points, line_ranges
from planner.kinematics.robot import Robot

NO_TOOL = 0.5e-6  # [m] by which rounding to a thousandth of a millimetre moves a point: nearer points are one


def tool_warnings(robot: Robot, named: Array | None, targets: Sequence[Target]) -> Iterator[str]:
    """Yield a warning for every tool that is off the measured one by more than its deviations allow.

    They are those beside the robot: with this robot goes the tool that belongs to it, and no other that is as likely.

    Args:
        robot: the calibrated one.
        named: tool point (3,) [m] in the flange that the person has named, or None.
        targets: of the program, which may say tools of their own.
    """
    if not robot.tool_points:
        return
    if named is not None:
        yield from _warning(robot, named, "--tool", "say --tool model")
    else:
        yield from _unknown_tools(targets)
    said = [(t.line, p) for t in targets if (p := t.tool_point) is not None]
    if not said:
        return
    tools, which = group_tool_points([p for _, p in said])
    for k, p_FM in enumerate(tools):
        if named is not None and float(np.abs(p_FM - named).max()) < NO_TOOL:
            continue
        lines = [line for (line, _), at in zip(said, which, strict=True) if at == k]
        place = ", ".join(f"{v:.1f}" for v in to_mm(p_FM))
        where = f"the program's tool ({place}) mm on {number_of(len(set(lines)), 'line')} ({line_ranges(lines)})"
        yield from _warning(robot, p_FM, where, "write it into the program or its tool table")


def _unknown_tools(targets: Sequence[Target]) -> Iterator[str]:
    """Yield a warning for the joint targets whose tools the files say by a number or a name alone."""
    unknown = [t for t in targets if t.unknown_tool]
    if unknown:
        names = ", ".join(sorted({t.unknown_tool for t in unknown}))
        lines = {t.line for t in unknown}
        yield (
            f"warning: joint targets on {number_of(len(lines), 'line')} ({line_ranges(lines)}) are of a tool that the "
            f"files do not hold ({names}): the error stated is that of the measured tool alone, of another one it is "
            "not known. --tool X,Y,Z,A,B,C names it, --tool model says that it is the measured one"
        )


def _warning(robot: Robot, p_FM: Array, who: str, remedy: str) -> Iterator[str]:
    """Yield what is to be said of a tool point (3,) [m]; nothing where it is the measured one."""
    point = min(robot.tool_points, key=lambda p: float(np.linalg.norm(p_FM - p.p_FM)))
    off, std = p_FM - point.p_FM, point.std_beside_robot
    # 3.0: standard deviations by which a tool that is named may be off the measured one
    if (np.abs(off) <= NO_TOOL + 3.0 * (0.0 if std is None else std)).all():
        return
    place = ", ".join(f"{v:.3f}" for v in to_mm(point.p_FM))
    sure = "" if std is None else f" ± {', '.join(f'{v:.3f}' for v in to_mm(std))}"
    size = float(to_mm(np.linalg.norm(off)))
    if np.linalg.norm(off) < 0.02:  # [m] farther away a tool is meant to be another one
        yield (
            f"warning: {who} is {size:.3f} mm off the tool point that belongs to this robot ({place}{sure} mm), more "
            f"than its standard deviations allow: if that point is meant, {remedy}"
        )
    else:
        yield (
            f"warning: {who} is another tool ({size:.0f} mm away) than the one that was measured ({place}{sure} mm): "
            "the error stated is that of this tool, and where it sits in the true flange is taken as it is named"
        )
