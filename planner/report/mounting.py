"""How a gauge is mounted and set: numbered steps, and a drawing from the side with the numbers of the cell."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from planner.cell.cell import Cell
from planner.cell.reading import gauge_class
from planner.common.units import MM, Array, to_mm
from planner.kinematics.inverse_kinematics import tool_pose
from planner.session.plan_types import Drive, Plan, Visit

Point = tuple[float, float]


def mounting_steps(plan: Plan) -> list[str]:
    """Return what a person does before the first pose, step by step: what to screw where, which length to set."""
    cell = plan.cell
    guide = gauge_class(cell.file).session_guide(cell.file)
    reading = f"{cell.gauge.reading_text(cell.file).partition('. ')[0].removesuffix('.')}."
    if not cell.has_bar():
        return [*(f"{step.title}. {step.text}" for step in (*guide.before, *guide.at_start)), reading]
    noun, fixtures = cell.gauge.noun, dict.fromkeys(d.mounting.fixture for d in plan.drives)
    steps = [
        f"Set up fixture {cell.fixtures[k].name or 'A'}: the {noun}'s end at {_vector(cell.fixtures[k].p_BX)} mm of "
        f"the base. Within {to_mm(cell.fixtures[k].room):g} mm is near enough."
        for k in fixtures
    ]
    points = dict.fromkeys(d.mounting.point for d in plan.drives)
    for k in points:
        which = f", point {cell.tool.points[k].name}" if len(points) > 1 else ""
        there = f"the {noun}'s other end at {_vector(cell.tool.points[k].p_FM)} mm of the flange"
        steps.append(f"Screw the holder to the flange{which}: {there}.")
    several = len(fixtures) > 1
    pauses = [
        f"{cell.gauge.length_text(d.visits[0].length)}{f' at fixture {cell.place_name(d.mounting)}' if several else ''}"
        for d in plan.drives
    ]
    about, attach = ", then ".join(pauses), f"Start the program. It pauses at the mount pose. Attach the {noun}"
    if cell.gauge.zero_free:
        zero = f". Measure its length by a master or a ruler, to 1 mm: about {about}. Set its display to that length."
    else:
        zero = f", its display set by a master: the fit believes its zero. It reads about {about}."
    steps.append(f"{attach}{zero} Do not set it again.")
    return [*steps, reading]


def mounting_details(plan: Plan) -> list[str]:
    """Return the whole of what is said of mounting, with its tolerances."""
    guide = gauge_class(plan.cell.file).session_guide(plan.cell.file)
    steps = [f"{step.title}. {step.text}" for step in (*guide.before, *guide.at_start)]
    return [*steps, plan.cell.gauge.reading_text(plan.cell.file)]


@dataclass(frozen=True)
class MountingDrawing:
    """The upright plane through the axis of the base and a fixture, to scale; points in units of the drawing.

    Attributes:
        fixture, ball, flange, base: ends of the gauge, middle of the flange, foot of axis 1, (x, y) from the top left.
        floor: height of what the fixture stands on.
        top: height of what is written above all that is drawn.
        others: further balls or sockets of an artifact with their names, those seen at one place together.
        away: how far the fixture is from axis 1 [mm]; position: of it in the frame of the base (3,) [mm].
        line: between the ends of the gauge: ``rod``, ``sight`` or none.
        gauge: the gauge and its length; holder: where its end sits in the frame of the flange, in words.
        title: of the drawing.
        places: name and position of each ball or socket in mm; empty where there is one.
    """

    fixture: Point
    ball: Point
    flange: Point
    base: Point
    floor: float
    top: float
    others: tuple[tuple[Point, str], ...]
    away: float
    position: tuple[float, float, float]
    line: str
    gauge: str
    holder: str
    title: str
    places: str


def mounting_drawings(plan: Plan) -> list[MountingDrawing]:
    """Return a drawing of base, gauge and flange for each mounting."""
    return [_drawing(plan.cell, d) for d in plan.drives if plan.cell.fixtures]


def _drawing(cell: Cell, drive: Drive) -> MountingDrawing:
    gauge, (stands, on_tool) = cell.gauge, cell.gauge.ends
    attached = cell.has_bar()
    visit = _drawn_visit(cell, drive)
    q, place = np.asarray(visit.q)[None], cell.fixtures[drive.mounting.fixture]
    balls = [(b.name, to_mm(place.p_BX + place.R_BX @ b.p_GS)) for b in cell.balls] if gauge.at_balls else []
    name, fixture = balls[visit.ball] if balls else (cell.place_name(drive.mounting), to_mm(place.p_BX))
    ball = to_mm(cell.at(drive.mounting).map_position(q)[0])
    holder = cell.tool.points[drive.mounting.point].p_FM
    flange = ball - to_mm(tool_pose(cell.chain, cell.robot, q)[1][0] @ holder)
    away = float(np.hypot(*fixture[:2]))
    along = fixture[:2] / away if away > 1.0 else np.array([1.0, 0.0])  # [mm] a fixture on the axis itself
    ground = min(0.0, float(fixture[2]), 0.0 if cell.base.floor is None else float(to_mm(cell.base.floor)))
    flat = [[p[:2] @ along, p[2]] for p in (fixture, ball, flange, *(p for _, p in balls))]
    A, B, F, *others, base = _to_scale(np.array([*flat, [0.0, ground]]))
    x, y, z = (round(float(v)) for v in fixture)
    own = f"{stands} {name}".strip()
    length = gauge.length_text(visit.length)
    listed = ", ".join(f"{n} {_vector(p * MM)}" for n, p in balls)
    return MountingDrawing(
        fixture=A,
        ball=B,
        flange=F,
        base=base,
        floor=base[1],
        top=max(14.0, min(F[1] - 14.0, B[1] - 14.0, *(p[1] - 24.0 for p in others))),
        others=_join_labels((p, n) for p, (n, _) in zip(others, balls, strict=True) if n != name),
        away=away,
        position=(x, y, z),
        line="rod" if attached else "" if balls else "sight",
        gauge=f"{gauge.noun} {length}" if attached else own,
        holder=f"{on_tool} at {_vector(holder)} mm of the flange",
        title=f"{own[:1].upper()}{own[1:]}, {on_tool} and flange from the side",
        places=f"{stands.capitalize()}s in mm of the base: {listed}." if len(balls) > 1 else "",
    )


def _join_labels(others: Iterable[tuple[Point, str]]) -> tuple[tuple[Point, str], ...]:
    """Return what is drawn at each place, with all the names of what is seen there."""
    out: dict[Point, str] = {}
    for p, name in others:
        there = next((k for k in out if np.hypot(k[0] - p[0], k[1] - p[1]) < 10), p)  # units: twice a ball's radius
        out[there] = f"{out[there]}, {name}" if there in out else name
    return tuple(out.items())


def _drawn_visit(cell: Cell, drive: Drive) -> Visit:
    """Return the mount pose of what is attached there, a pose in the first ball, or the highest pose that is seen."""
    read = [v for v in drive.visits if v.role != "mount"]
    if cell.has_bar() or not read:
        return drive.visits[0]
    if cell.gauge.at_balls:
        return read[0]
    height = cell.at(drive.mounting).map_position(np.array([v.q for v in read]))[:, 2]
    return read[int(np.argmax(height))]


def _to_scale(flat: Array) -> list[Point]:
    """Return points (n, 2) [mm], along and up, in units of the drawing; the last of them is the foot of axis 1."""
    size = np.array([480.0, 210.0])  # units of the drawing
    left, top, right, below = 74.0, 40.0, 112.0, 38.0  # units of its margins, for what is written
    low, high = flat.min(axis=0), flat.max(axis=0)
    scale = float(((size - (left + right, top + below)) / np.maximum(high - low, 1.0)).min())
    drawn = [left, size[1] - below] + scale * (flat - low) * [1.0, -1.0]
    return [(round(float(x), 1), round(float(y), 1)) for x, y in drawn]


def _vector(p: Array) -> str:
    return f"[{', '.join(f'{float(v):g}' for v in np.round(to_mm(p), 2) + 0.0)}]"
