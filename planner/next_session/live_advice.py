"""What is said at the cell after each reading: expected error, how many poses it still takes, which may be passed."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from planner.cell.cell import Cell
from planner.centring.journal import JournalRow
from planner.common.files import write_text
from planner.common.units import from_deg, from_mm, read_only, to_mm
from planner.next_session.live_estimate import LiveEstimate, PoseReading, Progress
from planner.runs.run import Readings
from planner.session.document import PlanDocument

FEWEST_READ = 30  # [lengths] read whatever is expected: an identification wants them for what nobody foresees
HEAD = "pose,t_s,expected_mm,at_most_mm"


@dataclass
class LiveAdvice:
    """The adviser of a session with a bar or wire, or of one that centres a head.

    Validation poses and repeated ones are never chosen by it: they are read as the plan has them, and no estimate sees
    them.

    Attributes:
        estimate: of the poses that calibrate.
        numbers: of these, by their id.
        record: where expected error against poses is written, beside the run.
        rows: of that file.
        times: of the readings in it [s].
    """

    estimate: LiveEstimate
    numbers: dict[int, int]
    record: Path
    rows: list[str] = field(default_factory=list)
    times: list[float] = field(default_factory=list)

    @classmethod
    def of(
        cls, plan: PlanDocument, cell: Cell, run: Path, until: float | None = None, after: Path | None = None
    ) -> "LiveAdvice":
        """Begin the advice for a plan; ``run``: where the readings are written; the rest as of the estimate."""
        poses = [p for p in plan.poses if p.role == "calibrate"]
        place = np.array([m.fixture for m in cell.mountings_of(poses, run)])
        estimate = LiveEstimate.of(cell, from_deg([p.q_deg for p in poses]), place, until, after)
        return cls(estimate, {p.id: k for k, p in enumerate(poses)}, run.with_suffix(".progress.csv"))

    @property
    def fewest_poses(self) -> int:
        """Poses that are read whatever is expected; one that is read in three directions tells as much as two."""
        return FEWEST_READ if self.estimate.width == 1 else FEWEST_READ // 2

    def resume(self, rows: dict[int, tuple[float, float]]) -> None:
        """Take what was read already: by the id of the pose its time [s] and its reading [m]."""
        for pose, (t, length) in rows.items():
            self.take(pose, t, PoseReading.of_length(length))

    def passes(self, pose: int) -> str:
        """Return why the pose of this id need not be read: the goal is reached, or it adds nothing."""
        number = self.numbers.get(pose)
        if number is None or len(self.estimate.read) < self.fewest_poses:
            return ""
        if self.estimate.reached:
            return "the goal is reached"
        others = [k for k in self.estimate.unread_poses() if k != number]
        return "it would add nothing to the others" if self.estimate.adds_nothing(number, others) else ""

    def advise(self, pose: int, t: float, length: float) -> str:
        """Return where the session stands after a reading [m] at a time [s]."""
        return self.say(pose, t, PoseReading.of_length(length))

    def correct(self, rows: Mapping[int, tuple[float, float]]) -> str:
        """Take all readings anew: by the id of the pose its time [s] and its reading [m]; return where it stands."""
        self.estimate = self.estimate.begin_anew()
        read = {self.numbers[k]: PoseReading.of_length(v) for k, (_, v) in rows.items() if k in self.numbers}
        return self._words(self.estimate.add_all(read)) if read else ""

    def say(self, pose: int, t: float, reading: PoseReading) -> str:
        """Take a reading at the pose of this id at a time [s]; return where the session stands."""
        stands = self.take(pose, t, reading)
        if stands is None:
            return "kept out of the estimate"
        write_text(self.record, "\n".join([HEAD, *self.rows]) + "\n", own=True)
        return self._words(stands)

    def take(self, pose: int, t: float, reading: PoseReading) -> Progress | None:
        """Take a reading into the estimate; ``None`` at a pose that it does not see."""
        number = self.numbers.get(pose)
        if number is None:
            return None
        stands = self.estimate.add(number, reading)
        self.rows.append(f"{pose},{t:.3f},{float(to_mm(stands.error)):.4f},{float(to_mm(stands.at_most)):.4f}")
        self.times.append(t)
        return stands

    @property
    def pace(self) -> float:
        """Time of a pose [s]; the median, as between two sessions a night may have passed."""
        return float(np.median(np.diff([0.0, *self.times])))

    def _words(self, stands: Progress) -> str:
        """Say it in one sentence; minutes are those that the poses took so far."""
        said = (
            f"error {float(to_mm(stands.error)):.3f} mm expected, 95 % sure below {float(to_mm(stands.at_most)):.3f} mm"
        )
        # 5.0: standard deviations from what was expected of a reading: the pose or the zero is wrong
        if stands.surprise > 5.0 and len(self.estimate.read) > self.fewest_poses:
            said += f"; this reading is {stands.surprise:.0f} sigma from what was expected: read it again"
        if self.estimate.until is None:
            return said
        goal = f"{float(to_mm(self.estimate.until)):.3g} mm"
        if self.estimate.reached:
            return f"{said}: {goal} is reached"
        further = "plan on with edbb plan --after" if self.estimate.width == 1 else "it takes a plan of more poses"
        left = len(self.estimate.unread_poses()) if stands.more is None else stands.more
        if not left:
            return f"{said}; no pose is left and {goal} is not reached: {further}"
        minutes = left * self.pace / 60.0
        poses = "1 more pose" if left == 1 else f"{left} more poses"
        lasting = f"about {minutes:.0f} min" if round(minutes) else "less than a minute"
        more = f"{poses}, {lasting}, would bring {float(to_mm(stands.then)):.3f} mm"
        if stands.more is None:
            limit = f"95 % sure below {float(to_mm(stands.then_at_most)):.3f} mm"
            return f"{said}; {more}, {limit} and not {goal}: then {further}"
        return f"{said}; {more}"


@dataclass
class CentringAdvice:
    """The adviser of a session that centres a head on balls.

    Attributes:
        advice: of its poses.
        balls: names of the artifact's balls, in their order.
    """

    advice: LiveAdvice
    balls: tuple[str, ...]

    @classmethod
    def of(
        cls, plan: PlanDocument, cell: Cell, run: Path, until: float | None = None, after: Path | None = None
    ) -> "CentringAdvice":
        """Begin the advice for a plan; see :meth:`LiveAdvice.of`."""
        return cls(LiveAdvice.of(plan, cell, run, until, after), tuple(b.name for b in cell.balls))

    def resume(self, rows: list[JournalRow]) -> None:
        """Take what was centred already."""
        for row in rows:
            self.advice.take(row.pose, row.t_s, self.reading(row))

    def passes(self, pose: int) -> str:
        """Return why the pose of this id need not be centred."""
        return self.advice.passes(pose)

    def advise(self, row: JournalRow) -> str:
        """Return where the session stands after a ball."""
        return self.advice.say(row.pose, row.t_s, self.reading(row))

    def reading(self, row: JournalRow) -> PoseReading:
        """Return the reading of a pose from its row of the journal."""
        ball = np.array([self.balls.index(row.ball)])
        offset = read_only(from_mm(np.array([row.offset_mm])))
        return PoseReading(Readings(ball=ball, offset=offset), read_only(from_deg(row.q_deg)))
