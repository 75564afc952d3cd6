"""Joint angles that a log counts within one turn: a drive goes on past its end, poses stand where the arm can stand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from planner.common.lazy_modules import pl
from planner.common.units import DEG, TURN, Array, read_only
from planner.runs.joint_motion import DENSE_STEP
from planner.runs.run import Run
from planner.runs.table import RunTable


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
