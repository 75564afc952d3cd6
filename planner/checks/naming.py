"""What has changed, by probability: all that may have is weighed as an identification weighs the causes of a finding.

A change is a cause whose size is one of a few, over the orders of magnitude, and its values are averaged over (the
marginal likelihood of ``identification.comparison``). So is the noise, which the baseline knows as well as its readings
were many. One reading that is wrong is a cause as well, and so is what has no name: each reading off by itself. That
something has changed is for the alarm to say (``detection``); the probabilities are of what, if anything has.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.checks.detection import Detector
from planner.common.lazy_modules import stats
from planner.common.units import Array
from planner.inference.comparison_columns import Block
from planner.inference.model_comparison import ConditionalProducts


@dataclass(frozen=True)
class ChangeProbabilities:
    """How likely it was each, together 1.

    ``changes`` (h,) as the detector has them; ``anything``: what has no name; ``readings`` (n,): that one was wrong.
    """

    changes: Array
    anything: float
    readings: Array

    @property
    def wrong_reading(self) -> int | None:
        """Number of the reading that is wrong more likely than anything else."""
        likeliest = int(np.argmax(self.readings))
        others = max(self.anything, float(self.changes.max(initial=0.0)))
        return likeliest if self.readings[likeliest] > others else None


def weigh_changes(detector: Detector, units: Sequence[Array], difference: Array, readings: int) -> ChangeProbabilities:
    """Weigh all that may have changed.

    Args:
        detector: with the columns of h changes.
        units: values (d,) by which each parameter of a change moves the tool by as much as the others, by a metre [m,
            rad per m], of every change.
        difference: readings less what is expected, (m,) [m], of so many ``readings`` at a pose each.
    """
    each = np.split(np.eye(len(difference)), readings, axis=1)
    columns = [*(c * u for c, u in zip(detector.columns, units, strict=True)), np.eye(len(difference)), *each]
    white = np.column_stack([detector.white(np.column_stack(columns)), detector.white(difference)])
    gram, ends = white.T @ white, np.cumsum([0, *(c.shape[1] for c in columns)])
    sizes = np.geomspace(1e-5, 1e-2, 13)  # [m] of the tool, or of a reading: ten micrometres to ten millimetres
    # one of all readings is wrong as likely as one change has come about
    handicap = np.append(np.zeros(len(units) + 1), np.full(readings, np.log(readings)))
    blocks = [
        Block("", np.arange(a, b), sizes / np.sqrt(b - a), np.full(len(sizes), -float(h) - np.log(len(sizes))))
        for a, b, h in zip(ends[:-1], ends[1:], handicap, strict=True)
    ]
    middles = (np.arange(12) + 0.5) / 12  # sizes that the noise may have, as likely each
    noises = np.sqrt(detector.freedom / stats.chi2.ppf(middles, detector.freedom))
    logs = np.logaddexp.reduce([_log_densities(gram, blocks, float(s), len(white)) for s in noises], axis=0)
    chance = np.exp(logs - logs.max())
    own = np.split(chance / chance.sum(), [len(units), len(units) + 1])
    return ChangeProbabilities(own[0], float(own[1][0]), own[2])


def _log_densities(gram: Array, blocks: Sequence[Block], noise: float, count: int) -> Array:
    """Return the log densities (k,) of ``count`` white readings by each cause, with noise so many times as large."""
    alone = ConditionalProducts.of(gram / noise**2, [])
    none = -0.5 * float(alone.gram[-1, -1]) - count * np.log(noise)
    return np.array([none + np.logaddexp.reduce(alone.gains(b)) for b in blocks])
