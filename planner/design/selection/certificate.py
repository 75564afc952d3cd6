"""The certified bound, for any criterion: relax, price in the candidates that violate the dual, verify over all.

A relaxation is solved on a few hundred active candidates. Its dual is evaluated over the whole pool, the candidates
that violate it most come in, and so on until bound and relaxation meet (column generation). The solver is not trusted:
what counts is the dual, which proves its bound over all candidates by itself.
"""

from abc import ABC, abstractmethod
from copy import copy
from dataclasses import dataclass, replace
from typing import ClassVar, Protocol

import numpy as np

from planner.common.determinism import Positions
from planner.common.progress import LastStart, TimeLimit
from planner.common.units import Array, read_only


class Dual(Protocol):
    """A proof that no set of candidates does better than some value."""

    @property
    def upper(self) -> bool:
        """Whether the criterion is maximised, the bound an upper one."""

    def verify(self, rows: Array) -> float:
        """Return the bound that is proven over all candidates ``rows`` (N, r, P); the trivial bound where none is."""

    def prices(self, rows: Array, active: Positions) -> Array:
        """Return the reduced cost of every candidate, (N,); a candidate with a lower one improves the set more."""


@dataclass(frozen=True)
class Certificate:
    """A bound on a criterion over all sets of candidates.

    Attributes:
        index: name of the criterion.
        value: no set does better.
        poses: number of candidates in a set; ``None`` for any number.
        support, weights: candidates with weight in the relaxation, (k,), and their weights (sum ``poses``, or 1).
        relaxed: the relaxation's own optimum as far as solved.
        duals: what proves the value: one dual, or two, of which the second's bound divides the first's.
        verified: outcome of the check over all ``candidates``.
        rounds: of pricing.
    """

    index: str
    value: float
    poses: int | None
    support: Positions
    weights: Array
    relaxed: float
    duals: tuple[Dual, ...]
    verified: bool
    rounds: int
    candidates: int

    @property
    def kind(self) -> str:
        """For which sets it holds, in words."""
        return "any number of poses" if self.poses is None else f"exactly {self.poses} poses"

    def restrict_to_candidates(self, kept: np.ndarray) -> "Certificate":
        """Return the certificate for the candidates ``kept`` (N,) bool, numbered anew: its bound holds for them too."""
        left = kept[self.support]
        place = np.cumsum(kept) - 1
        support, weights = place[self.support[left]], read_only(self.weights[left])
        return replace(self, support=support, weights=weights, candidates=int(np.sum(kept)))

    def holds(self, rows: Array) -> bool:
        """Verify again, from the duals alone, over all ``rows``: does ``value`` follow?"""
        proven = [copy(dual).verify(rows) for dual in self.duals]  # without what the search has kept
        value = proven[0] if len(proven) == 1 else proven[0] / proven[1]
        margin = abs(self.value) * 1e-12  # a bound that is verified again comes out the same but for rounding
        follows = value <= self.value + margin if self.duals[0].upper else value >= self.value - margin
        return bool(np.isfinite(value) and follows)


@dataclass(frozen=True)
class ActiveSet:
    """Active candidates (K,), ascending, and their weights (K,); those that have just come in have next to none."""

    active: Positions
    weights: Array


@dataclass(frozen=True)
class Pricing(ABC):
    """The relaxation of a criterion.

    Attributes:
        rows: of all candidates, (N, r, P).
        poses: number of candidates in a set, or ``None`` for any number.
        name: of the criterion.
        limit: of the time that a plan may take.
        negligible: share of the largest weight below which a candidate does not belong to the support.
    """

    rows: Array
    poses: int | None
    name: str
    limit: TimeLimit
    negligible: ClassVar[float] = 0.0

    @property
    def count(self) -> int:
        """Number of poses, one for any number."""
        return self.poses or 1

    @abstractmethod
    def solve(self, state: ActiveSet, accuracy: float) -> tuple[ActiveSet, Dual, float]:
        """Solve on the active candidates: weights, dual, and the criterion at these weights."""

    @abstractmethod
    def distance(self, relaxed: float, bound: float) -> float:
        """Distance between relaxation and bound, which is compared with the tolerance."""

    @abstractmethod
    def grow(self, state: ActiveSet, dual: Dual) -> ActiveSet | None:
        """Bring in the candidates that violate the dual most; ``None`` where none does."""


def generate_columns(pricing: Pricing, state: ActiveSet, tolerance: float, accuracy: float, rounds: int) -> Certificate:
    """Return the tightest bound of at most ``rounds`` rounds.

    Args:
        pricing: the relaxation.
        state: active candidates to begin with.
        tolerance: distance between bound and relaxation at which pricing stops; the bound holds whatever it is.
        accuracy: with which the first relaxation is solved.
        rounds: at most.
    """
    best: tuple[Dual, float] | None = None
    for turn in range(1, rounds + 1):
        state, dual, relaxed = pricing.solve(state, accuracy)
        value = dual.verify(pricing.rows)
        if best is None or (value < best[1] if dual.upper else value > best[1]):
            best = dual, value  # the tightest bound is the one that promises least
        if pricing.distance(relaxed, best[1]) < tolerance or turn == rounds:
            break
        if pricing.limit.must_stop(
            LastStart.BOUND, "the bound of the certificate holds, but is not as tight as it can be"
        ):
            break
        grown = pricing.grow(state, dual)
        if grown is None:
            break
        settled = np.array_equal(grown.active, state.active)
        accuracy = accuracy / 4 if settled else max(tolerance / 3, accuracy / 4)
        state = grown
    assert best is not None
    held = state.weights > pricing.negligible * np.max(state.weights)
    weights = state.weights[held] * (pricing.count / np.sum(state.weights[held]))
    certificate = Certificate(
        index=pricing.name,
        value=best[1],
        poses=pricing.poses,
        support=state.active[held],
        weights=read_only(weights),
        relaxed=relaxed,
        duals=(best[0],),
        verified=False,
        rounds=turn,
        candidates=len(pricing.rows),
    )
    return replace(certificate, verified=certificate.holds(pricing.rows))
