"""A row of a run that is wrong: what it reads, what it would have to read, and which slip of a person made it so."""

from itertools import pairwise

import numpy as np

from planner.common.units import MM, Array
from planner.runs.run import Run
from planner.tracing.assumptions import OTHER_BALL_SHARE, SLIP_SIGMAS
from planner.tracing.change_points import change_sample
from planner.tracing.state import FittedEffect, SearchState

DECIMALS = 3  # of a reading in millimetres


def describe_wrong_row(state: SearchState, found: FittedEffect, sentence: str, run: Run, k: int) -> str:
    """Say which row is wrong, what it reads and what it would have to read."""
    error = state.sizes(found)
    where = run.where(k) if run.samples.file is not None else f"row {int(np.asarray(run.samples.number)[k]) + 1}"
    std = np.linalg.norm(state.fit.solution.root(state.fit.problem.prior)[state.positions(found)], axis=1)
    parts = [
        f"{column} reads {read:.{DECIMALS}f}, would have to be {read - off:.{DECIMALS}f} ± {sigma:.2g} mm"
        + (f" ({slip})" if (slip := find_slip(read, read - off, SLIP_SIGMAS * sigma)) else "")
        for column, read, off, sigma in _columns(state, run, k, error / MM, std / MM)
    ]
    if not parts:
        return f"{where}: {sentence}{_ball_it_would_be(state, run, k, error)}"
    other = _find_exchanged_row(state, found, run, k, 2 * SLIP_SIGMAS * float(std[0]))
    cause = "or its pose is wrong" if other is None else f"as if exchanged with {run.where(other)}"
    return f"{where}: {'; '.join(parts)}; {cause}"


def _ball_it_would_be(state: SearchState, run: Run, k: int, error: Array) -> str:
    """Say in which other ball or socket the tool point of row ``k`` was, which is off by ``error`` (3,) [m]."""
    setup, ball = state.fit.setup, run.readings.ball
    if ball is None or len(error) != len(setup.p_GS[0]):
        return ""
    p_BS = setup.p_GS @ setup.R_BG[run.samples.place[k]].T  # of one plate, differences count alone
    apart = np.linalg.norm(p_BS - (p_BS[ball[k]] - error), axis=1)
    nearest = int(np.argmin(apart))
    near = nearest != ball[k] and apart[nearest] < OTHER_BALL_SHARE * np.linalg.norm(error)
    return f": its ball would be '{setup.ball_names[nearest]}'" if near else ""


def _find_exchanged_row(state: SearchState, found: FittedEffect, run: Run, k: int, tolerance: float) -> int | None:
    """Return the other wrong row whose length this one should have, and the other way round."""
    length, number = run.readings.length, np.asarray(run.samples.number)
    if length is None:
        return None
    for other in state.effects:
        if other.effect.kind != found.effect.kind or other.name == found.name:
            continue
        j = int(np.searchsorted(number, change_sample(other) or 0))
        gap = length[k] - length[j]
        if max(abs(gap - state.sizes(found)[0]), abs(-gap - state.sizes(other)[0])) < tolerance:
            return j
    return None


def _columns(state: SearchState, run: Run, k: int, error: Array, std: Array) -> list[tuple[str, float, float, float]]:
    """Columns that are wrong: name, what was read, by how much it is off, and how well that is known [mm]."""
    length, position = run.readings.length, run.readings.position
    if length is not None:
        return [("length_mm", float(length[k]) / MM, float(error[0]), float(std[0]))]
    if position is None:
        return []
    R_GB = state.fit.setup.R_BG[run.samples.place[k]].T
    off, sigma = R_GB @ error[:3], np.sqrt((R_GB**2) @ std[:3] ** 2)
    return [
        (f"{axis}_mm", float(position[k, a]) / MM, float(off[a]), float(sigma[a]))
        for a, axis in enumerate("xyz") if abs(off[a]) > max(SLIP_SIGMAS * sigma[a], 0.1 * float(np.abs(off).max()))
    ]  # fmt: skip


def find_slip(read: float, wanted: float, tolerance: float) -> str:
    """Return which slip of sign, point or digits made ``read`` of ``wanted`` [mm], within the tolerance; or ''."""
    text = f"{abs(read):.{DECIMALS}f}"
    if abs(-read - wanted) < tolerance:
        return "its sign was lost"
    for k, (a, b) in enumerate(pairwise(text)):
        other = text[:k] + b + a + text[k + 2 :]
        if a != b and "." not in (a, b) and abs(np.copysign(float(other), read) - wanted) < tolerance:
            return f"'{a}{b}' for '{b}{a}'"
    if any(abs(read * factor - wanted) < tolerance * max(1.0, factor) for factor in (10.0, 0.1)):
        return "its point stands one place off"
    for k, a in enumerate(text):
        for b in "0123456789" if a != "." else "":
            if a != b and abs(np.copysign(float(text[:k] + b + text[k + 1 :]), read) - wanted) < tolerance:
                return f"'{a}' for '{b}'"
    return ""
