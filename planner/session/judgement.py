"""The one judgement before a program leaves the planner: the whole drive of the neutral program is proven."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from planner.cell.cell import Cell
from planner.common.advice import Occasion, advice
from planner.common.errors import MissingProgramError, NoSolutionError
from planner.common.units import Array
from planner.motion.path.constraints import Constraints
from planner.motion.path.verdict import Motions, Verdict, judge_motions
from planner.motion.planning_packages import has_judges
from planner.programs.instructions import Program
from planner.session.driven_motion import NO_BALL, Held, recover_motion, unreleased_error
from planner.session.motion_hulls import Hulls, motion_hulls


def judge_program(cell: Cell, program: Program) -> tuple[Verdict, Verdict]:
    """Prove with both collision engines all that a program drives, from home to its end and on the ways to its starts.

    The motion is recovered from the program alone: targets, cut corners, circles, where the gauge is attached, which
    ball is touched. Of the plan that it was made of nothing is taken over.

    Returns:
        What coal says, and what python-fcl says; both are clear. Their clearance is the smallest seen, no bound.

    Raises:
        NoSolutionError: a motion is not proven, or one does not begin where the one before ended.
    """
    constraints: dict[Held, Constraints] = {}
    parts: dict[Held, list[Hulls]] = {}
    for chain in recover_motion(cell, program):
        kept = _constraints(cell, chain.held, constraints)
        found = motion_hulls(chain, kept.cell.map_position, partial(_seem_proven, kept))
        parts.setdefault(chain.held, []).extend(found)
    verdicts = judge_motions([m for held, found in parts.items() for m in _motions(constraints[held], found)])
    for v in verdicts:
        if not v.clear:
            # 3: motions that are named
            raise unreleased_error(
                f"{v.engine} does not prove {len(v.failures)} of its motions ({'; '.join(v.failures[:3])}); "
                "plan again, and where nothing was changed with another --seed"
            )
    return verdicts


def _seem_proven(constraints: Constraints, corners: Array) -> np.ndarray:
    """Tell which hulls (m, K, N) [rad] keep the constraints, by the quick distances of a search, (m,) bool."""
    return constraints.prove_corners(corners).proven


def judge_plan(path: Path, cell: Cell, program: Program, notes: Sequence[str], proven: bool) -> tuple[str, ...]:
    """Judge the program of the plan at ``path``; return the notes for a plan that was changed by hand and still holds.

    Where the collision engines are not installed nothing is judged: a program is trusted then if it is one that they
    have proven, which is said, and refused otherwise.

    Args:
        path: of ``plan.json``, for messages.
        cell, program: as for :func:`judge_program`.
        notes: what was changed, nothing for a plan that is as it was written.
        proven: whether what drives the same was proven when the plan was written.

    Raises:
        NoSolutionError: it is not proven.
        MissingProgramError: it would have to be proven here, and the engines are not installed.
    """
    if not has_judges():
        return _trust_plan(path, notes, proven)
    try:
        judge_program(cell, program)
    except NoSolutionError as err:
        because = f" ({'; '.join(notes)})" if notes else ""
        raise NoSolutionError(f"{path}: {err}{because}") from err
    return tuple(f"{note}; its path was proven anew by both engines" for note in notes)


NOT_JUDGED = (
    "this program was not judged anew where it was written, no collision engine is installed there: plan and cell are, "
    "by their hashes, those whose drive both engines proved when it was planned"
)


def _trust_plan(path: Path, notes: Sequence[str], proven: bool) -> tuple[str, ...]:
    """Return the note for a program that cannot be judged here; refuse one that differs from the proven path.

    Raises:
        MissingProgramError: it differs.
    """
    if notes:
        differs = "; ".join(notes)
    elif not proven:
        differs = f"{path}: no program was proven with it that drives as this dialect does"
    else:
        return (NOT_JUDGED,)
    raise MissingProgramError(
        f"{differs}; it would have to be proven anew by both collision engines, which are not installed here: export "
        f"it where they are{advice(Occasion.PROVING_ELSEWHERE)}"
    )


def _motions(constraints: Constraints, found: Sequence[Hulls]) -> Iterator[Motions]:
    """Yield the distinct motions under one set of constraints, those of as many corners together."""
    found = [h for h in found if len(h.number)]
    for K in sorted({h.corners.shape[1] for h in found}):
        same = [h for h in found if h.corners.shape[1] == K]
        corners = _one_way(np.concatenate([h.corners for h in same]))
        names = [name for h in same for name in h.names()]
        new = np.sort(np.unique(corners.reshape(len(corners), corners[0].size), axis=0, return_index=True)[1])
        yield Motions(constraints, corners[new], new, [names[k] for k in new])


def _constraints(cell: Cell, held: Held, made: dict[Held, Constraints]) -> Constraints:
    """Return the constraints while the gauge is held so; a cable's twist counts from where it was attached."""
    if held not in made:
        away = replace(held, ball=NO_BALL)
        if away not in made:
            here = cell.with_mount(held.mounting, np.deg2rad(held.mount_deg)) if held.attached else cell
            made[away] = Constraints(here, held.mounting, bar=held.attached)
        made[held] = made[away] if held.ball == NO_BALL else made[away].at_ball(held.ball)
    return made[held]


def _one_way(corners: Array) -> Array:
    """Turn hulls (m, K, N) round that begin at the larger of their two ends: driven back they are the same."""
    first, last = corners[:, 0], corners[:, -1]
    axis = np.argmax(first != last, axis=1)
    rows = np.arange(len(corners))
    back = first[rows, axis] > last[rows, axis]
    return np.where(back[:, None, None], corners[:, ::-1], corners)
