"""Who takes part in the comparison for what a finding explains, and what comes of it."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import log

from planner.effects.effect import Effect, Parameter, Role
from planner.inference.posterior_background import EffectFamily
from planner.model.finding import Finding, RejectedEffect
from planner.model.identification_document import DetectionLimit

HUNDRED_TO_ONE = 0.01  # probability from which on another cause is a rival


@dataclass(frozen=True)
class Candidate:
    """A cause that may stand for a finding.

    Attributes:
        name: of the cause.
        parameters: by which it enters the model, what moves its inner number included.
        handicap: logarithm of how many values and places it was chosen from.
    """

    name: str
    parameters: tuple[Parameter, ...]
    handicap: float = 0.0


def candidates_of_same_law(effects: Iterable[Effect]) -> tuple[Candidate, ...]:
    """Return those of the catalogue's effects that are met in the name of another cause, which has their law."""
    return tuple(Candidate(e.family, e.make(), -log(e.odds)) for e in effects if e.has(Role.SAME_LAW))


@dataclass(frozen=True)
class CauseComparison:
    """All findings of one name, and the causes of the catalogue that may stand for them.

    ``same_law`` are those that are met in the name of another cause, which has their law. The logarithm of their odds
    over that one is their handicap's negative.
    """

    own: Candidate
    others: tuple[Candidate, ...] = ()
    same_law: tuple[Candidate, ...] = ()


@dataclass(frozen=True)
class Rival:
    """A cause that may stand for a finding.

    Attributes:
        name: of the cause.
        probability: that it is this one, 0 where the readings speak against it, but the poses might not have told.
    """

    name: str
    probability: float


@dataclass(frozen=True)
class Inclusion:
    """What came of a comparison: probability of the finding, and its rivals, the likeliest first."""

    probability: float
    rivals: tuple[Rival, ...]


@dataclass(frozen=True)
class TracingResult:
    """Result of tracing.

    Attributes:
        findings: effects in the model, in the order in which they were found.
        limits: for every effect that was looked for and not found.
        rejected: what was refitted and not kept.
        tried: number of effects and inner values that were looked at.
        comparisons: for what the findings explain, to be decided by the posterior.
        variants: findings at other values of their inner numbers, with which the run is nearly as likely.
    """

    findings: tuple[Finding, ...] = ()
    limits: tuple[DetectionLimit, ...] = ()
    rejected: tuple[RejectedEffect, ...] = ()
    tried: int | None = None
    comparisons: tuple[CauseComparison, ...] = ()
    variants: tuple[EffectFamily, ...] = ()
