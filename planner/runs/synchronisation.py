"""Two logs of one run, the gauge's and the controller's, brought together by time or by pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.common.errors import InputError
from planner.common.lazy_modules import pl
from planner.common.units import Array, IntArray
from planner.runs.joint_motion import DENSE_STEP, go_on_past_turns
from planner.runs.quantities import check_jumps, has_reading
from planner.runs.table import NAMES, WHOLE, RunTable, split_key
from planner.runs.text import first_row


@dataclass(frozen=True)
class AlignedClocks:
    """What the readings say of two clocks: add ``seconds`` to the gauge's.

    ``left`` is the share of the readings' variance that stays unexplained there, ``rival`` the least elsewhere.
    """

    seconds: float
    left: float
    rival: float


def align_clocks(t_gauge: Array, reading: Array, t_axes: Array, q: Array) -> AlignedClocks | None:
    """Return the offset at which readings (n, r) [m] fit angles (m, N) [rad] best; ``None`` where that is not sure.

    Args:
        t_gauge, t_axes: the times of both, (n,) and (m,) [s], each rising.
        reading: what the gauge read.
        q: the angles.
    """
    stretch = 0.6  # share of the angles' time that is compared; the rest is room for the shift
    length = t_axes[-1] - t_axes[0]
    room = (1 - stretch) / 2 * length
    # 3000: samples of the stretch that is compared
    step = max(length * stretch / 3000, float(np.median(np.diff(t_axes))), float(np.median(np.diff(t_gauge))))
    start = t_axes[0] + room
    grid = start + step * np.arange(int(stretch * length / step))
    overlap = min(t_gauge[-1], t_axes[-1]) - max(t_gauge[0], t_axes[0])
    guess = 0.0 if overlap > stretch * min(length, t_gauge[-1] - t_gauge[0]) else t_axes[0] - t_gauge[0]
    waves = _waves(np.stack([np.interp(grid, t_axes, a) for a in q.T], axis=1))
    if len(grid) < 8.0 * waves.shape[1]:  # samples a wave of the fit, below which anything fits
        return None
    shifts = step * np.arange(-int(room / step), int(room / step) + 1)
    linear = reading if reading.shape[1] > 1 else reading**2
    left = _remaining_variance(waves, grid, step, len(shifts) // 2, t_gauge + guess, linear)
    return _judge(left, shifts, guess)


def _waves(q: Array) -> Array:
    """Orthonormal columns (n, k) that span 1, the sines and cosines of angles (n, N), and products of two of them."""
    moving = q[:, np.ptp(q, axis=0) > 1e-3]
    single = np.concatenate([np.cos(moving), np.sin(moving)], axis=1)
    n = moving.shape[1]
    pairs = [single[:, i] * single[:, j] for i in range(2 * n) for j in range(i + 1, 2 * n) if (j - i) % n]
    columns = np.stack([np.ones(len(q)), *single.T, *pairs], axis=1)
    U, size, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(U[:, size > 1e-6 * size[0]])


def _remaining_variance(waves: Array, grid: Array, step: float, reach: int, t: Array, reading: Array) -> Array:
    """Share of the readings' variance that the waves leave at each shift of −reach … reach steps, (2·reach + 1,)."""
    from scipy.signal import correlate

    wide = grid[0] + step * np.arange(-reach, len(grid) + reach)
    inside = (wide >= t[0]) & (wide <= t[-1])
    x = np.stack([np.interp(wide, t, r) for r in reading.T], axis=1)
    x = np.where(inside[:, None], x - x[inside].mean(axis=0), 0.0)
    count = np.convolve(inside, np.ones(len(grid)), "valid")
    explained, whole = np.zeros(2 * reach + 1), np.zeros(2 * reach + 1)
    for one in x.T:
        explained += sum(correlate(one, wave, "valid") ** 2 for wave in waves.T)
        whole += np.convolve(one**2, np.ones(len(grid)), "valid")
    left = 1.0 - explained / np.maximum(whole, 1e-300)
    return np.asarray(np.where(count == len(grid), left, np.nan)[::-1])  # later readings: an earlier clock


def _judge(left: Array, shifts: Array, guess: float) -> AlignedClocks | None:
    """Take the best shift, refined by a parabola, where no other comes near and it is not at the end of the room."""
    sure = 3.0  # times more is left of the variance at any shift that is not next to the best, and without a shift
    smallest = 0.1  # [s] offsets below are left to the fit, as the gauge's lag
    if np.isnan(left).all():
        return None
    best = int(np.nanargmin(left))
    if not 0 < best < len(left) - 1 or np.isnan(left[best - 1 : best + 2]).any():
        return None
    below, at, above = left[best - 1 : best + 2]
    step = shifts[1] - shifts[0]
    curve = below - 2 * at + above
    seconds = guess + shifts[best] + (0.5 * step * (below - above) / curve if curve > 0 else 0.0)
    beside = np.abs(shifts - shifts[best]) < _width(left, best) * step
    rival = float(np.nanmin(np.where(beside, np.nan, left), initial=1.0))
    found = AlignedClocks(float(seconds), float(at), rival)
    return found if rival > sure * at and abs(seconds) > smallest else None


def _width(left: Array, best: int) -> int:
    """Steps from the best shift to where the share stops rising on either side: the valley that it lies in."""
    width = 1
    for side in (left[best:], left[best::-1]):
        fall = np.flatnonzero(~(np.diff(side) > 0))
        width = max(width, int(fall[0]) + 1 if len(fall) else len(side))
    return width


def rising_edges(t: Array, mark: Array) -> Array:
    """Return the times (k,) [s] at which a mark (n,) of 0 and 1 rises: half way between the two samples."""
    rise = 1 + np.flatnonzero((mark[1:] > 0.5) & (mark[:-1] <= 0.5))
    return np.asarray(0.5 * (t[rise] + t[rise - 1]))


@dataclass(frozen=True)
class ClockOffset:
    """What the marks say of two clocks: add ``seconds`` to the gauge's; ``marks`` agree on it, within ``rms`` [s]."""

    seconds: float
    marks: int
    rms: float


def edge_offset(gauge: Array, axes: Array, reach: float) -> ClockOffset:
    """Return the offset at which most marks of two logs meet.

    Every pair of marks proposes an offset. The window of ``reach`` [s] that holds most proposals wins, so that a mark
    lost in either log does no harm. The offset is the median in it.

    Args:
        gauge: times of the marks by the gauge's clock, (j,) [s].
        axes: by the controller's, (k,) [s].
        reach: the resolution of a mark, the sum of both logs' steps of time [s].

    Raises:
        InputError: a log has no mark, the marks do not belong together, or fit as well at another offset.
    """
    if len(gauge) == 0 or len(axes) == 0:
        raise InputError("the column sync never rises from 0 to 1")
    proposed = np.sort(np.subtract.outer(axes, gauge).ravel())
    end = np.searchsorted(proposed, proposed + reach, side="right")
    agreeing = end - np.arange(len(proposed))
    count = int(agreeing.max())
    if 2 * count < min(len(gauge), len(axes)):
        raise InputError(
            f"the sync marks do not belong together: of {len(gauge)} in one log and {len(axes)} in the other "
            f"{count} meet"
        )
    best = np.flatnonzero(agreeing == count)
    first = int(best[np.argmin(proposed[end[best] - 1] - proposed[best])])
    found = proposed[first : end[first]]
    offset = float(np.median(found))
    rivals = proposed[best][np.abs(proposed[best] - offset) > 2.0 * reach]
    if len(rivals):
        raise InputError(
            f"the sync marks fit as well at an offset of {offset:g} s as at {rivals[0]:g} s; "
            "marks at uneven times, or none lost at either end, would tell"
        )
    return ClockOffset(offset, count, float(np.sqrt(np.mean((found - offset) ** 2))))


SMOOTH = frozenset({"q", "cmd"})  # interpolated by cubics, as a drive's path is smooth; the rest by straight lines


def synchronise_tables(gauge: RunTable, axes: RunTable) -> RunTable:
    """Return one table with the gauge's readings and the controller's angles.

    With ``t_s`` in both and angles logged closely, the angles are interpolated at the gauge's stamps (cubic Hermite) on
    the controller's clock. The clocks' offset comes from the marks in ``sync`` where both have them, else from the
    readings where they tell it (:mod:`planner.runs.synchronisation`), else it is taken for 0 with a warning. What is
    finer than that is the gauge's lag, a parameter of the fit. With ``pose`` in both and one row a pose, rows are
    matched by it.

    Raises:
        InputError: the logs cannot be joined in either way, do not overlap, or a clock does not go forward.
    """
    both = f"{gauge.source.file} and {axes.source.file}"
    timed = gauge.has("t") and axes.has("t") and _time_step(axes) < DENSE_STEP
    if timed:
        return _by_time(gauge, axes)
    if gauge.has("pose") and axes.has("pose"):
        return _by_pose(gauge, axes)
    if gauge.has("t") and axes.has("t"):
        raise InputError(
            f"{axes.source.file}: joint angles stand {_time_step(axes):g} s apart, too far to be interpolated "
            f"(less than {DENSE_STEP:g} s is needed, or a column pose in both files)"
        )
    cure = (
        f'; both have {gauge.frame.height} rows: if each row belongs to the one beside it, write join = "rows" at the '
        "head of the map"
    )
    more = cure if gauge.frame.height == axes.frame.height else ""
    raise InputError(f"{both} cannot be joined: both need a column t_s, or both a column pose{more}")


def _time_step(table: RunTable) -> float:
    t = table.array("t")
    return float(np.median(np.abs(np.diff(t)))) if len(t) > 1 else np.inf


def _by_time(gauge: RunTable, axes: RunTable) -> RunTable:
    axes = go_on_past_turns(axes)
    t_axes, t_gauge = _forward_time(axes), _forward_time(gauge)
    check_jumps(axes, axes.n_joints)
    offset, said = _offset(gauge, axes, t_gauge, t_axes)
    t = t_gauge + offset
    inside = np.flatnonzero((t >= t_axes[0]) & (t <= t_axes[-1]))
    if len(inside) == 0:
        raise InputError(
            f"{gauge.source.file} lasts from {t[0]:g} s to {t[-1]:g} s, {axes.source.file} from {t_axes[0]:g} s to "
            f"{t_axes[-1]:g} s: they do not overlap; a column sync in both would tell the offset of their clocks"
        )
    if len(inside) < len(t):
        said.append(
            f"{gauge.source.name}: {len(t) - len(inside)} of {len(t)} readings lie outside the time of "
            f"{axes.source.name} and were left out"
        )
    frame = gauge.frame[inside].with_columns(pl.Series("t", t[inside]))
    others = [key for key in axes.frame.columns if key not in (*gauge.frame.columns, "t", "sync")]
    frame = frame.with_columns(_column_at(axes, key, t_axes, t[inside]) for key in others)
    merged = _merge_tables(gauge, axes, frame, inside, said)
    return replace(merged, notes={**merged.notes, "clocks": "2"})


def _forward_time(table: RunTable) -> Array:
    t = table.array("t")
    if (row := first_row(np.diff(t) <= 0.0)) is not None:
        clock = f"the clock goes from {t[row]:g} s to {t[row + 1]:g} s"
        raise table.source.error(row + 1, "t", f"{clock}; logs are joined by time only where it goes forward")
    return t


def _offset(gauge: RunTable, axes: RunTable, t_gauge: Array, t_axes: Array) -> tuple[float, list[str]]:
    """Return what is to be added to the gauge's clock [s], and a sentence on where it comes from."""
    names = f"{gauge.source.name} and {axes.source.name}"
    if not (gauge.has("sync") and axes.has("sync")):
        found = _by_readings(gauge, axes, t_gauge, t_axes)
        if found is not None:
            return found.seconds, [
                f"{names}: {found.seconds:.3f} s was added to the gauge's clock, as there is no column sync in both: "
                f"there the readings fit the angles best ({found.left:.2%} of their variance is left, at any other "
                f"offset {found.rival:.1%} or more)"
            ]
        return 0.0, [
            f"{names}: no column sync in both, so the clocks are taken for the same. "
            "The fit finds a small offset as the gauge's lag, not a large one"
        ]
    g, a = (rising_edges(t, table.array("sync")) for t, table in ((t_gauge, gauge), (t_axes, axes)))
    try:
        marked = edge_offset(g, a, _time_step(gauge) + _time_step(axes))
    except InputError as err:
        raise InputError(f"{gauge.source.file} and {axes.source.file}: {err}") from err
    return marked.seconds, [
        f"{names}: {marked.seconds:.6f} s was added to the gauge's clock; {marked.marks} sync marks agree on it "
        f"(RMS {1e3 * marked.rms:.3f} ms)"
    ]


def _by_readings(gauge: RunTable, axes: RunTable, t_gauge: Array, t_axes: Array) -> AlignedClocks | None:
    read = [gauge.array(key) for key in ("length", "x", "y", "z") if gauge.has(key)]
    stem = "q" if axes.has("q1") else "cmd"
    angles = [axes.array(f"{stem}{i}") for i in range(1, axes.n_joints + 1) if axes.has(f"{stem}{i}")]
    if not read or len(angles) < axes.n_joints:
        return None
    return align_clocks(t_gauge, np.stack(read, axis=1), t_axes, np.stack(angles, axis=1))


def _column_at(axes: RunTable, key: str, t_axes: Array, t: Array) -> pl.Series:
    """Return a column of the controller at the stamps ``t`` [s] (all within its time)."""
    stem = split_key(key)[0]
    if stem in NAMES | WHOLE:
        return axes.frame[key].gather(np.searchsorted(t_axes, t, side="right") - 1)
    values = axes.array(key)
    if stem not in SMOOTH or len(values) < 3:
        return pl.Series(key, np.interp(t, t_axes, values))
    from scipy.interpolate import CubicHermiteSpline

    return pl.Series(key, CubicHermiteSpline(t_axes, values, np.gradient(values, t_axes, edge_order=2))(t))


def _by_pose(gauge: RunTable, axes: RunTable) -> RunTable:
    """Match rows by the number of the pose, visits of one pose in their order."""
    g, a = (
        table.frame.with_columns(
            pl.int_range(pl.len()).over("pose").alias("#visit"), pl.int_range(pl.len()).alias("#row")
        )
        for table in (gauge, axes)
    )
    twice = (
        g.group_by("pose")
        .len("g")
        .join(a.group_by("pose").len("a"), on="pose")
        .filter(pl.col("g") != pl.col("a"))
        .sort("pose")
    )
    if twice.height:
        pose, in_g, in_a = twice.row(0)
        raise InputError(
            f"pose {pose:g} stands {in_g} times in {gauge.source.file} and {in_a} times in {axes.source.file}; "
            "which reading belongs to which angles cannot be told"
        )
    others = [key for key in axes.frame.columns if key not in gauge.frame.columns]
    frame = g.join(a.select("pose", "#visit", *others), on=["pose", "#visit"], how="inner").sort("#row")
    if frame.height == 0:
        raise InputError(f"{gauge.source.file} and {axes.source.file} have no pose in common")
    said = [
        f"{table.source.name}: {table.frame.height - frame.height} of {table.frame.height} rows have no partner of "
        "their pose and were left out"
        for table in (gauge, axes)
        if table.frame.height > frame.height
    ]
    return _merge_tables(gauge, axes, frame.drop("#visit", "#row"), frame["#row"].to_numpy(), said)


def _merge_tables(gauge: RunTable, axes: RunTable, frame: pl.DataFrame, rows: IntArray, said: list[str]) -> RunTable:
    source = replace(gauge.source.take(rows), headers={**gauge.source.headers, **axes.source.headers})
    twice = sorted((set(gauge.frame.columns) & set(axes.frame.columns)) - {"t", "sync", "pose"})
    if twice:
        said.append(
            f"{axes.source.name}: {', '.join(twice)} stand in both files; those of {gauge.source.name} are used"
        )
    return RunTable(
        source,
        frame,
        {**axes.units, **gauge.units},
        {**axes.notes, **gauge.notes},
        (*gauge.warnings, *axes.warnings, *said),
    )


def _by_row(gauge: RunTable, axes: RunTable) -> RunTable:
    """Match rows by their order.

    Raises:
        InputError: one log has more rows than the other, or their poses have other numbers.
    """
    n, m = gauge.frame.height, axes.frame.height
    files = f"{gauge.source.file} has {n} rows, {axes.source.file} has {m}"
    if n != m:
        raise InputError(f"{files}: they are joined row by row only where both have as many; which rows are missing?")
    if gauge.has("pose") and axes.has("pose") and (gauge.frame["pose"] != axes.frame["pose"]).any():
        raise InputError(f"{files}, but their poses have other numbers: leave out join, and they are joined by these")
    others = [key for key in axes.frame.columns if key not in gauge.frame.columns]
    frame = pl.concat([gauge.frame, axes.frame.select(others)], how="horizontal")
    return _merge_tables(gauge, axes, frame, np.arange(n), [])


def pair_tables(tables: Sequence[RunTable], by_rows: bool = False) -> list[RunTable]:
    """Return whole tables in their order, a gauge's log joined with the controller's that is given with it.

    The first log without angles goes with the first without a reading, the second with the second. ``by_rows``: they
    are joined row by row.

    Raises:
        InputError: a half has no partner, or the two cannot be joined.
    """
    gauges = [t for t in tables if has_reading(t) and not t.n_joints]
    axes = [t for t in tables if t.n_joints and not has_reading(t)]
    if not gauges or not axes:
        return list(tables)  # what is missing in them is said where the run is made
    if len(gauges) != len(axes):
        raise InputError(
            f"{', '.join(t.source.file for t in gauges)}: readings without joint angles; "
            f"{', '.join(t.source.file for t in axes)}: joint angles without readings; "
            "each of the one needs one of the other"
        )
    partner = dict(zip((t.source.file for t in gauges), axes, strict=True))
    alone = {t.source.file for t in axes}
    join = _by_row if by_rows else synchronise_tables
    return [
        join(t, partner[t.source.file]) if t.source.file in partner else t for t in tables if t.source.file not in alone
    ]
