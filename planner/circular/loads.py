"""The loads under which circles are driven, held against what the robot may carry."""

from planner.cell import Cell
from planner.errors import InputError
from planner.rig import largest_load


def check_loads(cell: Cell) -> None:
    """Refuse circles with a load beyond what the robot may carry beside its tool.

    Raises:
        InputError: with the load, the circle and what is allowed.
    """
    allowed = largest_load(cell)
    if allowed is None:
        return
    for circle in cell.circles:
        if max(circle.loads, default=0.0) > allowed:
            raise InputError(
                f"{cell.path}: circle {circle.name}: loads_N goes up to {max(circle.loads):g} N, but {cell.robot.name} "
                f"may carry {cell.robot.payload:g} kg, {allowed:.0f} N beyond its tool of {cell.tool.mass:g} kg: load "
                "less"
            )


def load_notes(cell: Cell) -> list[str]:
    """Say of loads that give no stiffness, and of a robot that does not say what it carries."""
    notes = [
        f"circle {c.name}: loads_N has {c.loads[0]:g} N only; a stiffness needs two loads at least, better five"
        for c in cell.circles
        if len(set(c.loads)) == 1
    ]
    if any(c.loads for c in cell.circles) and cell.robot.payload is None:
        notes.append(f"{cell.robot.name} has no payload_kg: whether it may carry the loads was not checked")
    return notes
