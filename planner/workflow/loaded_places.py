"""``study_places()``: where loaded circles tell the compliances apart, and a cell that drives them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from planner.cell.cell import Cell
from planner.cell.file import CellFile
from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.common.files import draft_folder, move_all, write_bytes, write_text
from planner.common.progress import Stages
from planner.common.result import Result
from planner.common.schema import validate
from planner.common.units import Array, from_deg, from_mm, to_mm
from planner.instruments.loaded.results import share_text
from planner.session.document import read_plan
from planner.studies.compliance_design.circle_candidates import CirclePlace, own_circle
from planner.studies.compliance_design.common_fit import CommonFit, predict_common_fit
from planner.studies.compliance_design.place_selection import CirclePlaceChoice, study_circle_places
from planner.studies.compliance_design.results import describe_places, places_content, places_csv, places_text
from planner.workflow.writing import cell_text

MOST = 6
FITTED = ("calibrate", "repeat")  # roles of the poses that a fit sees


@dataclass(frozen=True)
class CirclePlacesResult(Result):
    """Where loaded circles tell the compliances apart.

    Attributes:
        cell: with the circle as it was given.
        found: the places.
        count: how many of them the written cell has.
        both: what the best of them and poses without load would know in one fit, where that was asked.
    """

    cell: Cell
    found: CirclePlaceChoice
    count: int
    both: CommonFit | None = None
    stages: Stages = field(default_factory=Stages)

    def summary(self) -> str:
        """Return which places there are and what they tell."""
        lines = [f"{self.cell.name}: {len(self.found.pool)} places can be driven"]
        lines += [f"  {s}" for s in describe_places(self.found)]
        for name, unloaded, loaded, together in () if self.both is None else self.both.of("compliance"):
            lines.append(
                f"  {name}: without load {share_text(unloaded)}, the {self.count} circles {share_text(loaded)}, in one "
                f"fit {share_text(together)} of its prior size"
            )
        return "\n".join(lines)

    def content(self) -> Mapping[str, Any]:
        """Return what ``places.json`` says."""
        return places_content(self.found, self.cell.robot.name, self.both)

    def write(self, folder: Path | str) -> list[Path]:
        """Write ``places.json``, ``places.csv``, the pictures, and ``cell.toml`` with the best circles."""
        return write_places(self.cell, self.found, self.count, Path(folder), self.stages, self.both)

    def files(self, folder: Path) -> str:
        """Name what is written."""
        return "places.json, places.csv, cell.toml, pictures"


def study_places(cell: str, count: int, seed: int, stages: Stages, plan: Path | None = None) -> CirclePlacesResult:
    """Study the places of a cell's loaded circle; with a ``plan`` without load also what one fit of both would know.

    Raises:
        InputError: the cell has no circle under load, or so many places make no sense.
        NoSolutionError: no circle can be followed, or fewer places than asked for.
    """
    where = load_cell(cell)
    with stages.stage("places"):
        found = study_circle_places(where, max(count, MOST), seed)
    if count > len(found.sets):
        raise InputError(f"{count} places were asked for, but only {len(found.sets)} circles can be followed")
    both = None if plan is None else predict_beside_plan(where, found, count, plan)
    return CirclePlacesResult(where, found, count, both, stages)


@dataclass(frozen=True)
class UnloadedPoses:
    """Poses of a plan without load: its cell, controller angles q (n, N) [rad], fixture of each (n,) int."""

    cell: Cell
    q: Array
    fixture: np.ndarray


def load_unloaded_poses(plan: Path) -> UnloadedPoses:
    """Read what a plan without load measures for the fit: mounting and validation poses left out.

    Raises:
        InputError: the plan or its cell.toml is wrong, or they do not belong together.
    """
    poses = [p for p in read_plan(plan).poses if p.role in FITTED]
    if not poses:
        raise InputError(f"{plan}: has no poses to calibrate by; a plan of a bar without load is needed here")
    free = load_cell(str(plan.parent / "cell.toml"))
    places = [(f.name, free.point_name(k)) for k, f in enumerate(free.fixtures)]
    unknown = sorted({(p.fixture, p.point) for p in poses} - set(places))
    if unknown:
        name, point = unknown[0]
        where = f"'{name}'" + (f", tool point '{point}'" if point else "")
        raise InputError(f"{plan}: measures at fixture {where}, which {free.path} does not have")
    which = np.array([places.index((p.fixture, p.point)) for p in poses])
    return UnloadedPoses(free, from_deg([p.q_deg for p in poses]), which)


def predict_beside_plan(cell: Cell, found: CirclePlaceChoice, count: int, plan: Path) -> CommonFit:
    """Predict what the best ``count`` circles and the poses of a plan without load know in one fit.

    Raises:
        InputError: the plan or its cell.toml is wrong, or of another robot.
    """
    free = load_unloaded_poses(plan)
    return predict_common_fit(
        free.cell, free.q, free.fixture, cell, [found.pool[int(i)] for i in found.sets[count - 1]]
    )


def write_places(
    cell: Cell, found: CirclePlaceChoice, count: int, folder: Path, stages: Stages, both: CommonFit | None = None
) -> list[Path]:
    """Write ``places.json``, ``places.csv``, the pictures, and ``cell.toml`` with the best ``count`` circles."""
    from planner.report.matplotlib_backend import chart_png as picture_png

    # plotting: other commands start quicker without
    from planner.studies.compliance_design.pictures import draw_places as place_pictures

    with draft_folder(folder) as draft, stages.stage("report"):
        write_text(draft / "places.json", places_text(found, cell.robot.name, both))
        write_text(draft / "places.csv", places_csv(found))
        write_text(draft / "cell.toml", cell_text(with_places(cell, found, count), draft))
        (draft / "pictures").mkdir()
        for picture in place_pictures(found, count):
            write_bytes(draft / "pictures" / f"{picture.name}.png", picture_png(picture))
        return move_all(draft, folder)


def with_places(cell: Cell, found: CirclePlaceChoice, count: int) -> Cell:
    """Return the cell with the fixtures and circles of the best set of ``count`` places."""
    return with_circles(cell, [found.pool[int(i)] for i in found.sets[count - 1]])


def with_circles(cell: Cell, places: Sequence[CirclePlace]) -> Cell:
    """Return the cell with fixtures and circles P1 … at these places, each driven and loaded as the cell's own."""
    content = cell.file.model_dump(mode="json", by_alias=True, exclude_none=True)
    own = own_circle(cell)
    fixture, circle = content["fixtures"][own.fixture], content["circles"][0]
    fixture.pop("mount_deg", None)
    circle.pop("start_deg", None)
    names = [f"P{k + 1}" for k in range(len(places))]
    content["fixtures"] = [
        {**fixture, "name": n, "position_mm": _mm(p.p_BX), "axis": np.round(p.axis_B, 6).tolist()}
        for n, p in zip(names, places, strict=True)
    ]
    content["circles"] = [
        {**circle, "name": n, "fixture": n, "plane": p.plane, "centre_mm": _mm(p.centre), "tool_axis": _tool_axis(p)}
        for n, p in zip(names, places, strict=True)
    ]
    fixtures = [
        replace(cell.fixtures[own.fixture], name=n, p_BX=from_mm(_mm(p.p_BX)), axis_B=p.axis_B, mount=None)
        for n, p in zip(names, places, strict=True)
    ]
    circles = [
        replace(own, name=n, fixture=k, plane=p.plane, p_BC=from_mm(_mm(p.centre)), start=0.0, axis_B=-p.axis_B)
        for k, (n, p) in enumerate(zip(names, places, strict=True))
    ]
    file = validate(content, CellFile, str(cell.path))
    return replace(cell, file=file, fixtures=tuple(fixtures), circles=tuple(circles))


def _tool_axis(place: CirclePlace) -> list[float]:
    """Direction of the tool that was looked at: against the circle's normal."""
    return [float(v) for v in np.round(-place.axis_B, 6) + 0.0]


def _mm(point: np.ndarray) -> list[float]:
    return [float(v) for v in np.round(to_mm(point), 3)]
