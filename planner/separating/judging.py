"""How surely poses tell two effects apart."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from planner.separating.criterion import noncentrality
from planner.separating.frame import Frame
from planner.separating.pairs import Asked
from planner.separating.reasons import exact, faint
from planner.units import Array

EXACT = 1e-6  # share of a finding's readings below which what a rival leaves of them is rounding
LEAST = 1.0  # noise variances below which a difference is none
HOPEFUL = 20.0  # the same for a rival that nobody named: no effort goes where none helps
EVIDENCE = 9.2  # fall of minus twice the log likelihood that tells two causes apart: a hundred to one
ALIKE = 0.02  # share of what a finding explains that a rival must leave, for the identification to drop it


def power(size: float, whole: float) -> float:
    """Chance that the run tells the truth from the other (Cox 1962, JRSS B 24: tests of separate hypotheses).

    Twice the log likelihood ratio has mean ``size``, the noncentrality, and variance four times that; ``whole`` is all
    that the truth explains.
    """
    needed = max(EVIDENCE, ALIKE * whole)
    return float(norm.sf((needed - size) / (2 * np.sqrt(max(size, 1e-300)))))


def judged(asked: Asked, frame: Frame, mass: Array) -> list[tuple[float, float]]:
    """Noncentrality and power of every pair, the less sure of its truths, at an information (p, p)."""
    out = []
    for k in range(len(asked.pairs)):
        sizes = [
            (noncentrality(frame, mass, q)[0], noncentrality(frame, mass, q, beside=False)[0])
            for q in asked.questions
            if q.pair == k
        ]
        out.append((min(s for s, _ in sizes), min(power(s, w) for s, w in sizes)))
    return out


def most(left: Array, rows: Array, n: int) -> float:
    """Bound on the noncentrality of any n candidates ``rows`` (N, r, p).

    ``left``: the direction in which the truth shows beyond the other effect as that fits the whole pool; any fit of it
    leaves at least as much as the best one does.
    """
    squares = ((rows @ left) ** 2).sum(axis=1)
    return float(np.sum(np.partition(squares, len(squares) - n)[len(squares) - n :]))


@dataclass(frozen=True)
class Closed:
    """A pair that n poses cannot tell apart; ``limit``: no more noise variances, ``None`` where nothing differs."""

    pair: int
    limit: float | None


def separable(
    asked: Asked, frame: Frame, rows: Array, n: int, which: set[int] | None = None
) -> tuple[dict[int, float], tuple[Closed, ...]]:
    """Pairs that n poses can tell apart, with the bound on their noncentrality; and those that they cannot.

    ``which``: only these pairs are looked at.
    """
    open_, closed, whole = dict[int, float](), list[Closed](), np.eye(rows.shape[2])
    for k, pair in enumerate(asked.pairs):
        if which is not None and k not in which:
            continue
        own = [q for q in asked.questions if q.pair == k]
        left = [noncentrality(frame, whole, q) for q in own]
        alone = [noncentrality(frame, whole, q, beside=False)[0] for q in own]
        share = min(size / max(all_, 1e-300) for (size, _), all_ in zip(left, alone, strict=True))
        limit = min(most(direction, rows, n) for _, direction in left)
        if share >= EXACT and limit >= (LEAST if pair.named else HOPEFUL):
            open_[k] = limit
        else:
            closed.append(Closed(k, None if share < EXACT else limit))
    return open_, tuple(closed)


def sentence(asked: Asked, closed: Closed, n: int, help_: Sequence[str]) -> str:
    """Say of a pair that n poses cannot tell apart why, and what would ``help_``."""
    pair = asked.pairs[closed.pair]
    if closed.limit is None:
        return exact(pair.finding, pair.rival, help_)
    needed = int(np.ceil(2 * EVIDENCE / closed.limit * n))
    return faint(pair.finding, pair.rival, n, closed.limit, needed, help_)
