"""From a log to curves: whole turns without their overshoot, put on one grid of angles, repeats averaged."""

from collections.abc import Iterator

import numpy as np

from planner.errors import InputError
from planner.loaded.binning import Turn, binned
from planner.loaded.circle import NEAR, find_circle, points, polar
from planner.loaded.harmonics import smoothed, turn_noise
from planner.loaded.levels import load_levels
from planner.loaded.types import Circle, Curves
from planner.rig import Rig
from planner.run import Run
from planner.units import DEG, Array, frozen

FINEST, COARSEST = 360, 36  # angles of the grid
FILL = 4  # samples that fall on each of them at least
SLACK, LOST = 1.5 * DEG, 3  # that a turn may lack: an angle, or so many samples
WINDOW = 1.0 * DEG  # over which the sense of travel is seen


def averaged_curves(rig: Rig, run: Run, overshoot: float) -> tuple[Curves, ...]:
    """Return the curves of each fixture of a run.

    As many whole turns of a pass count as are left when ``overshoot`` [rad] is dropped at either end, at least one, in
    the middle of the pass.

    Raises:
        InputError: no circle, no whole turn, or a load that is missing in every direction.
    """
    x = points(rig, run.samples.q)
    out = []
    for place in np.unique(run.samples.place):
        mine = np.flatnonzero(run.samples.place == place)
        circle = find_circle(rig, run, int(place), x[mine])
        theta, off = polar(circle, x[mine])
        part = run.take(mine)
        loads, level = load_levels(part, off < NEAR * circle.radius)
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
        if level[rows[0]] < 0 or sense[rows[0]] == 0 or len(rows) < COARSEST:
            continue
        way = np.abs(np.unwrap(theta[rows]) - theta[rows[0]])
        total = float(way[-1])
        slack = max(SLACK, LOST * total / len(rows))
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
    usual = float(np.median(step[step > 0])) if np.any(step > 0) else WINDOW
    half = max(1, round(WINDOW / max(usual, 1e-9) / 2))
    n = len(travel)
    after, before = np.minimum(np.arange(n) + half, n - 1), np.maximum(np.arange(n) - half, 0)
    moved = travel[after] - travel[before]
    moved[session[after] != session[before]] = 0.0  # the edge of a session: its ends are overshoot
    fast = np.abs(moved) > 0.2 * usual * (after - before)
    return np.asarray(np.where(fast, np.sign(moved), 0.0), dtype=int)


def _on_grid(run: Run, circle: Circle, loads: Array, turns: list[Turn]) -> Curves:
    if not turns:
        raise InputError(
            f"{run.name}: no whole turn at one load was driven at fixture '{circle.name}'; a circle needs 360 degrees "
            "and more in one go, better with 180 degrees of overshoot at either end"
        )
    bins = min(FINEST, min(len(t.rows) for t in turns) // FILL)
    if bins < COARSEST:
        few = min(len(t.rows) for t in turns)
        raise InputError(
            f"{run.name}: a turn has only {few} samples; at least {COARSEST * FILL} are needed (drive slower or log "
            "faster)"
        )
    directions = _directions(run, circle, loads, turns)
    D, K, N = len(directions), len(loads), run.samples.q.shape[1]
    q, length, force = np.zeros((D, K, bins, N)), np.zeros((D, K, bins)), np.zeros((D, K, bins))
    repeats, square = np.zeros((D, K), dtype=int), np.zeros(bins // 2 + 1)
    assert run.readings.length is not None
    assert run.samples.force is not None
    values = np.column_stack([run.samples.q, run.readings.length, run.samples.force])
    for d, direction in enumerate(directions):
        for k in range(K):
            own = [t for t in turns if t.direction == direction and t.level == k]
            each = np.array([binned(run, t, values[t.rows], bins, N) for t in own])
            each[:, :, :N] -= 2 * np.pi * np.round((each[:, :1, :N] - each[:1, :1, :N]) / (2 * np.pi))
            mean = each.mean(axis=0)
            q[d, k], length[d, k], force[d, k] = mean[:, :N], mean[:, N], mean[:, N + 1]
            repeats[d, k] = len(own)
            square += turn_noise(each[:, :, N])
    spare = int((repeats - 1).sum())
    noise = smoothed(square / spare) if spare > 0 else np.full_like(square, np.nan)
    theta = (np.arange(bins) + 0.5) * 2 * np.pi / bins
    return Curves(
        circle, frozen(theta), directions, frozen(loads), frozen(q), frozen(length), frozen(force), frozen(noise),
        repeats,
    )  # fmt: skip


def _directions(run: Run, circle: Circle, loads: Array, turns: list[Turn]) -> tuple[int, ...]:
    """Senses in which every load was driven, counter-clockwise first."""
    lacking = []
    for direction, name in ((1, "counter-clockwise"), (-1, "clockwise")):
        there = {t.level for t in turns if t.direction == direction}
        if there:
            lacking += [f"{loads[k]:.0f} N {name}" for k in range(len(loads)) if k not in there]
    whole = tuple(d for d in (1, -1) if {t.level for t in turns if t.direction == d} == set(range(len(loads))))
    if not whole:
        raise InputError(
            f"{run.name}: at fixture '{circle.name}' no sense of travel has a whole turn at every load; missing: "
            + ", ".join(lacking)
        )
    return whole
