"""Where the poses of a cell come from, by how its gauge is held."""

from planner.cell.cell import Cell
from planner.session.bar_poses import BarPoses
from planner.session.options import PlanOptions, check_point_options
from planner.session.planning import PoseChooser, PoseSession
from planner.session.point_poses import PointPoses


def pose_session(cell: Cell, options: PlanOptions, chooser: PoseChooser | None = None) -> PoseSession:
    """Return the session of poses of a bar, at the balls of an artifact, or for a tracker.

    Raises:
        InputError: an option is not for this gauge.
    """
    if cell.has_bar():
        return BarPoses(cell, options, chooser)
    check_point_options(cell, options)
    return PointPoses(cell, options, chooser)
