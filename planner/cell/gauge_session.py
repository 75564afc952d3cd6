"""What a person does with a gauge, and the words in which plans, programs and reports speak of it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from planner.cell.file import CellFile
from planner.cell.gauge_types import PlannedVisit, RecordedPose, SessionGuide
from planner.cell.parts import IndicatorHead
from planner.cell.site import Site
from planner.common.errors import InputError
from planner.common.units import Array
from planner.runs.run import Mounting, Run, Samples


@dataclass(frozen=True, kw_only=True)
class GaugeSession:
    """A session with a gauge.

    Attributes:
        head: indicators that are centred on balls, where it has them.
    """

    head: IndicatorHead | None = None

    kind: ClassVar[str]  # in cell files
    columns: ClassVar[str]  # of a run that hold its readings
    noun: ClassVar[str] = "gauge"  # what reports and messages call it
    pose_columns: ClassVar[tuple[str, str]] = ("place", "reading (mm)")  # of a table of poses: where, and a figure
    removal: ClassVar[str] = ""  # what a person does after the last pose

    @property
    def measuring_command(self) -> str:
        """How the session of a plan is measured; ``PLAN`` stands for its path."""
        return "run the program and log it (to try it: edbb simulate PLAN -o run.csv)"

    @property
    def indicators(self) -> IndicatorHead:
        """Return the head of indicators, for what only such a head can do.

        Raises:
            InputError: there is none.
        """
        if self.head is None:
            raise InputError(f"a gauge '{self.kind}' has no head of indicators, which this needs")
        return self.head

    def mastered_reading(self, cell: Site) -> float | None:
        """Return the indicators' readings at the master ball [m]; ``None`` where nothing is mastered."""
        return None

    def ball_to_centre(self, cell: Site, q: Array) -> int | None:
        """Return which ball is centred at q (N,) [rad]; ``None`` where no ball is."""
        return None

    def centring_warnings(self, cell: Site, planned: Samples, run: Run) -> tuple[str, ...]:
        """Say how many poses of a simulated run were met further off than the gauge can read."""
        return ()

    def preparation(self, cell: Site, mounting: Mounting) -> tuple[str, str]:
        """Return the instructions to a person before the first pose, an explanation (may be empty) and an action."""
        return "", "set the gauge to zero"

    def session_names(self, cell: Site, mounting: Mounting) -> tuple[str, str]:
        """Return the words for the place where a session starts, and for what it measures from there."""
        return "where the session starts", "measuring"

    def seating_step(self, cell: Site, q: Array) -> str:
        """Return the instruction to a person at a pose q (N,) [rad] before it is read; empty where there is none."""
        return ""

    def start_states(self, q: Array) -> Array | None:
        """Return the states (n, N) [rad] among which a session starts; ``None``: where the tool's axis points up."""
        return q

    def plan_errors(self, cell: Site, poses: Sequence[RecordedPose], plan: Path) -> Array:
        """Return by how much each pose misses what the plan at ``plan`` says of it, (n,) [mm]."""
        return np.zeros(len(poses))

    def plan_error_text(self, pose: int, error: float) -> str:
        """Say by how many millimetres the pose with this id misses what the gauge holds it to."""
        return f"pose {pose} is {error:.3f} mm off its ball"

    @classmethod
    def session_guide(cls, file: CellFile) -> SessionGuide:
        """Return the steps that a person at the cell takes with the gauge."""
        return SessionGuide(f"the gauge's reading ({cls.columns})")

    def describe(self, cell: Site) -> str:
        """Say what stands where, for the heading of a report."""
        return self.kind

    def visit_cells(self, cell: Site, visit: PlannedVisit) -> tuple[str, str]:
        """Return where a pose is measured and its figure, under ``pose_columns``."""
        return cell.place_name(visit.mounting), ""

    def length_text(self, length: float) -> str:
        """Say a planned length [m] where it is what the gauge reads, else nothing."""
        return ""

    def visit_record(self, cell: Site, visit: PlannedVisit) -> dict[str, object]:
        """Return the keys of a pose in ``plan.json`` beside its angles: the gauge's place, if it has a name."""
        return cell.place_record(visit.mounting) if cell.names_of(visit.mounting)[0] else {}

    def path_facts(self, shortest: float, longest: float) -> tuple[tuple[str, str], ...]:
        """Say the lengths [m] along a path, where they matter: (what, value)."""
        return ()
