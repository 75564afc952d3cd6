"""What the service itself computes for its pages, in the process of a job: checks and views of cells, runs and plans.

Run in the folder of a job, with the words of the job's command; a failure ends as one of ``edbb`` does.

What a page shows of a cell in space, as one document with packed numbers, and of a fixture moved in it.
"""

import shutil
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import tomli_w
from pydantic import BaseModel, Field

from planner import load_cell, load_run
from planner.cell.cell import Cell
from planner.circular.document import is_circular, load_circular_plan
from planner.circular.plan import CircularPlan
from planner.common.errors import InputError, PlannerError
from planner.common.files import write_text
from planner.common.schema import StrictModel
from planner.common.units import Array, from_mm, to_deg, to_mm
from planner.design.fixtures.addition import place_fixture
from planner.design.fixtures.places import PlaceForecast, Status, forecast_place
from planner.kinematics.bodies import Vector
from planner.motion.collision.surroundings import check_surroundings
from planner.report.cell_view import (
    ShownMotion,
    ViewFrames,
    ViewPose,
    carrier_poses,
    compose_cell_view,
    tool_points,
    view_session,
)
from planner.report.scene import SceneView, pack_scene, rounded_point
from planner.runs.run import Run
from planner.session.document import read_plan
from planner.session.plan_types import Course
from planner.session.planned_session import PlannedSession, load_session


class CellFact(StrictModel):
    """A line of a table."""

    what: str
    value: str


class FixtureSpot(StrictModel):
    """A fixture that may be moved."""

    name: str
    position_mm: tuple[float, float, float]


class CellCheck(StrictModel):
    """A cell that can be planned for; ``fixtures`` of a bar."""

    title: str
    facts: list[CellFact]
    view: SceneView
    fixtures: list[FixtureSpot]


def check_view(cell: Cell) -> CellCheck:
    """Return the view of a cell before it is planned: the robot at home."""
    frames = ViewFrames(carrier_poses(cell, cell.mountings[0], cell.home[None]), ("home",))
    view = compose_cell_view(cell, frames)
    held = cell.gauge.noun if cell.has_bar() else None  # at home it is not attached
    view = replace(view, moving=tuple(m for m in view.moving if m.name != held))
    gauge = cell.gauge.describe(cell)
    tool = ", ".join(f"{v:g}" for v in to_mm(cell.tool.p_FM))
    facts = [
        ("robot", cell.robot.title or cell.robot.name),
        ("gauge", gauge),
        *((f"fixture {f.name}", f"{_vector_text(f.p_BX)} mm") for f in cell.fixtures if cell.has_bar()),
        ("measured point", f"{tool} mm in the flange"),
        ("obstacles", str(len(cell.obstacles))),
        ("home", ", ".join(cell.robot.joint_text(j, v, ".1f") for j, v in enumerate(cell.home))),
    ]
    movable = cell.fixtures if cell.has_bar(free=True) else ()
    return CellCheck(
        title=cell.name,
        facts=[CellFact(what=w, value=v) for w, v in facts],
        view=pack_scene(view),
        fixtures=[FixtureSpot(name=f.name or "A", position_mm=rounded_point(to_mm(f.p_BX))) for f in movable],
    )


def _vector_text(p: Array) -> str:
    return f"[{', '.join(f'{v:.0f}' for v in to_mm(p))}]"


WHY: dict[Status, str] = {
    "blocked": "Something else stands there.",
    "unreachable": "The arm does not bring the gauge here within its range.",
    "cones": "At every pose in range the gauge tilts too far in its ball joints.",
    "cable": "At every pose in range the cable twists too far.",
    "colliding": "At every pose in range something collides.",
    "few": "Too few poses can be measured from here.",
}


class FixtureView(StrictModel):
    """The cell with the fixture there, and what to expect of that fixture alone.

    ``share`` of the arm's states can be measured from there; errors are of the tool over the workspace, before anything
    is measured and after ``poses`` poses; none where ``problem`` says why it is no place. ``cell.toml`` lies beside.
    """

    check: CellCheck
    problem: str
    share: float
    poses: int
    before_mm: float | None
    error_mm: float | None


def view_fixture(cell: Cell, which: int, position_mm: Vector, folder: Path) -> FixtureView:
    """Return the view, and write the cell as it would be to ``folder``.

    Raises:
        InputError: the gauge hangs at no fixture of that number, or the cell contradicts itself then.
    """
    cell.require_bar("a fixture is moved for a bar", free=True)
    if which >= len(cell.fixtures):
        raise InputError(f"{cell.path}: there is no fixture number {which}; it has {len(cell.fixtures)}, from 0")
    found = forecast_place(cell, which, from_mm(position_mm))
    moved = place_fixture(cell, which, position_mm)
    write_text(
        folder / "cell.toml", tomli_w.dumps(moved.file.model_dump(mode="json", by_alias=True, exclude_none=True))
    )
    return FixtureView(
        check=check_view(moved),
        problem=WHY.get(found.status, ""),
        share=found.share,
        poses=found.poses,
        **_errors_mm(found),
    )


def _errors_mm(found: PlaceForecast) -> dict[str, float | None]:
    usable = found.status == "usable"
    return {
        f"{n}_mm": float(to_mm(v)) if usable else None for n, v in (("before", found.before), ("error", found.error))
    }


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
