"""How the joints moved: clock and sessions, speeds, directions, reversals; rests and the averages over them.

Joint angles that a log counts within one turn: a drive goes on past its end, poses stand where the arm can stand.
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from planner.common.errors import InputError
from planner.common.lazy_modules import pl
from planner.common.summary import Aside
from planner.common.units import DEG, TURN, Array, IntArray, read_only
from planner.runs.run import Readings, Run, Samples
from planner.runs.table import RunTable
from planner.runs.text import RowSource, first_row

DENSE_STEP = 0.2  # [s] median step of time below which samples may follow each other along a path


def looks_continuous(t: Array | None, q: Array) -> bool:
    """Return whether samples at times (n,) [s] and joint angles (n, N) [rad] follow each other along a path.

    They do where they follow closely, and where the arm hardly ever stands and goes on from each step to the next as it
    went before: from pose to pose it turns about.
    """
    if t is None or len(t) < 3:
        return False
    # 2.5: [s] median step of a drive that is logged now and then: a pose at rest takes longer
    is_log = bool((np.diff(t) > 0.0).all()) and _median_step(t) < 2.5
    return is_dense(t, q) or (is_log and _goes_on(q))


def is_dense(t: Array | None, q: Array) -> bool:
    """Return whether samples follow each other closely in time (n,) [s] and in joint angles (n, N) [rad]."""
    if t is None or len(t) < 3:
        return False
    on, way = np.diff(t) != 0.0, np.abs(np.diff(q, axis=0)).max(axis=1)
    # 0.1: [rad] median movement between such neighbours: 0.5 rad/s at 0.2 s, several at a controller's cycle
    return bool(on.any() and _median_step(t) < DENSE_STEP and np.median(way[on]) < 0.1)


def _median_step(t: Array) -> float:
    """Return the median step of a clock [s]; several targets read at one pose bear one time."""
    step = np.abs(np.diff(t))
    return float(np.median(step[step > 0.0])) if step.any() else np.inf


def _goes_on(q: Array) -> bool:
    """Return whether an arm at angles (n, N) [rad] hardly ever stands, and each step is like the one before."""
    few = 20  # samples, of which chance makes a path now and then
    step = np.diff(q, axis=0)
    stands = np.abs(step).max(axis=1) < REST_ANGLE
    if len(q) < few or stands.mean() > 0.2:
        return False
    alike = float((step[1:] * step[:-1]).sum()) / float(np.sqrt((step[1:] ** 2).sum() * (step[:-1] ** 2).sum()))
    # 0.5: correlation of neighbouring steps: of drives it is 0.7 at 2 s and more below, from pose to pose -0.5 to 0.1
    return alike > 0.5


def number_sessions(t: Array | None, given: Array | None, n: int) -> tuple[IntArray, IntArray]:
    """Return the number of each sample's session (n,), from 0 on, and the rows where a clock steps back.

    A session that is named in the data keeps its samples together wherever they stand; without names a session ends
    where the clock steps back.
    """
    named = np.zeros(n, dtype=np.int64) if given is None else _in_order(given)
    if t is None:
        return named, np.empty(0, dtype=np.int64)
    back = 1 + np.flatnonzero((np.diff(t) < 0.0) & (named[1:] == named[:-1]))
    if given is None:
        named[back] = 1
        named = np.cumsum(named)
    return named, back


def check_order(source: RowSource, t: Array, session: IntArray) -> None:
    """Check that the clock of a continuous run goes forward within each session.

    Raises:
        InputError: with the line where time (n,) [s] stands still or runs backwards.
    """
    step, together = np.diff(t), np.diff(session) == 0
    if (row := first_row((step < 0.0) & together)) is not None:
        hint = (
            "split the file there, or give each part its own number in a column session (in a log of poses at rest, "
            "'# measure: static' above the columns allows it)"
        )
        backwards = f"time runs backwards from {t[row]:g} s to {t[row + 1]:g} s in a continuous run"
        raise source.error(row + 1, "t", f"{backwards}; {hint}")
    still = (step == 0.0) & together
    if (row := first_row(still)) is not None:
        twice = f"the time {t[row + 1]:g} s stands twice ({still.sum()} such lines)"
        raise source.error(row + 1, "t", f"{twice}; in a continuous run each sample has its own")


def _in_order(values: Array) -> IntArray:
    """Number values by their first appearance."""
    _, first, inverse = np.unique(values, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return np.asarray(rank[inverse])


BoolArray = NDArray[np.bool_]
REST_SPEED = 0.002  # [rad/s] 0.1 degree a second: slower than any measuring move, above an encoder's flicker
REST_TIME = 0.5  # [s] the shortest rest
REST_ANGLE = REST_SPEED * REST_TIME  # [rad] that a joint may move in it


def joint_speeds(samples: Samples) -> Array:
    """Return joint speeds (n, N) [rad/s] by time differences within sessions.

    A parabola through each sample and its two neighbours (exact for constant acceleration, any spacing). A straight
    line at the ends of a session, zero where it has one sample.

    Raises:
        InputError: the run has no time, or two samples of a session have the same.
    """
    if samples.t is None:
        raise InputError("joint speeds need the time of each sample, but the run has no column t_s")
    t, q = samples.t, samples.q
    speeds = np.zeros_like(q)
    for part in np.split(np.arange(len(t)), 1 + np.flatnonzero(np.diff(samples.session_numbers))):
        if (np.diff(t[part]) <= 0.0).any():
            raise InputError(
                "joint speeds need a clock that goes forward, but two samples of a session have the same time"
            )
        if len(part) > 1:
            speeds[part] = np.gradient(q[part], t[part], axis=0)
    return speeds


def find_rests(samples: Samples) -> IntArray:
    """Return first sample and end (exclusive) of each stretch at rest, (k, 2).

    The arm rests where no joint's angle changes by more than REST_ANGLE within REST_TIME: a difference over a time,
    not a speed, as encoder steps divided by a controller's cycle are large. A quarter of that time is cut off at both
    ends, where the arm still brakes or already starts.

    Raises:
        InputError: the run has no time.
    """
    if samples.t is None:
        raise InputError("rests are found by time, but the run has no column t_s")
    t, q = samples.t, samples.q
    step = float(np.median(np.abs(np.diff(t)))) if len(t) > 1 else REST_TIME
    width = max(3, round(REST_TIME / max(step, 1e-9)) + 1)  # samples that a rest has at least
    cut = (width - 1) // 4
    if width > len(t):
        return np.empty((0, 2), dtype=np.int64)
    still = _largest_change(q, width) <= REST_ANGLE  # (n − width + 1,) of the windows i … i + width − 1
    apart = _breaks(samples)
    part = np.concatenate([[0], np.cumsum(apart)])
    still &= part[width - 1 :] == part[: len(part) - width + 1]
    covered = np.zeros(len(t) + 1, dtype=np.int64)
    np.add.at(covered, np.flatnonzero(still), 1)
    np.add.at(covered, np.flatnonzero(still) + width, -1)
    at_rest = np.cumsum(covered[:-1]) > 0
    on = at_rest[1:] & at_rest[:-1] & ~apart  # the rest goes on from one sample to the next
    begins = at_rest & ~np.concatenate([[False], on])
    ends = at_rest & ~np.concatenate([on, [False]])
    return np.column_stack([np.flatnonzero(begins) + cut, np.flatnonzero(ends) + 1 - cut])


def _largest_change(q: Array, width: int) -> Array:
    """Return the largest change of a joint in each window of ``width`` samples, (n − width + 1,) [rad]."""
    inside = slice(width // 2, width // 2 + len(q) - width + 1)
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    high, low = maximum_filter1d(q, width, axis=0)[inside], minimum_filter1d(q, width, axis=0)[inside]
    return np.asarray((high - low).max(axis=1))


def _breaks(samples: Samples) -> BoolArray:
    """Return whether something ends between each sample and the next, (n − 1,): a session, a pose, a fixture …"""
    ends = np.abs(np.diff(samples.t if samples.t is not None else samples.q[:, 0])) > REST_TIME
    for values in (samples.session, samples.pose, samples.place, samples.point):
        if values is not None:
            ends |= np.diff(values) != 0
    return np.asarray(ends, dtype=bool)


def last_directions(q: Array, first: IntArray) -> Array:
    """Return the sign of each joint's last move before the samples ``first`` (k,), (k, N); 0 where it had not moved.

    Angles are counted in steps of REST_ANGLE. A move is two steps in one direction, so that an encoder that
    flickers over the border of a step does not move.
    """
    signs = np.zeros((len(first), q.shape[1]))
    for joint, angle in enumerate(q.T):
        level = np.round(angle / REST_ANGLE)
        change = np.diff(level)
        moved = np.flatnonzero(change)
        way = np.sign(change[moved])
        real = np.abs(change[moved]) > 1.0
        real[1:] |= way[1:] == way[:-1]
        moved, way = moved[real] + 1, np.append(way[real], 0.0)  # the last entry answers for "not yet"
        signs[:, joint] = way[np.searchsorted(moved, first, side="right") - 1]
    return signs


def last_reversals(q: Array, last: int = 4) -> Array:
    """Angles at each joint's last reversals before every sample, the latest last.

    Args:
        q: angles along a driven path, (n, N) [rad].
        last: how many, M; where there were fewer the path's first angle stands.

    Returns:
        (n, N, M) [rad].
    """
    n, joints = q.shape
    out = np.empty((n, joints, last))
    for i in range(joints):
        out[:, i] = q[_turns(q[:, i], n, last), i]
    return out


def _turns(angle: Array, n: int, last: int) -> np.ndarray:
    """Sample of each of the last reversals before every sample, (n, last)."""
    level = np.round(angle / 1e-4)  # [rad] of travel that tells a reversal from the noise of the encoder
    moved = np.flatnonzero(np.diff(level)) + 1  # samples that stand on another step than the one before
    way = np.sign(level[moved] - level[moved - 1])
    back = np.flatnonzero(way[1:] != way[:-1]) + 1
    seen, turned = moved[back], moved[back] - 1  # when a reversal shows, and where it was
    turned = np.concatenate([np.zeros(last, dtype=int), turned])
    count = np.searchsorted(seen, np.arange(n), side="right")
    return np.asarray(turned[count[:, None] + np.arange(last)])


MEANS = frozenset(
    {"q", "t", "q_cmd", "q_read", "temperature", "force", "torque", "payload", "length", "position", "offset"}
)

T = TypeVar("T", Samples, Readings)


def average_rests(run: Run) -> Run:
    """Return the run with one sample for each stretch at rest: angles, readings and circumstances averaged there.

    The direction in which each joint last moved is noted where the run does not say it. A warning tells how many rests
    there are, and of how many samples.

    Raises:
        InputError: the run has no time, or the arm rests nowhere.
    """
    stretches = _measured_rests(run.samples)
    if len(stretches) == 0:
        raise InputError(
            f"{run.name}: none of {len(run)} samples is at rest (no joint moving by more than "
            f"{np.rad2deg(REST_ANGLE):.3f} degrees in {REST_TIME:g} s); is this a continuous run?"
        )
    count = np.diff(stretches, axis=1)[:, 0]
    samples, readings = _average_stretches(run.samples, stretches), _average_stretches(run.readings, stretches)
    if run.samples.direction is None:
        samples = replace(samples, direction=read_only(last_directions(run.samples.q, stretches[:, 0])))
    warning = (
        f"{run.name}: {len(stretches)} rests were found in {len(run)} samples; each is the mean of "
        f"{count.min()} to {count.max()} of them"
    )
    lost = _poses_without_rest(run.samples, samples)
    missing = (f"{run.name}: the arm did not rest at the poses {lost}; they are left out",) if lost else ()
    warnings = (*run.warnings, Aside(warning), *missing)
    return replace(run, samples=samples, readings=readings, continuous=False, warnings=warnings)


def marks_rests(run: Run) -> bool:
    """Return whether the numbers of poses in a dense log mark places of rest: the arm stands still in most of them."""
    pose = run.samples.pose
    if pose is None or run.samples.t is None:
        return False
    marked = np.unique(pose[pose >= 0])
    at_rest = np.unique(pose[_measured_rests(run.samples)[:, 0]])
    return len(marked) > 1 and 2 * len(at_rest) >= len(marked)


def _measured_rests(samples: Samples) -> IntArray:
    """Return the rests that are measurements: those with a pose's number where numbers are given, else all."""
    stretches = find_rests(samples)
    if samples.pose is None or not (samples.pose >= 0).any():
        return stretches
    return np.asarray(stretches[samples.pose[stretches[:, 0]] >= 0])


def _poses_without_rest(before: Samples, after: Samples) -> str:
    if before.pose is None or after.pose is None:
        return ""
    return ", ".join(str(p) for p in np.setdiff1d(before.pose[before.pose >= 0], after.pose))


def _average_stretches(values: T, stretches: IntArray) -> T:
    """Return one entry for each stretch: the mean of what is measured, the first of what is a number of something."""
    parts = {}
    for name in (f.name for f in fields(values)):
        value = getattr(values, name)
        if value is None:
            continue
        if name == "rotation":
            parts[name] = read_only([Rotation.from_matrix(value[a:b]).mean().as_matrix() for a, b in stretches])
        else:
            kept = _means(value, stretches) if name in MEANS else value[stretches[:, 0]]
            parts[name] = read_only(kept, kept.dtype)
    return replace(values, **parts)


def _means(value: Array, stretches: IntArray) -> Array:
    """Return the mean over each stretch, from differences to its first sample so that no digits are lost."""
    first = value[stretches[:, 0]]
    owner = np.repeat(np.arange(len(stretches)), np.diff(stretches, axis=1)[:, 0])
    rows = np.concatenate([np.arange(a, b) for a, b in stretches])
    away = value[rows] - first[owner]
    starts = np.searchsorted(owner, np.arange(len(stretches)))
    count = np.diff(stretches, axis=1).astype(float)
    return np.asarray(first + np.add.reduceat(away, starts, axis=0) / (count if value.ndim > 1 else count[:, 0]))


def go_on_past_turns(table: RunTable) -> RunTable:
    """Return a log in which angles that jump by whole turns between close samples go on instead, and a warning of it.

    Jumps that are none of whole turns are left, and are refused where a drive is read.
    """
    small_step = 0.5  # [rad] that a joint moves between close samples, where its angle jumps by a turn
    if not table.has("t"):
        return table
    close = np.abs(np.diff(table.array("t"))) < DENSE_STEP
    if table.has("session"):
        close &= np.diff(table.array("session")) == 0.0
    frame, turned = table.frame, list[str]()
    for joint in (j for j in range(1, table.n_joints + 1) if j not in table.slides):
        for key in (f"{stem}{joint}" for stem in ("q", "cmd") if table.has(f"{stem}{joint}")):
            q = table.array(key)
            turns = np.round(np.diff(q) / TURN)
            turns[~close | (np.abs(np.diff(q) - turns * TURN) > small_step)] = 0.0
            if turns.any():
                frame = frame.with_columns(pl.Series(key, q - TURN * np.append(0.0, np.cumsum(turns))))
                turned.append(table.source.headers.get(key, key))
    if not turned:
        return table
    said = f"{table.source.name}: {', '.join(turned)} jump by whole turns along the drive: they were taken to go on"
    return replace(table, frame=frame, warnings=(*table.warnings, said))


def bring_within_limits(run: Run, lower: Array, upper: Array, slides: np.ndarray) -> Run:
    """Return a run whose angles of 0 to 360 degrees stand within the limits of their joints, and a warning of it.

    A joint is changed where all its angles lie in 0 to 360 degrees, some beyond its limits, and a turn less brings each
    of these inside. The arm stands as before.

    Args:
        run: as it was read.
        lower, upper: limits of the joints, (N,) [rad].
        slides: which joints slide, (N,) bool.
    """
    s = run.samples
    moved = set[int]()
    q = _less_a_turn(s.q, lower, upper, slides, moved)
    q_cmd, q_read = (None if v is None else _less_a_turn(v, lower, upper, slides, moved) for v in (s.q_cmd, s.q_read))
    if not moved or s.number is not None:
        return run
    joints = ", ".join(str(j + 1) for j in sorted(moved))
    said = (
        f"{run.name}: the angles of joint {joints} are counted from 0 to 360 degrees: those beyond the joint's limits "
        "were taken for a turn less"
    )
    return replace(run, samples=replace(s, q=q, q_cmd=q_cmd, q_read=q_read), warnings=(*run.warnings, said))


def _less_a_turn(q: Array, lower: Array, upper: Array, slides: np.ndarray, moved: set[int]) -> Array:
    rounding = 0.01 * DEG  # [rad] to which logs and limits are written
    beyond = (q > upper + rounding) & ~slides
    counted = (q.min(axis=0) >= -rounding) & (q.max(axis=0) <= TURN + rounding)
    inside = ((q - TURN >= lower - rounding) | ~beyond).all(axis=0)
    columns = beyond.any(axis=0) & counted & inside
    moved |= set(np.flatnonzero(columns).tolist())
    return read_only(np.where(beyond & columns, q - TURN, q))
