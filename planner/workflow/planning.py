"""``plan()`` for every kind of gauge."""

from dataclasses import replace

from planner.cell.cell import Cell
from planner.design.free_parameters import check_effects
from planner.session.bar_planning import PlanOptions, Stages
from planner.session.bar_planning import plan_bar as plan_with_bar
from planner.session.option_checks import check_point_options
from planner.session.plan_types import Plan
from planner.session.point_planning import plan_points


def plan(cell: Cell, options: PlanOptions, stages: Stages) -> Plan:
    """Plan a measuring session with a bar, at the balls of an artifact, or for a tracker.

    Raises:
        InputError: the cell or an option is wrong.
        NoSolutionError: a stage has no solution; the message says which.
    """
    check_effects(cell)
    if not cell.gauge.is_attached:
        check_point_options(cell, options)
        return plan_points(cell, options, stages)
    if options.fixtures is None:
        return plan_with_bar(cell, options, stages)
    # matplotlib: other plans start quicker without
    from planner.study.fixture_addition import add_fixtures as with_fixtures
    from planner.study.fixture_addition import describe_added_fixtures as built

    with stages.stage("fixtures"):
        cell = with_fixtures(cell, options.fixtures, options.seed, stages.say)
    made = plan_with_bar(cell, options, stages)
    return replace(made, notes=(*built(cell), *made.notes))
