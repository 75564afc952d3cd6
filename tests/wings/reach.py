"""A command that the planner does not ship: how far the tool point comes from the base, over random joint angles."""

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import Annotated, Any

from planner.cell.declared import CellWord
from planner.common.calls import Call, Option, ProgressKeyword, Seed, called_with
from planner.common.commands import register_call, register_names
from planner.common.progress import no_progress
from planner.common.result import FolderResult
from planner.common.summary import Summary


@dataclass(frozen=True)
class ReachCall(Call):
    """Say how far the tool point of a cell comes from the base of the robot."""

    verb = "reach"
    line = "Say how far the tool point comes from the base."
    function = f"{__name__}:reach"

    cell: CellWord
    _: KW_ONLY
    states: Annotated[int, Option("random states that are tried", min=1, max=1_000_000)] = 10_000
    seed: Seed = 0
    progress: ProgressKeyword = no_progress


@dataclass(frozen=True)
class ReachResult(FolderResult):
    """The farthest and the nearest that the tool point came to the base [m]."""

    main_file = "reach.json"
    name: str
    farthest: float
    nearest: float

    def overview(self) -> Summary:
        """Return both, each in a line."""
        facts = [
            ("farthest", f"{1e3 * self.farthest:.0f} mm from the base"),
            ("nearest", f"{1e3 * self.nearest:.0f} mm"),
        ]
        return Summary(f"{self.name}: reach of the tool point", facts)

    def content(self) -> Mapping[str, Any]:
        """Return what ``reach.json`` says."""
        return {"cell": self.name, "farthest_mm": 1e3 * self.farthest, "nearest_mm": 1e3 * self.nearest}

    def fill(self, draft: Path) -> None:
        """Nothing lies beside ``reach.json``."""


@called_with(ReachCall)
def reach(asked: ReachCall) -> ReachResult:
    """Return how far the tool point of a cell comes from the base of the robot.

    Raises:
        InputError: the cell is wrong.
    """
    import numpy as np

    from planner.cell.reading import load_cell

    cell = load_cell(str(asked.cell))
    robot, rng = cell.robot, np.random.default_rng(asked.seed)
    q = rng.uniform(robot.q_lower, robot.q_upper, (asked.states, robot.n_joints))
    distance = np.linalg.norm(cell.map_position(q), axis=1)
    return ReachResult(cell.name, float(distance.max()), float(distance.min()))


register_call(ReachCall)
register_names(__name__, "reach", "ReachResult")
