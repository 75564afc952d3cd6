"""Runs of different plans, days, fixtures and gauges as one: one robot, and in each session a gauge set up anew.

The robot's errors are common. Each session has fixtures of its own and a zero of its own, also where two sessions call
a fixture by one name: whoever took it away and put it back put it elsewhere. Tool points at one place of the flange
are one. Noise and scale are those of the gauge that read. Only lengths are joined across kinds of gauge, other readings
where the gauge is the same.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.cell.cell import Cell, setup_of
from planner.cell.parts import Fixture, ToolPoint
from planner.common.errors import InputError
from planner.common.units import Array
from planner.gauges.placement.solver import index_in_cell
from planner.gauges.several_lengths import SessionGauge, SeveralLengths, standing_lengths
from planner.runs.loader import join_runs
from planner.runs.run import Run


@dataclass(frozen=True)
class MeasuredSession:
    """One session: its name, which tells its fixtures from those of others, what was measured, and where.

    ``mounting`` is the name of the gauge's set-up, which sessions share between which nobody moved it.
    """

    name: str
    run: Run
    cell: Cell
    mounting: str = ""


def join_sessions(sessions: Sequence[MeasuredSession]) -> tuple[Run, Cell]:
    """Return all samples as one run, in a cell that has the fixtures, gauges and tool points of all sessions.

    Raises:
        InputError: the sessions are of different robots, or of readings that cannot be fitted together.
    """
    first = sessions[0].cell
    for session in sessions[1:]:
        _check_same_arm(first, session.cell)
    sessions, lonely = _join_standing(sessions), _without_the_first(sessions)
    if len(sessions) == 1:
        return sessions[0].run, sessions[0].cell
    read_by = standing_lengths([s.cell for s in sessions])
    if len(read_by) < len(sessions):
        return _join_same_gauge(sessions)
    points = _tool_points(sessions)
    held = [_own_names(s, _shared_names(sessions)) for s in sessions]
    runs = [_with_common_names(s, names, points) for s, names in zip(sessions, held, strict=True)]
    gauges = [SessionGauge(s.name, g, tuple(n)) for s, g, n in zip(sessions, read_by, held, strict=True)]
    tool = replace(
        first.tool,
        points=points,
        prior=max(s.cell.tool.prior for s in sessions),
        measured=all(s.cell.tool.measured for s in sessions),
    )
    fixtures = [f for s, names in zip(sessions, held, strict=True) for f in _fixtures(s.cell, names, len(points))]
    plan = replace(first.plan, free=frozenset().union(*(s.cell.plan.free for s in sessions)))
    gauge = replace(SeveralLengths.of(gauges), mounting=sessions[-1].mounting)
    cell = replace(first, gauge=gauge, fixtures=tuple(fixtures), tool=tool, plan=plan)
    run = join_runs([replace(r, plan_id=None) for r in runs])
    return replace(run, warnings=(*run.warnings, *lonely)), cell


def _join_standing(sessions: Sequence[MeasuredSession]) -> list[MeasuredSession]:
    """Return the sessions, those as one between which the gauge was left standing: they share its place and zero.

    Raises:
        InputError: two of them have it, or the tool, elsewhere.
    """
    groups: dict[str, list[MeasuredSession]] = {}
    for k, s in enumerate(sessions):
        groups.setdefault(s.mounting or f" {k}", []).append(s)
    return [_as_one_mounting(group) if len(group) > 1 else group[0] for group in groups.values()]


def _as_one_mounting(group: Sequence[MeasuredSession]) -> MeasuredSession:
    first, name = group[0], group[0].mounting
    for s in group[1:]:
        if not _stands_alike(first.cell, s.cell):
            raise InputError(
                f"{s.cell.path}: the gauge of '{name}' was left standing, but gauge, fixtures or tool points are not "
                f"those of {first.cell.path}: give both one cell, or leave gauge.mounting out"
            )
    run = join_runs([replace(s.run, name=s.name, plan_id=None) for s in group])
    cell = replace(first.cell, gauge=replace(first.cell.gauge, mounting=name))
    return MeasuredSession("+".join(s.name for s in group), run, cell, name)


def _stands_alike(one: Cell, other: Cell) -> bool:
    places = [[f.name for f in c.fixtures] for c in (one, other)]
    if one.gauge != other.gauge or places[0] != places[1] or len(one.tool.points) != len(other.tool.points):
        return False
    apart = [a.p_BX - b.p_BX for a, b in zip(one.fixtures, other.fixtures, strict=True)]
    apart += [a.p_FM - b.p_FM for a, b in zip(one.tool.points, other.tool.points, strict=True)]
    return _are_zero(np.array(apart))


def _without_the_first(sessions: Sequence[MeasuredSession]) -> list[str]:
    """Say of each session that found its gauge as another run has left it that this run is not among them."""
    names = [s.mounting for s in sessions]
    return [
        f"{s.name}: its plan has the gauge as another run has left it (gauge.mounting = '{s.mounting}'), and that run "
        "is not among these: the gauge counts as set up anew"
        for s in sessions
        if s.cell.gauge.mounting and names.count(s.mounting) == 1
    ]


def _check_same_arm(first: Cell, other: Cell) -> None:
    """Refuse another robot, or one that stands or carries otherwise.

    Raises:
        InputError: with both.
    """
    if first.robot.name != other.robot.name:
        raise InputError(
            f"{other.path}: has the robot '{other.robot.name}', but {first.path} has '{first.robot.name}': only runs "
            "of one robot are identified together"
        )
    if not np.allclose(first.base.R_WB, other.base.R_WB, atol=1e-3):  # [rad] of a base that stands the same
        raise InputError(f"{other.path}: its base is mounted otherwise than that of {first.path}")
    if first.tool.mass != other.tool.mass:
        raise InputError(
            f"{other.path}: its tool weighs {other.tool.mass:g} kg, that of {first.path} {first.tool.mass:g} kg: give "
            "both cells one tool, and what it carries beyond as the run's column payload_kg"
        )


def _join_same_gauge(sessions: Sequence[MeasuredSession]) -> tuple[Run, Cell]:
    """Join runs of one gauge that is no length gauge: its frame is another one in each file."""
    first = sessions[0]
    for s in sessions[1:]:
        if s.cell.gauge != first.cell.gauge or len(s.cell.balls) != len(first.cell.balls):
            raise InputError(
                f"{s.cell.path}: its gauge is '{s.cell.gauge.kind}', that of {first.cell.path} "
                f"'{first.cell.gauge.kind}': bars and wires are identified together, other gauges only with their like"
            )
    named = [replace(s.run, name=s.name, plan_id=None) for s in sessions]
    return join_runs(named), first.cell


def _shared_names(sessions: Sequence[MeasuredSession]) -> frozenset[str]:
    """Names of fixtures that more than one session has."""
    names = [f.name for s in sessions for f in s.cell.fixtures]
    return frozenset(n for n in names if names.count(n) > 1)


def _own_names(session: MeasuredSession, shared: frozenset[str]) -> list[str]:
    """Names of the fixtures of a session, in the order of its cell, as no other session has them."""
    return [f"{session.name}/{f.name}" if f.name in shared else f.name for f in session.cell.fixtures]


def _tool_points(sessions: Sequence[MeasuredSession]) -> tuple[ToolPoint, ...]:
    """Return the tool points of all sessions, each once; those of a later session that are new bear its name."""
    out: list[ToolPoint] = []
    for s in sessions:
        for point in s.cell.tool.points:
            if not any(_are_same(point, other) for other in out):
                taken = any(point.name == other.name for other in out)
                out.append(replace(point, name=f"{s.name}/{point.name}") if taken else point)
    return tuple(out)


def _are_same(one: ToolPoint, other: ToolPoint) -> bool:
    return _are_zero(one.p_FM - other.p_FM)


def _are_zero(apart: Array) -> bool:
    # 1e-6: [m] between two tool points, or two places of a fixture, that are one
    return bool(np.abs(apart).max(initial=0.0) < 1e-6)


def _with_common_names(session: MeasuredSession, names: Sequence[str], points: Sequence[ToolPoint]) -> Run:
    """Return the run with the fixtures and tool points as all sessions together call them."""
    run, cell = session.run, session.cell
    own = tuple(f.name for f in cell.fixtures)
    places = tuple(names[index_in_cell(run, name, own, "fixture", cell)] for name in run.places)
    run = replace(run, name=session.name, places=places)
    if len(points) == 1:
        return replace(run, points=("",), samples=replace(run.samples, point=None))
    named = tuple(p.name for p in cell.tool.points)
    which = [0 if len(named) == 1 else index_in_cell(run, name, named, "point", cell) for name in run.points]
    called = tuple(next(p.name for p in points if _are_same(p, cell.tool.points[k])) for k in which)
    return replace(run, points=called, samples=replace(run.samples, point=run.samples.point_numbers))


def _fixtures(cell: Cell, names: Sequence[str], points: int) -> list[Fixture]:
    """Return the fixtures under their names, as uncertain as the cell has them."""
    prior = setup_of(cell).place_prior
    return [
        replace(f, name=name, prior=float(sigma), mounts=(None,) * points)
        for f, name, sigma in zip(cell.fixtures, names, prior, strict=True)
    ]
