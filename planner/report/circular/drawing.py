"""Pictures of a planned circle."""

from planner.cell import Cell
from planner.circular import Arc
from planner.report.picture import JOINTS, Limit, Panel, Picture, Series
from planner.units import to_deg, to_mm

ANGLE = "angle on the circle (deg)"


def arc_picture(cell: Cell, arc: Arc, number: int) -> Picture:
    """Joint angles and speeds over the circle's angle; the sweep that is measured lies between the dotted lines."""
    c, angle = arc.circle, to_deg(arc.angle)
    span = (float(angle[0]), float(angle[-1]))
    ends = (
        Limit(float(to_deg(c.start)), "sweep", upright=True),
        Limit(float(to_deg(c.start + c.sweep)), "", upright=True),
    )
    motion = arc.trajectory.at(arc.trajectory.waypoint_time)
    axes = tuple(
        Series(f"joint {j + 1}", angle, to_deg(q), JOINTS[j % len(JOINTS)], width=1.2) for j, q in enumerate(arc.q.T)
    )
    speeds = tuple(
        Series(f"joint {j + 1}", angle, to_deg(v), JOINTS[j % len(JOINTS)], width=1.2)
        for j, v in enumerate(motion.dq.T)
    )
    tool = (Series("", angle, to_mm(motion.tool_speed), "#555555"),)
    return Picture(
        f"circle_{number + 1}",
        f"Circle {c.name}: the axes along it",
        "Where the speed of a joint crosses zero it reverses: there backlash and friction show.",
        (
            Panel("Joint angles", ANGLE, "joint angle (deg)", axes, limits=ends, x_range=span, height=280),
            Panel("Speed of the joints, ccw", ANGLE, "speed (deg/s)", speeds, limits=ends, x_range=span, height=240),
            Panel("Speed of the tool point, ccw", ANGLE, "speed (mm/s)", tool, limits=ends, x_range=span, height=160),
        ),
    )
