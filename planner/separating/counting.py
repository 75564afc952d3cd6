"""How many poses at rest it takes before an identification looks for causes at all."""

from planner.candidates import PoseSet
from planner.cell import Cell
from planner.choice import what_is_seen

TRACEABLE = 20  # readings beyond the parameters, below which an identification traces nothing
EFFECTS = 10  # readings more, for the effects' own parameters and poses that are lost


def enough(cell: Cell, pool: PoseSet) -> int | None:
    """Number of poses where nobody gives one; ``None`` for a run in motion, which has readings in plenty."""
    if cell.motion.measure != "static":
        return None
    model, seen, _ = what_is_seen(cell, pool)
    return min(len(pool), -(-(seen.rank + TRACEABLE + EFFECTS) // model.width))


def scarce(readings: int, parameters: int) -> str | None:
    """Say that so few readings will not be traced, or nothing."""
    if readings - parameters >= TRACEABLE:
        return None
    return (
        f"{readings} readings for {parameters} parameters and the effects beside them: an identification of this run "
        f"alone traces nothing; ask for at least {parameters + TRACEABLE + EFFECTS} readings (--poses), or identify it "
        "together with the run before"
    )
