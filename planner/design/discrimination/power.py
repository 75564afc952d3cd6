"""How surely poses discriminate between two effects: noncentrality, power, and the pairs that cannot be separated."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.common.units import Array
from planner.design.assumptions import (
    ALIKE_SHARE,
    IDENTICAL_SHARE,
    LEAST_DIFFERENCE,
    LEAST_UNNAMED_DIFFERENCE,
    LOG_LIKELIHOOD_EVIDENCE,
    SURE_POWER,
)
from planner.design.discrimination.questions import QuestionSet, RivalPair, effect_kind
from planner.design.discrimination.search import PoolCoordinates, noncentrality
from planner.design.selection.matrix_forms import sum_largest


@dataclass(frozen=True)
class PairPower:
    """A finding and one of its rivals.

    Attributes:
        finding, rival: names; the finding's with its inner number, where it has one.
        named: whether the identification names the rival; else it is one that other poses would have brought up.
        noncentrality: what is left of the one's predicted readings when the other explains what it can, as a sum of
            squares in noise variances; the less sure of both truths.
        power: chance that the run then speaks a hundred to one for the truth, as the identification asks for.
        before: noncentrality of as many poses chosen by the index alone.
        bound: no set of as many candidates has a larger noncentrality of this pair.
        help: what else would tell a pair apart that is not told surely.
    """

    finding: str
    rival: str
    named: bool
    noncentrality: float
    power: float
    before: float
    bound: float
    help: tuple[str, ...] = ()

    @property
    def pair(self) -> tuple[str, str]:
        """Names of the two causes."""
        return self.finding, self.rival

    @property
    def power_text(self) -> str:
        """The power as a person reads it."""
        return f"{100 * self.power:.0f} %" if self.power < 0.995 else "more than 99 %"

    def text(self) -> str:
        """Say it in a line."""
        return (
            f"{self.finding} from {self.rival}: power {self.power_text} (noncentrality {self.noncentrality:.3g}; "
            f"{self.before:.3g} with poses chosen by the index alone)"
        )


@dataclass(frozen=True)
class Discrimination:
    """How the poses tell findings from their rivals.

    Attributes:
        told: every pair that poses can tell apart.
        inseparable: one sentence for every pair that they cannot, and what would.
        poses: number n of poses chosen.
        gap: no set of as many candidates betters the criterion by more than this factor less one.
        verified: whether that was checked again over all candidates.
        noise: of one reading, as the identification left it [m].
        alone: observability index of as many poses chosen by it alone.
    """

    told: tuple[PairPower, ...]
    inseparable: tuple[str, ...]
    poses: int
    gap: float
    verified: bool
    noise: float
    alone: float

    def texts(self) -> tuple[str, ...]:
        """Say it in a line for each pair that the identification names, and one for all the others."""
        others = [t for t in self.told if not t.named]
        own = tuple(t.text() for t in self.told if t.named)
        if not others:
            return own
        least = min(others, key=lambda t: t.power)
        effects, them = ("1 more effect", "it") if len(others) == 1 else (f"{len(others)} more effects", "them")
        return (
            *own,
            f"{effects} that nobody named and that poses chosen without a look at {them} would tell with a power below "
            f"{100 * SURE_POWER:.0f} %; least surely now {least.text()}",
        )


def discrimination_power(size: float, whole: float) -> float:
    """Chance that the run tells the truth from the other (Cox 1962, JRSS B 24: tests of separate hypotheses).

    Twice the log likelihood ratio has mean ``size``, the noncentrality, and variance four times that; ``whole`` is all
    that the truth explains.
    """
    needed = max(LOG_LIKELIHOOD_EVIDENCE, ALIKE_SHARE * whole)
    from scipy.stats import norm  # costs most of a second

    return float(norm.sf((needed - size) / (2 * np.sqrt(max(size, 1e-300)))))


def pair_powers(asked: QuestionSet, frame: PoolCoordinates, mass: Array) -> list[tuple[float, float]]:
    """Noncentrality and power of every pair, the less sure of its truths, at an information (p, p)."""
    out = []
    for pair in asked.pairs:
        sizes = [[noncentrality(frame, mass, q, beside)[0] for beside in (True, False)] for q in pair.questions]
        out.append((min(left for left, _ in sizes), min(discrimination_power(*both) for both in sizes)))
    return out


def split_separable(
    asked: QuestionSet, frame: PoolCoordinates, rows: Array, n: int, first: int = 0
) -> tuple[dict[int, float], dict[int, float | None]]:
    """Pairs that n of the candidates ``rows`` (N, r, p) can tell apart, and those that they cannot.

    With each stands the bound on its noncentrality, ``None`` where nothing differs. The direction in which a truth
    shows beyond the other effect is taken as that fits the whole pool: any fit of it leaves at least as much as the
    best one does. ``first``: only pairs from there on are looked at.
    """
    open_, closed, whole = dict[int, float](), dict[int, float | None](), np.eye(rows.shape[2])
    for k, pair in list(enumerate(asked.pairs))[first:]:
        left = [noncentrality(frame, whole, q) for q in pair.questions]
        alone = [noncentrality(frame, whole, q, beside=False)[0] for q in pair.questions]
        share = min(size / max(all_, 1e-300) for (size, _), all_ in zip(left, alone, strict=True))
        limit = min(sum_largest(((rows @ direction) ** 2).sum(axis=1), n) for _, direction in left)
        if share >= IDENTICAL_SHARE and limit >= (LEAST_DIFFERENCE if pair.named else LEAST_UNNAMED_DIFFERENCE):
            open_[k] = limit
        else:
            closed[k] = None if share < IDENTICAL_SHARE else limit
    return open_, closed


def explain_inseparable(pair: RivalPair, limit: float | None, n: int, help_: Sequence[str]) -> str:
    """Say of a pair that n poses cannot tell apart why, and what would ``help_``."""
    if help_:
        would = f"what would tell them apart: {'; or '.join(help_)}"
    elif {effect_kind(pair.finding), effect_kind(pair.rival)} <= {"gauge lag", "servo lag"}:
        would = "no other way of measuring would help but a gauge that the controller itself triggers or logs"
    else:
        would = "another payload or speed, a second fixture or a longer bar would not help either"
    both = f"{pair.finding} and {pair.rival}"
    if limit is None:
        return f"{both}: the same in every pose that this cell can measure; {would}"
    needed = int(np.ceil(2 * LOG_LIKELIHOOD_EVIDENCE / limit * n))
    return (
        f"{both}: no {n} poses differ by more than {limit:.2g} noise variances; "
        f"about {needed} would be needed (--poses); {would}"
    )
