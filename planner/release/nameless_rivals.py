"""A finding may be the part of a nameless cause that a name happens to fit.

Each finding is compared with single causes, with a name or without. A cause that acts by several laws at
once, as a hose that pulls at four joints does, loses each of these comparisons and is there nevertheless: what it moves
besides is then seen as misfit. Of what the catalogue has, nothing is left. The finding is such a part as likely as
there is misfit, times the share that the nameless has in what both move: a name that fits leaves little beside it.
What the gauge does by itself moves no tool: of it and of the nameless it is counted how far the readings move.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.effects.nonparametric import NONPARAMETRIC
from planner.effects.phi_keys import columns_of, depends_on_run
from planner.fit.assumptions import POSITION_AXES
from planner.fit.problem import FitProblem
from planner.inference.candidates import HUNDRED_TO_ONE, Candidate, Inclusion, Rival
from planner.inference.posterior_background import OF_BACKGROUND
from planner.release.error_parts import misfit_likelihood, misfit_motion
from planner.release.released_robot import ReleasedRobot


def with_nameless_rivals(
    released: ReleasedRobot, causes: Sequence[Candidate], standings: Sequence[Inclusion]
) -> list[Inclusion]:
    """Return the standings of causes, each held against what the run shows of nameless causes as well."""
    if not causes:
        return []
    chance = misfit_likelihood(released)
    beside = float(np.sqrt((misfit_motion(released) ** 2).mean()))
    along = min(released.fit.model.width, POSITION_AXES) / POSITION_AXES  # what a reading has of a motion of the tool
    out = []
    for cause, standing in zip(causes, standings, strict=True):
        moved, other = _motion(released, cause), beside
        if moved == 0.0:
            moved, other = _motion_of_readings(released, cause), beside * float(np.sqrt(along))
        share = chance * other / (other + moved) if moved > 0.0 else 0.0
        out.append(_share_out(standing, share, cause.name.removesuffix(OF_BACKGROUND)))
    return out


def _motion(released: ReleasedRobot, cause: Candidate) -> float:
    """Return how far a cause moves the tool over the workspace, rms [m], the base aligned anew; 0: not at all."""
    tool, values = released.tool, released.posterior.fit.values
    own = {p.name: values[p.name] for p in cause.parameters if p.name in values}
    errors = np.array([own.get(name, 0.0) for name in tool.names])
    return float(np.sqrt(tool.square(errors[:, None]).mean()))


def _motion_of_readings(released: ReleasedRobot, cause: Candidate) -> float:
    """Return how far a cause of the gauge moves the positions that are read, rms [m]; 0: by time or speed alone.

    What has no name is looked for by joint angles and loads.
    """
    record, values = released.posterior.record, released.posterior.fit.values
    own = tuple(p for p in cause.parameters if p.name in values)
    keys = [m.phi.key for p in own for m in p.moves]
    if any(columns_of(key) or depends_on_run(key) for key in keys):
        return 0.0
    problem = FitProblem.of(replace(record.model.fix_at(record.errors), parameters=own), record.run)
    rows = problem.linearize(np.zeros(len(own))).rows[:, :POSITION_AXES]
    moved = rows @ np.array([values[p.name] for p in own])
    return float(np.sqrt((moved**2).sum(axis=1).mean()))


def _share_out(standing: Inclusion, nameless: float, name: str) -> Inclusion:
    """Return a standing of which a nameless cause takes a share, as the rival without a name that it has or a new one.

    What is less than a hundred to one against it is left out, as of other rivals.
    """
    if nameless < HUNDRED_TO_ONE:
        return standing
    left = [Rival(r.name, (1 - nameless) * r.probability) for r in standing.rivals]
    taken = nameless * (standing.probability + sum(r.probability for r in standing.rivals))
    here = next((k for k, r in enumerate(left) if r.name.startswith(f"{NONPARAMETRIC}, ")), None)
    if here is None:
        left.append(Rival(f"{NONPARAMETRIC}, {name.partition(', ')[2] or 'arm'}", taken))
    else:
        left[here] = Rival(left[here].name, left[here].probability + taken)
    return Inclusion((1 - nameless) * standing.probability, tuple(sorted(left, key=lambda r: -r.probability)))
