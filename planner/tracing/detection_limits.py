"""What silence means: the smallest size of each effect that the run would have shown."""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.optimize import brentq
from scipy.stats import chi2, ncx2

from planner.effects.effect import Effect
from planner.model.identification_document import DetectionLimit
from planner.tracing.score_test import LEAST_SHARE, ScoreTest, score_effects
from planner.tracing.significance import LEAST_GAIN, LOG_SIGNIFICANCE

POWER = 0.95
POWER_QUANTILE = 1.645  # standard deviations by which the share of the error must be above what is worth a name


def detection_limits(shade: ScoreTest, entries: Sequence[Effect], tried: int) -> Iterator[DetectionLimit]:
    """Yield the detection limit of every entry that the readings show at all, at the worst phase and inner number."""
    pairs = [(e, v) for e in entries for v in _sample_values(e)]
    variance = shade.scatter / shade.spare
    least = (np.sqrt(LEAST_GAIN * shade.spare) + POWER_QUANTILE) ** 2
    worst: dict[str, float] = {}
    for s in score_effects(shade, shade.lay_out(pairs)):
        parameters = s.entry.make(s.inner)
        prior = np.array([p.prior for p in parameters])
        mu = np.linalg.eigvalsh(s.information / np.outer(prior, prior))  # per unit of size
        seen = mu[mu > LEAST_SHARE * mu[-1]] if mu[-1] > 0 else mu[:0]
        size = (
            np.sqrt(max(least, _noncentrality(max(1, len(seen)), tried)) * variance / seen[0]) if len(seen) else np.inf
        )
        worst[s.entry.name] = max(worst.get(s.entry.name, 0.0), float(size))
    for e in entries:
        if worst.get(e.name, np.inf) <= e.largest:  # beyond that no arm has it: the run says nothing of it
            unit = e.make(_sample_values(e)[0])[0].unit
            yield DetectionLimit(effect=e.kind, on=e.on, size=worst[e.name], unit=unit)


def _sample_values(entry: Effect) -> list[float | None]:
    """A few inner numbers over the grid."""
    if entry.inner is None:
        return [None]
    which = np.unique(np.linspace(0, len(entry.inner.values) - 1, 7).astype(int))
    return [float(v) for v in entry.inner.values[which]]


def _noncentrality(size: int, tried: int) -> float:
    """Noncentrality at which a test of ``size`` parameters at the search's level has its power."""
    needed = float(chi2.isf(np.exp(LOG_SIGNIFICANCE) / tried, size))
    return float(brentq(lambda nc: ncx2.sf(needed, size, nc) - POWER, 1e-3, 10 * needed + 100))
