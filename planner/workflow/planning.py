"""``plan()``: the plan of a cell, whatever its gauge."""

from dataclasses import replace

from planner.cell.cell import Cell
from planner.common.progress import Stages
from planner.design.free_parameters import check_effects
from planner.session.bar_poses import BarPoses
from planner.session.options import PlanOptions, check_point_options
from planner.session.plan_types import Plan
from planner.session.planning import plan_session
from planner.session.point_poses import PointPoses


def plan(cell: Cell, options: PlanOptions, stages: Stages) -> Plan:
    """Plan a measuring session with a bar, at the balls of an artifact, or for a tracker.

    Raises:
        InputError: the cell or an option is wrong.
        NoSolutionError: a stage has no solution; the message says which.
    """
    check_effects(cell)
    if not cell.gauge.is_attached:
        check_point_options(cell, options)
        return plan_session(PointPoses(cell, options), options, stages)
    if options.fixtures is None:
        return plan_session(BarPoses(cell, options), options, stages)
    from planner.study.fixture_addition import add_fixtures, describe_added_fixtures

    with stages.stage("fixtures"):
        cell = add_fixtures(cell, options.fixtures, options.seed, stages.say)
    made = plan_session(BarPoses(cell, options), options, stages)
    return replace(made, notes=(*describe_added_fixtures(cell), *made.notes))
