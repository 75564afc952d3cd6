"""What a page shows of a cell in space, as one document with packed numbers, and of a fixture moved in it."""

from dataclasses import replace
from pathlib import Path

import tomli_w

from planner.cell.cell import Cell
from planner.common.errors import InputError
from planner.common.files import write_text
from planner.common.schema import StrictModel
from planner.common.units import Array, from_mm, to_mm
from planner.design.fixtures.addition import place_fixture
from planner.design.fixtures.places import PlaceForecast, Status, forecast_place
from planner.kinematics.bodies import Vector
from planner.report.cell_view import ViewFrames, carrier_poses, compose_cell_view
from planner.report.scene import SceneView, pack_scene, rounded_point


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
