"""What a limit of time leaves of a plan whose path it cut: the poses and their certificate, no path and no program."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np

from planner.cell.cell import Cell
from planner.common.errors import NoSolutionError
from planner.design.candidates.pool import PoseSet
from planner.design.pose_selection import PoseChoice
from planner.design.selection.certificate import Certificate
from planner.session.plan_record import observability_record, round_numbers
from planner.session.plan_types import Visit

SCHEMA = "edbb-poses/1"


@dataclass(frozen=True)
class UnprovenPoses:
    """Chosen poses that no proven path joins.

    Attributes:
        cell: the cell; its mount poses are settled.
        seed: of the plan.
        pool: candidates.
        choice: the poses.
        certificate: no set of candidates and of the poses as chosen beats its value.
        notes: what a person must know.
        why: what was not proven, and what would help.
    """

    cell: Cell
    seed: int
    pool: PoseSet
    choice: PoseChoice
    certificate: Certificate
    notes: tuple[str, ...]
    why: str

    def record(self) -> Mapping[str, object]:
        """Return what ``plan.json`` says: its schema is that of poses, and no command takes it for a plan."""
        content: dict[str, object] = {
            "schema": SCHEMA,
            "robot": self.cell.robot.name,
            "cell": self.cell.name,
            "seed": self.seed,
            "not_proven": self.why,
            "parameters": list(self.choice.seen.names),
            "dropped": [{"name": d.name, "because": d.because} for d in self.choice.seen.dropped],
            "funnel": asdict(self.pool.funnel),
            "poses": [self._pose(k) for k in range(len(self.choice.q))],
            "observability": observability_record(self.choice, self.certificate),
            "notes": list(self.notes),
        }
        return {key: round_numbers(value) for key, value in content.items()}

    def _pose(self, k: int) -> dict[str, object]:
        q, mounting, ball = self.choice.q[k], self.choice.samples.mounting(k), self.choice.ball
        length = float(self.cell.bar_length(q[None], mounting)[0])
        visit = Visit(k, q, length, mounting, "calibrate", (0,) * len(q), ball=-1 if ball is None else int(ball[k]))
        return {"id": k, "q_deg": np.rad2deg(q), **self.cell.gauge.visit_record(self.cell, visit)}


class PathNotProvenError(NoSolutionError):
    """The limit of time was over before a path was proven; ``poses`` is what there is."""

    def __init__(self, poses: UnprovenPoses) -> None:
        super().__init__(poses.why)
        self.poses = poses
