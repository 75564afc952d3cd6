"""What is said of a step or a wrong row: when, where in the log, and what the row would have to be."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from planner.common.units import MM, Array
from planner.effects.steps import STEP
from planner.runs.run import Run
from planner.tracing.change_points import change_sample, locate_step
from planner.tracing.state import FittedEffect, SearchState

DECIMALS = 3  # of a reading in millimetres
SIGMAS = 4.0  # within which a slip of the pen must give the expected reading


@dataclass(frozen=True)
class ChangeNote:
    """When a change was: samples before it, the range of samples that surely holds it, or the row that is wrong."""

    note: str
    after_sample: int | None = None
    surely_within: tuple[int, int] | None = None
    row: int | None = None


def describe_change(state: SearchState, found: FittedEffect, sentence: str, run: Run) -> ChangeNote:
    """Return what is said of a change; ``sentence`` tells what changed and by how much."""
    sample = change_sample(found)
    number = run.samples.number
    assert sample is not None
    assert number is not None
    if found.effect.kind != STEP:
        return _wrong_row(state, found, sentence, run, int(np.searchsorted(number, sample)))
    when = locate_step(state, found)
    last = int(np.searchsorted(number, sample)) - 1  # the last one before
    where = f" ({run.where(last)})" if run.samples.file is not None else ""
    note = sentence.replace(f"after sample {sample} ", f"after sample {sample}{where} ", 1)
    if when.last - when.first > 1:
        note += f"; it was surely between samples {when.first} and {when.last + 1}"
    return ChangeNote(note, sample, (when.first, when.last + 1))


def _wrong_row(state: SearchState, found: FittedEffect, sentence: str, run: Run, k: int) -> ChangeNote:
    """Say which row is wrong, what it reads and what it would have to read."""
    error, row = state.sizes(found), int(np.asarray(run.samples.number)[k]) + 1
    where = run.where(k) if run.samples.file is not None else f"row {row}"
    std = np.linalg.norm(state.fit.solution.root(state.fit.problem.prior)[state.positions(found)], axis=1)
    parts = [
        f"{column} reads {read:.{DECIMALS}f}, would have to be {read - off:.{DECIMALS}f} ± {sigma:.2g} mm"
        + (f" ({slip})" if (slip := slip_of_the_pen(read, read - off, SIGMAS * sigma)) else "")
        for column, read, off, sigma in _columns(state, run, k, error / MM, std / MM)
    ]
    if not parts:
        return ChangeNote(f"{where}: {sentence}", row=row)
    other = _exchanged_with(state, found, run, k, 2 * SIGMAS * float(std[0]))
    cause = "or its pose is wrong" if other is None else f"as if exchanged with {run.where(other)}"
    return ChangeNote(f"{where}: {'; '.join(parts)}; {cause}", row=row)


def _exchanged_with(state: SearchState, found: FittedEffect, run: Run, k: int, tolerance: float) -> int | None:
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
    R_GB = state.fit.model.setup.R_BG[run.samples.place[k]].T
    off, sigma = R_GB @ error[:3], np.sqrt((R_GB**2) @ std[:3] ** 2)
    return [
        (f"{axis}_mm", float(position[k, a]) / MM, float(off[a]), float(sigma[a]))
        for a, axis in enumerate("xyz") if abs(off[a]) > max(SIGMAS * sigma[a], 0.1 * float(np.abs(off).max()))
    ]  # fmt: skip


def slip_of_the_pen(read: float, wanted: float, tolerance: float) -> str:
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
