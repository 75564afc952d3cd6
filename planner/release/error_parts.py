"""Of what the stated error over the workspace is made, and where what has no name moves the tool."""

from collections.abc import Collection, Iterator, Sequence
from itertools import pairwise

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from planner.common.units import Array
from planner.effects.drift_shapes import IN_TIME
from planner.fit.assumptions import LOCAL_RATIO, MISFIT_PROBABILITY, POSITION_AXES, UNSEEN_READINGS_RATIO
from planner.inference.posterior_background import OF_BACKGROUND, UNNAMED
from planner.inference.posterior_fit import PosteriorFit
from planner.model.identification_document import ErrorParts
from planner.model.misfit_place import MisfitPlace, MisfitRange
from planner.release.released_robot import ReleasedRobot, pick_rows


def error_parts(released: ReleasedRobot) -> ErrorParts:
    """Return the parts of the stated error [m]; their squares add up to its square.

    What is named and what is not hang together: each is counted as its own scatter is of both.
    """
    known, tool, misfit = released.posterior, released.tool, released.misfit
    here = {name: k for k, name in enumerate(known.fit.model.names)}
    at = [k for k, name in enumerate(tool.names) if name in here]
    which, weight = [here[tool.names[k]] for k in at], tool.gram[np.ix_(at, at)] / len(tool.q)
    most = released.usual_robots
    off = (known.drawn - known.fit.errors[:, None])[which][:, most]
    of_noise = known.of_noise[which][:, most]
    unnamed = _has_no_name([known.fit.model.names[k] for k in which])
    own, other = (_trace(weight[np.ix_(part, part)], off[part]) for part in (unnamed, ~unnamed))
    share = own / max(own + other, 1e-300)
    all_square, by_noise = (_trace(weight, part) / off.shape[1] for part in (off, of_noise))
    stretched = float((misfit.stretch**2).mean()) - 1
    beyond = misfit.rest_square + all_square * share + by_noise * stretched
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


def _has_no_name(names: Sequence[str]) -> np.ndarray:
    """Tell which parameters are of what has no name, (P,)."""
    return np.array([name.startswith(UNNAMED) for name in names], dtype=bool)


def _root_after_many(known: PosteriorFit) -> Array:
    """Return a root (P, P) of the covariance after MANY times as many readings at the same poses."""
    drawn = known.mixture.scaled_sizes
    # of what always acts, without the draws in which it is largest: few robots have so much
    drawn = np.where(drawn.min(axis=0) > 0, np.minimum(drawn, np.quantile(drawn, 0.75, axis=0)), drawn)
    size = np.sqrt((drawn**2).mean(axis=0))
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
    drawn = pick_rows(known.drawn, known.fit.model.names, tool.names)
    rest = POSITION_AXES * float((released.misfit.rest**2).mean())
    return np.asarray(np.sqrt(tool.square(drawn, _has_no_name(tool.names)) / drawn.shape[1] + rest))


def misfit_place(released: ReleasedRobot) -> MisfitPlace | None:
    """Return how much what has no name moves the tool and where most; ``None`` where the run shows nothing of it."""
    if misfit_likelihood(released) < MISFIT_PROBABILITY:
        return None
    return largest_misfit(misfit_motion(released) ** 2, released.tool.q, released.fit.setup.robot.slide_numbers)


def open_misfit(released: ReleasedRobot, parts: ErrorParts) -> Array:
    """Return the square of the error that misfit leaves open at every state, (n,) [m²]; its mean is that of the part.

    What is named and what is not share what is expected at a state by the scatter of each there, as over the workspace.
    """
    known, tool, misfit = released.posterior, released.tool, released.misfit
    names, unnamed = known.fit.model.names, _has_no_name(tool.names)
    off = pick_rows(known.drawn - known.fit.errors[:, None], names, tool.names)
    noise = pick_rows(known.of_noise, names, tool.names)
    every = slice(None)
    each = ((off, unnamed), (off, ~unnamed), (off, every), (noise, every))
    own, other, both, by_noise = (tool.square(*columns) / off.shape[1] for columns in each)
    share = own / np.maximum(own + other, 1e-300)
    square = misfit.rest_square + both * share + by_noise * (float((misfit.stretch**2).mean()) - 1)
    return np.asarray(square * parts.misfit**2 / max(float(square.mean()), 1e-300))


def open_misfit_place(released: ReleasedRobot, parts: ErrorParts) -> MisfitPlace | None:
    """Return where misfit leaves most open, and what acts like it; ``None`` where the run shows none."""
    if misfit_likelihood(released) < MISFIT_PROBABILITY:
        return None
    slides = released.fit.setup.robot.slide_numbers
    place = largest_misfit(open_misfit(released, parts), released.tool.q, slides)
    return place.model_copy(update={"like": acts_like(released)})


def acts_like(released: ReleasedRobot) -> str | None:
    """Return what makes up most of the motion that has no name, in words; ``None`` where no one law does."""
    known, tool = released.posterior, released.tool
    family = dict(zip(known.record.model.names, known.record.effects.family.tolist(), strict=True))
    here = {name: k for k, name in enumerate(known.fit.model.names)}
    squares = {EACH_POSE: released.misfit.rest_square}
    by_family: dict[str, list[int]] = {}
    for k, name in enumerate(tool.names):
        if name.startswith(UNNAMED) and family.get(name, -1) >= 0:
            by_family.setdefault(known.record.names[family[name]], []).append(k)
    for name, which in by_family.items():
        weight = tool.gram[np.ix_(which, which)] / len(tool.q)
        drawn = known.drawn[[here[tool.names[k]] for k in which]]
        squares[_in_words(name)] = _trace(weight, drawn) / drawn.shape[1]
    first = max(squares, key=lambda words: squares[words])
    return first if squares[first] > 0.5 * sum(squares.values()) else None


EACH_POSE = "scatter from pose to pose"


def _in_words(family: str) -> str:
    """Say ``misfit, part 3 by gravity (background)`` in the words of a person."""
    what, _, by = family.removesuffix(OF_BACKGROUND).removeprefix(f"{UNNAMED}, ").partition(" by ")
    where = f"behind joint {what.removeprefix('part ')}" if what.startswith("part ") else f"of the {what}"
    return f"a turn {where} by {by}"


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
        means = [mean for angles in q.T for _, mean in _quarters(square, angles)]
        least, most = (float(np.sqrt(v)) for v in (min(means), max(means)))
        return place.model_copy(update={"least": least, "most": most})
    first = found[0]
    own = {"there": first.there, "joint": first.joint, "range": first.range, "slides": first.slides}
    own |= {"elsewhere": float(np.sqrt(square[~inside].mean()))} if not inside.all() else {}
    return place.model_copy(update=own | {"within": found[1] if len(found) > 1 else None})


def _largest_quarter(square: Array, q: Array, but: Collection[int]) -> tuple[float, int, tuple[float, float]] | None:
    """Return rms, joint and range where squares (n,) of states q (n, N) are largest; ``None`` where they are alike.

    Joints that are named already, ``but``, are passed over.
    """
    best, joint, ends = 0.0, 0, (0.0, 0.0)
    for number, angles in enumerate(q.T, 1):
        for quarter, there in _quarters(square, angles) if number not in but else ():
            if there > best:
                best, joint, ends = there, number, quarter
    return (float(np.sqrt(best)), joint, ends) if best > LOCAL_RATIO**2 * square.mean() else None


def _quarters(square: Array, angles: Array) -> Iterator[tuple[tuple[float, float], float]]:
    """Yield ends of the quarters of a joint's range, by its angles (n,), and the mean square (n,) in each."""
    # 4: parts of a joint's range: where the misfit is largest is said as one of them
    for low, high in pairwise(np.quantile(angles, np.linspace(0, 1, 4 + 1)).tolist()):
        yield (low, high), float(square[(angles >= low) & (angles <= high)].mean())
