"""Of what the stated error over the workspace is made, and where what has no name moves the tool."""

from collections.abc import Collection
from itertools import pairwise

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from planner.common.units import Array
from planner.effects.drift_shapes import IN_TIME
from planner.identification.assumptions import LOCAL_RATIO, MISFIT_PROBABILITY, POSITION_AXES, UNSEEN_READINGS_RATIO
from planner.identification.posterior_background import OF_BACKGROUND, UNNAMED
from planner.identification.posterior_fit import PosteriorFit
from planner.identification.released_robot import ReleasedRobot
from planner.model.identification_document import ErrorParts
from planner.model.misfit_place import MisfitPlace, MisfitRange


def error_parts(released: ReleasedRobot) -> ErrorParts:
    """Return the parts of the stated error [m]; their squares add up to its square.

    What is named and what is not hang together: each is counted as its own scatter is of both.
    """
    known, tool, misfit = released.posterior, released.tool, released.misfit
    here = {name: k for k, name in enumerate(known.fit.model.names)}
    at = [k for k, name in enumerate(tool.names) if name in here]
    which, weight = [here[tool.names[k]] for k in at], tool.gram[np.ix_(at, at)] / len(tool.q)
    off = (known.drawn - known.fit.errors[:, None])[which]
    unnamed = np.array([known.fit.model.names[k].startswith(UNNAMED) for k in which])[:, None]
    own, other = (_trace(weight, off * part) for part in (unnamed, ~unnamed))
    share = own / max(own + other, 1e-300)
    all_square = _trace(weight, off) / off.shape[1]
    beyond = misfit.rest_square + all_square * (float((misfit.stretch**2).mean()) - 1 + share)
    whole = max(float((released.expected_errors(released.fit) ** 2).mean()), 1e-300)
    drift = min(released.drift_rms**2, whole)
    beyond = min(beyond, whole - drift)
    unseen = min((1 - share) * min(_trace(weight, _root_after_many(known)[which]), all_square), whole - drift - beyond)
    parts = (
        np.sqrt(np.maximum([whole - drift - beyond - unseen, unseen, beyond, drift], 0.0) / whole) * released.anywhere
    )
    return ErrorParts(seen=float(parts[0]), unseen=float(parts[1]), misfit=float(parts[2]), drift=float(parts[3]))


def drift_counts(parts: ErrorParts) -> bool:
    """Tell whether drift is worth speaking of: without it 5 % less would be stated."""
    return _counts(parts.drift, parts)


def misfit_counts(parts: ErrorParts) -> bool:
    """Tell the same of misfit."""
    return _counts(parts.misfit, parts)


def _counts(one: float, parts: ErrorParts) -> bool:
    return one**2 > 0.1 * (parts.seen**2 + parts.unseen**2 + parts.misfit**2 + parts.drift**2)


def _trace(weight: Array, columns: Array) -> float:
    return float((columns * (weight @ columns)).sum())


def _root_after_many(known: PosteriorFit) -> Array:
    """Return a root (P, P) of the covariance after MANY times as many readings at the same poses."""
    size = np.sqrt((known.mixture.scaled_sizes**2).mean(axis=0))
    information = UNSEEN_READINGS_RATIO * size[:, None] * known.gram[:-1, :-1] * size + np.eye(len(size))
    root = solve_triangular(cholesky(information, lower=True), np.diag(size * known.fit.problem.prior), lower=True)
    return np.asarray(root.T)


def misfit_likelihood(released: ReleasedRobot) -> float:
    """Return the probability that something acts that has no name: of a family of the background, or of the rest."""
    static = (f for f in released.posterior.families if not f.name.removesuffix(OF_BACKGROUND).endswith(IN_TIME))
    families = [f.probability for f in static if f.name.startswith(UNNAMED)]
    return max([released.misfit.probability, *families])


def misfit_motion(released: ReleasedRobot) -> Array:
    """Return how far what has no name moves the tool at every state, rms, (n,) [m]; the base aligned anew."""
    known, tool = released.posterior, released.tool
    here = {name: k for k, name in enumerate(known.fit.model.names)}
    drawn = np.zeros((len(tool.names), known.drawn.shape[1]))
    for k, name in enumerate(tool.names):
        if name.startswith(UNNAMED) and name in here:
            drawn[k] = known.drawn[here[name]]
    rest = POSITION_AXES * float((released.misfit.rest**2).mean())
    return np.asarray(np.sqrt(tool.square(drawn) / drawn.shape[1] + rest))


def misfit_place(released: ReleasedRobot) -> MisfitPlace | None:
    """Return how much what has no name moves the tool and where most; ``None`` where the run shows nothing of it."""
    if misfit_likelihood(released) < MISFIT_PROBABILITY:
        return None
    return largest_misfit(misfit_motion(released) ** 2, released.tool.q, released.fit.setup.robot.slide_numbers)


def largest_misfit(square: Array, q: Array, slides: Collection[int] = ()) -> MisfitPlace:
    """Return where squared motions (n,) [m²] of states q (n, N) are largest; ``slides``: joints, from 1, that slide."""
    place, inside = MisfitPlace(anywhere=float(np.sqrt(square.mean()))), np.ones(len(q), dtype=bool)
    found = list[MisfitRange]()
    for _ in range(2):  # joints that are named: of 1000 states a quarter of a quarter still holds 60
        there = _largest_quarter(square[inside], q[inside], {r.joint for r in found})
        if there is None:
            break
        rms, joint, ends = there
        found.append(MisfitRange(there=rms, joint=joint, range=ends, slides=(joint in slides) or None))
        inside &= (q[:, joint - 1] >= ends[0]) & (q[:, joint - 1] <= ends[1])
    if not found:
        return place
    first = found[0]
    own = {"there": first.there, "joint": first.joint, "range": first.range, "slides": first.slides}
    return place.model_copy(update=own | {"within": found[1] if len(found) > 1 else None})


def _largest_quarter(square: Array, q: Array, but: Collection[int]) -> tuple[float, int, tuple[float, float]] | None:
    """Return rms, joint and range where squares (n,) of states q (n, N) are largest; ``None`` where they are alike.

    Joints that are named already, ``but``, are passed over.
    """
    best, joint, ends = 0.0, 0, (0.0, 0.0)
    for number, angles in enumerate(q.T, 1):
        # 4: parts of a joint's range: where the misfit is largest is said as one of them
        edges = np.quantile(angles, np.linspace(0, 1, 4 + 1))
        for low, high in pairwise(edges if number not in but else ()):
            there = float(square[(angles >= low) & (angles <= high)].mean())
            if there > best:
                best, joint, ends = there, number, (float(low), float(high))
    return (float(np.sqrt(best)), joint, ends) if best > LOCAL_RATIO**2 * square.mean() else None
