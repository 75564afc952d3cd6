"""Options that a plan of some kind has no use for: they are refused, not passed over."""

from planner.cell.cell import Cell
from planner.common.errors import InputError
from planner.session.bar_planning import PlanOptions


def check_circle_options(cell: Cell, options: PlanOptions) -> None:
    """Check that nothing is asked of a circular test that only a choice of poses can give.

    Raises:
        InputError: with the options to leave out.
    """
    asked = (
        ("--poses", options.poses is not None),
        ("--index", options.index is not None),
        ("--separate", options.separate is not None),
        ("--fixtures", options.fixtures is not None),
        ("--aim", options.aim is not None),
    )
    given = ", ".join(name for name, is_ in asked if is_)
    if given:
        raise InputError(f"{cell.path}: a circular test has no poses to be chosen; leave out {given}")


def check_point_options(cell: Cell, options: PlanOptions) -> None:
    """Check that nothing is asked of a plan for balls or a tracker that only the poses of a bar can give.

    Raises:
        InputError: with the option to leave out.
    """
    if options.fixtures is not None:
        raise InputError(f"{cell.path}: --fixtures is for a bar, the gauge here is '{cell.gauge.kind}'; leave it out")
    if (options.aim or cell.plan.aim) == "tracing":
        raise InputError(
            f"{cell.path}: the aim 'tracing' is for a bar, the gauge here is '{cell.gauge.kind}'; leave it out"
        )
    if options.separate is not None:
        raise InputError(
            f"{cell.path}: --separate chooses the poses of a bar, the gauge here is '{cell.gauge.kind}'; leave it out, "
            "or measure with a bar what the identification left open"
        )
