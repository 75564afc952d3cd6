"""A cell with a fixture at another place, as its page shows it while the fixture is dragged."""

from pathlib import Path

import tomli_w

from planner.cell.cell import Cell
from planner.common.errors import InputError
from planner.common.files import write_text
from planner.common.units import from_mm, to_mm
from planner.design.fixtures.addition import place_fixture
from planner.design.fixtures.forecast import PlaceForecast, forecast_place
from planner.design.fixtures.places import Status
from planner.kinematics.bodies import Vector
from planner.service.job_requests import ServiceModel
from planner.service.views import CellCheck, check_view

WHY: dict[Status, str] = {
    "blocked": "Something else stands there.",
    "unreachable": "The arm does not bring the gauge here within its range.",
    "cones": "At every pose in range the gauge tilts too far in its ball joints.",
    "cable": "At every pose in range the cable twists too far.",
    "colliding": "At every pose in range something collides.",
    "few": "Too few poses can be measured from here.",
}


class FixtureView(ServiceModel):
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
