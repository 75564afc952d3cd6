"""From a log to curves: load steps, whole turns without overshoot, one grid of angles, repeats averaged."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from planner.cell.cell import MeasurementSetup
from planner.circular.plan import NEAR_CIRCLE
from planner.common.errors import InputError
from planner.common.units import Array, mean_by_group, read_only
from planner.loaded.assumptions import SAMPLES
from planner.loaded.compliance import find_circle, measured_points, smooth_spectrum, turn_noise
from planner.loaded.types import SENSES, AveragedCurves, DrivenCircle
from planner.runs.run import Run


def load_levels(run: Run, on: np.ndarray) -> tuple[Array, np.ndarray]:
    """Return the pull at each step, ascending in size, (K,) [N], and each sample's step (n,) int, −1 between steps.

    Args:
        run: with its pull logged.
        on: which samples lie on a circle, (n,) bool; only they make a step.

    Raises:
        InputError: no pull was logged, there is one step only, or the bar pulls at some and pushes at others.
    """
    force = run.samples.force
    if force is None:
        raise InputError(
            f"{run.name}: the column force_N is missing (pull along the bar, positive towards the fixture); without "
            "the load there is no compliance"
        )
    edges = _edges(np.asarray(force)[on])
    level = np.full(len(force), -1)
    for k, (low, high) in enumerate(edges):
        level[(force >= low) & (force <= high)] = k
    level[~on] = -1
    loads = np.array([float(np.median(force[level == k])) for k in range(len(edges))])
    _check(run, loads)
    order = np.argsort(np.abs(loads), kind="stable")
    rank = np.full(len(order) + 1, -1)
    rank[order] = np.arange(len(order))
    return loads[order], rank[level]


def _edges(force: Array) -> list[tuple[float, float]]:
    """Lower and upper end of each step: runs of well-filled bins."""
    low, high = float(force.min()), float(force.max())
    if high - low < 1.0:
        return [(low, high)]
    count, at = np.histogram(force, 80, (low, high))  # bins over the range of the forces
    width = at[1] - at[0]
    full = np.flatnonzero(count > SAMPLES.least_force_share * len(force))
    groups = np.split(full, 1 + np.flatnonzero(np.diff(full) > 1))
    return [(float(at[g[0]]) - width, float(at[g[-1] + 1]) + width) for g in groups if len(g)]


def _check(run: Run, loads: Array) -> None:
    if len(loads) < 2:
        small = " (are they in kN? the column is in newtons)" if 0 < np.abs(loads).max() < SAMPLES.small_load else ""
        raise InputError(
            f"{run.name}: there is one load only, {loads[0]:.3g} N{small}; a stiffness needs two at least, better the "
            "paper's five (125 to 625 N)"
        )
    if loads.min() < -1.0 and loads.max() > 1.0:
        listed = ", ".join(f"{v:.0f}" for v in np.sort(loads))
        raise InputError(
            f"{run.name}: force_N has both signs ({listed} N): a bar either pulls (positive) or pushes (negative) "
            "throughout; check the sign of each step"
        )


@dataclass(frozen=True)
class Turn:
    """One whole turn: its samples in the order of time, and their angle (m,) [rad]."""

    direction: int
    level: int
    rows: np.ndarray
    theta: Array


def bin_turn(run: Run, turn: Turn, values: Array, bins: int, joints: int) -> Array:
    """Mean of the columns of ``values`` (m, C) at the middle of every bin, (bins, C), straight lines between means.

    A joint (the first ``joints`` columns) that turns once with the circle is averaged relative to the angle.
    """
    width = 2 * np.pi / bins
    around = np.unwrap(turn.theta)
    winding = np.round((values[-1] - values[0]) / (around[-1] - around[0]))
    winding[joints:] = 0.0
    values = values - winding * around[:, None]
    angle = turn.theta % (2 * np.pi)
    where = np.minimum((angle / width).astype(int), bins - 1)
    count = np.bincount(where, minlength=bins)
    if np.any(count == 0):
        gap = float(np.degrees((int(np.flatnonzero(count == 0)[0]) + 0.5) * width))
        raise InputError(f"{run.name}: a turn has no sample about {gap:.0f} degrees; the log has a hole there")
    at, mean = mean_by_group(angle, where), mean_by_group(values, where)
    span = (np.roll(at, -1) - np.roll(at, 1)) % (2 * np.pi)
    slope = (np.roll(mean, -1, axis=0) - np.roll(mean, 1, axis=0)) / span[:, None]
    middle = (np.arange(bins) + 0.5) * width
    return np.asarray(mean + slope * (middle - at)[:, None] + winding * middle[:, None])


def average_curves(setup: MeasurementSetup, run: Run, overshoot: float) -> tuple[AveragedCurves, ...]:
    """Return the curves of each fixture of a run.

    As many whole turns of a pass count as are left when ``overshoot`` [rad] is dropped at either end, at least one, in
    the middle of the pass.

    Raises:
        InputError: no circle, no whole turn, or a load that is missing in every direction.
    """
    x = measured_points(setup, run.samples.q)
    out = []
    for place in np.unique(run.samples.place):
        mine = np.flatnonzero(run.samples.place == place)
        circle = find_circle(setup, run, int(place), x[mine])
        theta, off = circle.to_polar(x[mine])
        part = run.take(mine)
        loads, level = load_levels(part, off < NEAR_CIRCLE * circle.radius)
        turns = list(_turns(part, theta, level, overshoot))
        out.append(_on_grid(part, circle, loads, turns))
    return tuple(out)


def _turns(run: Run, theta: Array, level: np.ndarray, overshoot: float) -> Iterator[Turn]:
    """Whole turns of every stretch in one session at one load in one sense."""
    session = run.samples.session
    session = np.zeros(len(run), dtype=int) if session is None else session
    travel = np.unwrap(theta)
    sense = _sense(travel, session)
    key = (session * 1000 + level) * 4 + sense
    cuts = np.flatnonzero(np.diff(key)) + 1
    for rows in np.split(np.arange(len(run)), cuts):
        if level[rows[0]] < 0 or sense[rows[0]] == 0 or len(rows) < SAMPLES.coarsest_grid:
            continue
        way = np.abs(np.unwrap(theta[rows]) - theta[rows[0]])
        total = float(way[-1])
        slack = max(SAMPLES.turn_slack, SAMPLES.lost_samples * total / len(rows))
        if total < 2 * np.pi - slack:
            continue
        whole = max(1, int((total - 2 * overshoot + slack) // (2 * np.pi)))
        start = max(0.0, (total - whole * 2 * np.pi) / 2)
        for k in range(whole):
            begin = start + k * 2 * np.pi
            inside = (way >= begin) & (way < begin + 2 * np.pi)
            yield Turn(int(sense[rows[0]]), int(level[rows[0]]), rows[inside], theta[rows[inside]])


def _sense(travel: Array, session: np.ndarray) -> np.ndarray:
    """Sense of travel of each sample, (n,): 1, −1, or 0 where the arm rests or turns back."""
    step = np.abs(np.diff(travel))
    usual = float(np.median(step[step > 0])) if np.any(step > 0) else SAMPLES.sense_window
    half = max(1, round(SAMPLES.sense_window / max(usual, 1e-9) / 2))
    n = len(travel)
    after, before = np.minimum(np.arange(n) + half, n - 1), np.maximum(np.arange(n) - half, 0)
    moved = travel[after] - travel[before]
    moved[session[after] != session[before]] = 0.0  # the edge of a session: its ends are overshoot
    fast = np.abs(moved) > 0.2 * usual * (after - before)
    return np.asarray(np.where(fast, np.sign(moved), 0.0), dtype=int)


def _on_grid(run: Run, circle: DrivenCircle, loads: Array, turns: list[Turn]) -> AveragedCurves:
    if not turns:
        raise InputError(
            f"{run.name}: no whole turn at one load was driven at fixture '{circle.name}'. A circle needs 360 degrees "
            "and more in one go, better with 180 degrees of overshoot at either end"
        )
    bins = min(SAMPLES.finest_grid, min(len(t.rows) for t in turns) // SAMPLES.samples_an_angle)
    if bins < SAMPLES.coarsest_grid:
        few, enough = min(len(t.rows) for t in turns), SAMPLES.coarsest_grid * SAMPLES.samples_an_angle
        raise InputError(
            f"{run.name}: a turn has only {few} samples. At least {enough} are needed (drive slower or log faster)"
        )
    directions, N = _directions(run, circle, loads, turns), run.samples.q.shape[1]
    binned = [
        [_bin_turns(run, [t for t in turns if (t.direction, t.level) == (d, k)], bins) for k in range(len(loads))]
        for d in directions
    ]
    mean = np.array([[each.mean(axis=0) for each in row] for row in binned])
    repeats = np.array([[len(each) for each in row] for row in binned])
    square = np.asarray(sum(turn_noise(each[:, :, N]) for row in binned for each in row))
    spare = int((repeats - 1).sum())
    return AveragedCurves(
        circle=circle,
        theta=read_only((np.arange(bins) + 0.5) * 2 * np.pi / bins),
        directions=directions,
        loads=read_only(loads),
        q=read_only(mean[..., :N]),
        length=read_only(mean[..., N]),
        force=read_only(mean[..., N + 1]),
        noise=read_only(smooth_spectrum(square / spare) if spare > 0 else np.full_like(square, np.nan)),
        repeats=repeats,
    )


def _bin_turns(run: Run, turns: list[Turn], bins: int) -> Array:
    """Angles of the joints as of the first turn, reading and pull over the grid, (turns, bins, N + 2)."""
    assert run.readings.length is not None
    assert run.samples.force is not None
    N, columns = run.samples.q.shape[1], (run.samples.q, run.readings.length, run.samples.force)
    out = np.array([bin_turn(run, t, np.column_stack([c[t.rows] for c in columns]), bins, N) for t in turns])
    out[:, :, :N] -= 2 * np.pi * np.round((out[:, :1, :N] - out[:1, :1, :N]) / (2 * np.pi))
    return out


def _directions(run: Run, circle: DrivenCircle, loads: Array, turns: list[Turn]) -> tuple[int, ...]:
    """Senses in which every load was driven, counter-clockwise first."""
    lacking = {d: set(range(len(loads))) - {t.level for t in turns if t.direction == d} for d in SENSES}
    whole = tuple(d for d, levels in lacking.items() if not levels)
    if not whole:
        begun = {d: levels for d, levels in lacking.items() if len(levels) < len(loads)}
        missing = (f"{loads[k]:.0f} N {SENSES[d]}" for d, levels in begun.items() for k in sorted(levels))
        raise InputError(
            f"{run.name}: at fixture '{circle.name}' no sense of travel has a whole turn at every load; missing: "
            + ", ".join(missing)
        )
    return whole
