"""Which samples of a run were taken on a circle: whole sweeps, each in one direction, without run-up and overshoot."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from planner.cell.cell import Cell
from planner.circular.assumptions import SWEEP
from planner.circular.plan import NEAR_CIRCLE, Circle, CircleAtFixture, circles_of
from planner.common.errors import InputError
from planner.common.units import Array
from planner.kinematics.geometry import bar_state
from planner.runs.joint_motion import find_rests
from planner.runs.run import Run


@dataclass(frozen=True)
class MeasuredCircle(CircleAtFixture):
    """A circle of the cell, and the fixture's ball from which the bar measures it."""

    circle: Circle

    @classmethod
    def of(cls, circle: Circle, p_BX: Array) -> "MeasuredCircle":
        """Return the circle with the ball p_BX (3,) [m] of its fixture."""
        return cls(circle.p_BC, np.stack([*circle.axes, circle.normal]), circle.radius, p_BX, circle)


@dataclass(frozen=True)
class Sweep:
    """One measured sweep of a circle.

    Attributes:
        ring: which circle (an index).
        direction: 1 ccw, −1 cw.
        angle: in the order of driving (n,) [rad], from start to start + sweep of the circle.
        length: of the bar as read, (n,) [m].
        calculated: as the nominal robot has it at the joint angles of the run, (n,) [m].
        q: these, (n, N) [rad].
        load: of the circle's loads the nearest to the force that was logged [N], or ``None``.
    """

    ring: int
    direction: int
    angle: Array
    length: Array
    calculated: Array
    q: Array
    load: float | None


def measured_circles(cell: Cell, names: Sequence[str]) -> tuple[MeasuredCircle, ...]:
    """Return the circles of a cell with these names, each with its fixture's ball.

    Raises:
        InputError: a circle that the cell does not have.
    """
    there = {c.name: c for c in circles_of(cell)}
    if missing := [n for n in names if n not in there]:
        raise InputError(f"{cell.path} has no circle {', '.join(missing)}; it has {', '.join(there) or 'none'}")
    return tuple(MeasuredCircle.of(there[n], cell.fixtures[there[n].fixture].p_BX) for n in names)


def find_sweeps(cell: Cell, rings: Sequence[MeasuredCircle], run: Run) -> tuple[Sweep, ...]:
    """Find the sweeps in a run, by the joint angles through the nominal robot.

    Raises:
        InputError: the run has no lengths, or no whole sweep of any circle.
    """
    if run.readings.length is None:
        raise InputError(f"{run.name}: a circular test reads lengths, the column length_mm is missing")
    x = cell.map_position(run.samples.q)
    found: list[Sweep] = []
    for k, ring in enumerate(rings):
        angle, off = ring.to_polar(x)
        near = off < NEAR_CIRCLE * ring.radius
        if run.places != ("",):
            near &= np.array([n == cell.fixtures[ring.circle.fixture].name for n in run.places])[run.samples.place]
        for rows, unwound in _sweeps_of_circle(run, angle, near, ring):
            calculated = bar_state(x[rows], ring.p_BX).length
            direction = 1 if unwound[-1] > unwound[0] else -1
            read, q = run.readings.length[rows], run.samples.q[rows]
            found.append(Sweep(k, direction, unwound, read, calculated, q, _load(run, rows, ring)))
    if not found:
        names = ", ".join(r.circle.name for r in rings)
        raise InputError(
            f"{run.name}: no whole sweep of any circle of the plan in its {len(run)} samples "
            f"({names}): is it the run of this plan, with the angles of its cell's robot?"
        )
    return tuple(found)


def _sweeps_of_circle(
    run: Run, angle: Array, near: np.ndarray, ring: MeasuredCircle
) -> Iterator[tuple[np.ndarray, Array]]:
    """Rows and unwound angles of every sweep."""
    for rows in _moving_stretches(run, near):
        unwound = np.unwrap(angle[rows])
        for part in _monotonic_parts(unwound):
            low, high = unwound[part].min(), unwound[part].max()
            first = int(np.ceil((low - SWEEP.sweep_slack - ring.circle.start) / (2 * np.pi)))
            last = int(np.floor((high + SWEEP.sweep_slack - ring.circle.start - ring.circle.sweep) / (2 * np.pi)))
            for turn in range(first, last + 1):
                past = unwound[part] - ring.circle.start - 2 * np.pi * turn
                inside = np.flatnonzero((past >= 0.0) & (past <= ring.circle.sweep))
                if len(inside) >= SWEEP.sweep_samples:
                    yield rows[part][inside], past[inside] + ring.circle.start


def _moving_stretches(run: Run, near: np.ndarray) -> Iterator[np.ndarray]:
    """Rows that follow each other near the circle, in one session, without a rest."""
    s = run.samples
    moving = np.ones(len(run), dtype=bool)
    session = np.zeros(len(run), dtype=int) if s.session is None else s.session
    if s.t is not None:
        for begin, end in find_rests(s):
            moving[begin:end] = False
    kept = near & moving
    cut = (np.diff(kept.astype(int)) != 0) | (np.diff(session) != 0)
    for rows in np.split(np.arange(len(run)), np.flatnonzero(cut) + 1):
        if kept[rows[0]] and len(rows) >= SWEEP.sweep_samples:
            yield rows


def _monotonic_parts(angle: Array) -> Iterator[slice]:
    """Stretches of an angle (n,) in which it goes one way; steps back smaller than 2 degrees are noise."""
    begin, sense, extreme = 0, 0.0, 0
    values = angle.tolist()
    for k, here in enumerate(values):
        ahead = here - values[extreme]
        if sense == 0.0 and abs(ahead) > SWEEP.turned_round:
            sense, extreme = float(np.sign(ahead)), k
        elif sense * ahead > 0.0:
            extreme = k
        elif -sense * ahead > SWEEP.turned_round:
            yield slice(begin, extreme + 1)
            begin, sense, extreme = extreme, -sense, k
    yield slice(begin, len(angle))


def _load(run: Run, rows: np.ndarray, ring: MeasuredCircle) -> float | None:
    if run.samples.force is None or not ring.circle.loads:
        return None
    force = float(np.median(np.abs(run.samples.force[rows])))
    return min(ring.circle.loads, key=lambda load: abs(load - force))
