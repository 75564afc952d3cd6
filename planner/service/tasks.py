"""What the service itself computes for its pages, in the process of a job: checks and views of cells, runs and plans.

Run in the folder of a job, with the words of the job's command; a failure ends as one of ``edbb`` does.
"""

import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from pydantic import BaseModel, Field

from planner import load_cell, load_run
from planner.cell.cell import Cell
from planner.circular.document import is_circular, load_circular_plan
from planner.circular.plan import CircularPlan
from planner.common.errors import InputError, PlannerError
from planner.common.schema import StrictModel
from planner.common.units import Array, to_deg, to_mm
from planner.motion.collision.surroundings import check_surroundings
from planner.report.cell_view import ShownMotion, ViewPose, tool_points, view_session
from planner.report.scene import SceneView, pack_scene
from planner.runs.run import Run
from planner.service.views import check_view, view_fixture
from planner.session.course import Course
from planner.session.document import read_plan
from planner.session.planned_session import PlannedSession, load_session


class RunSeries(StrictModel):
    """One quantity of a run, thinned."""

    name: str
    unit: str
    values: list[float | None]


class RunCheck(StrictModel):
    """What a run holds."""

    samples: int
    sessions: int
    kind: str
    plan_id: str | None
    robot: str | None
    simulated: bool
    duration_s: float | None
    at: list[float] = Field(description="time [s], or number of the sample where there is no clock")
    series: list[RunSeries]
    warnings: list[str]


def check_run(paths: Sequence[Path], cell: Cell) -> RunCheck:
    """Return what is in measured runs of the robot of ``cell``.

    Raises:
        InputError: they cannot be read, or are not of its gauge.
    """
    runs = [load_run(p, cell.robot.n_joints, cell.robot.axes_of) for p in paths]
    for run in runs:
        cell.gauge.check_run(cell, run)
    first, samples = runs[0], sum(len(r) for r in runs)
    s = first.samples
    shown = np.unique(np.linspace(0, len(first) - 1, min(600, len(first))).astype(int))  # samples shown
    at = s.t[shown] if s.t is not None else shown.astype(float)
    return RunCheck(
        samples=samples,
        sessions=sum(1 if r.samples.session is None else len(np.unique(r.samples.session)) for r in runs),
        kind="continuous" if first.continuous else "poses at rest",
        plan_id=first.plan_id,
        robot=first.robot,
        simulated=any(r.simulated for r in runs),
        duration_s=None if s.t is None else float(s.t.max() - s.t.min()),
        at=[float(v) for v in at],
        series=_series(first, shown),
        warnings=[w for r in runs for w in r.warnings],
    )


def _series(run: Run, shown: Array) -> list[RunSeries]:
    s, r = run.samples, run.readings
    units = ["mm" if k in run.slides else "deg" for k in range(1, s.q.shape[1] + 1)]
    columns = [(f"axis {k}", unit, to_deg(q)) for k, (unit, q) in enumerate(zip(units, s.q.T, strict=True), start=1)]
    if r.length is not None:
        columns.insert(0, ("length", "mm", to_mm(r.length)))
    if r.position is not None:
        columns = [(x, "mm", to_mm(r.position[:, k])) for k, x in enumerate("xyz")] + columns
    if s.temperature is not None:
        columns.append(("temperature", "°C", s.temperature))
    return [
        RunSeries(name=n, unit=u, values=[float(x) if np.isfinite(x) else None for x in v[shown]])
        for n, u, v in columns
    ]


def plan_view(path: Path) -> SceneView:
    """Return the view of the plan at ``path``: the robot along its way, and all poses."""
    session = _load_plan(path, "shown")
    cell, courses = session.cell, session.courses
    # 360: frames of the view, shared by the courses
    shown = [_show_course(cell, c, max(2, 360 // len(courses))) for c in courses]
    return pack_scene(view_session(cell, courses, shown, _spots(cell, courses, path), way_step=0.1))


def _show_course(cell: Cell, course: Course, count: int) -> ShownMotion:
    trajectory = course.trajectory
    t = np.linspace(0.0, trajectory.duration_s, count)
    where = f"{cell.place_name(course.mounting)}   " if len(cell.mountings) > 1 else ""
    told = [f"{where}{int(s) // 60}:{int(s) % 60:02d} min" for s in t]
    path = trajectory.at(np.linspace(0.0, trajectory.duration_s, 1500)).q  # points of a path
    return ShownMotion(course.mounting, trajectory.at(t).q, told, path)


def _spots(cell: Cell, courses: Sequence[Course], path: Path) -> tuple[ViewPose, ...]:
    if is_circular(path):
        return ()
    roles = {p.id: p.role for p in read_plan(path, "poses").poses}
    spots = dict[int, ViewPose]()
    for c in courses:
        way = c.measuring
        for q, visit in zip(way.q, way.visit, strict=True):
            if visit >= 0 and int(visit) not in spots:
                role = roles.get(int(visit), "mount")
                position = tool_points(cell, c.mounting, q[None])[0]
                spots[int(visit)] = ViewPose(position, role, f"pose {int(visit)}, {role}")
    return tuple(spots.values())


def _load_plan(path: Path, purpose: str, check: bool = False) -> PlannedSession | CircularPlan:
    """Read the plan at ``path``, of a circle or of poses; ``purpose`` and ``check`` as of :func:`load_session`."""
    return load_circular_plan(path) if is_circular(path) else load_session(path, purpose, check=check)


def take_plan(path: Path, to: Path) -> None:
    """Copy the folder of a plan, once it is known that plan and cell belong together.

    Raises:
        InputError: they do not, or one of them is missing.
    """
    _load_plan(path, "taken", check=True)
    shutil.copytree(path.parent, to, dirs_exist_ok=True)


RESULT = Path("out/view.json")


def run_task(words: list[str]) -> BaseModel | None:
    """Run the task that these words name, and return its result; nothing where it has written files itself.

    Raises:
        InputError: the cell, the plan or the run is wrong.
    """
    match words:
        case ["run-check", name, *runs]:
            return check_run(list(map(Path, runs)), load_cell(name, planning=False))
        case ["cell-check", name]:
            cell = load_cell(name)
            check_surroundings(cell)
            return check_view(cell)
        case ["fixture-view", name, fixture, x, y, z]:
            return view_fixture(load_cell(name), int(fixture), (float(x), float(y), float(z)), RESULT.parent)
        case ["plan-view", plan]:
            return plan_view(Path(plan))
        case ["plan-upload", plan]:
            take_plan(Path(plan), RESULT.parent)
            return None
    raise InputError(f"there is no task '{' '.join(words)}'")


def main() -> None:
    """Run the task, and write what it found."""
    try:
        found = run_task(sys.argv[1:])
        if found is not None:
            RESULT.parent.mkdir(exist_ok=True)
            RESULT.write_text(found.model_dump_json(), encoding="utf-8")
    except PlannerError as err:
        sys.stderr.write(f"edbb: {err}\n")
        raise SystemExit(err.exit_code) from err


if __name__ == "__main__":
    main()
