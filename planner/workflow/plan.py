"""``plan()`` for every kind of gauge."""

from dataclasses import replace

from planner.cell import Cell
from planner.freed import check_effects
from planner.plan import Plan
from planner.workflow.asked import check_for_points
from planner.workflow.planning import Options, Stages
from planner.workflow.planning import plan as plan_with_bar
from planner.workflow.point_planning import plan_points


def plan(cell: Cell, options: Options, stages: Stages) -> Plan:
    """Plan a measuring session with a bar, at the balls of an artifact, or for a tracker.

    Raises:
        InputError: the cell or an option is wrong.
        NoSolutionError: a stage has no solution; the message says which.
    """
    check_effects(cell)
    if not cell.gauge.is_bar:
        check_for_points(cell, options)
        return plan_points(cell, options, stages)
    if options.fixtures is None:
        return plan_with_bar(cell, options, stages)
    from planner.study.adding import built, with_fixtures  # matplotlib: other plans start quicker without

    with stages.stage("fixtures"):
        cell = with_fixtures(cell, options.fixtures, options.seed, stages.say)
    made = plan_with_bar(cell, options, stages)
    return replace(made, notes=(*built(cell), *made.notes))
