"""What a posterior is too sure of, by poses that it did not see.

A posterior over a catalogue that lacks the cause is sure of the wrong thing; poses held out are not. Some are left out
before anything is learnt of them, sizes of families included: a fit that chose its effects by all poses predicts those
that it chose them by. What is left of the readings there is held against what was expected: noise, what the other
poses leave open, and two unknowns. The ``stretch`` multiplies what is left open, for a model of the right shape that is
too sure. The ``rest`` moves the tool at each pose alone, as a law does that no column follows. A run without misfit
needs neither, so either is most likely absent (a spike and a slab); noise is what the data sheet says or a little off.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.common.determinism import even_positions
from planner.common.units import Array
from planner.identification.cross_validation import Split
from planner.identification.least_squares import Fit
from planner.identification.noise import Noise
from planner.identification.posterior_background import EffectFamily
from planner.identification.posterior_fit import draw_posterior
from planner.identification.problem import FitProblem
from planner.model.model import Model
from planner.runs.run import Run

POSITION_AXES = 3
FOLDS, SWEEPS = 2, 30  # of the split that are predicted, and how often sizes are drawn without each
MOST_READINGS = 2_400  # of a long run that fit and judge
NONE = 0.8  # probability that there is no stretch, and that there is no rest
NOISES: Array = np.exp(np.linspace(-1.0, 1.2, 12))  # over the noise said, and
NOISE_WIDTH = 0.3  # how well its logarithm is known beside the rest: data sheets are good to a third
STRETCHES: Array = np.append(1.0, np.exp(np.linspace(0.25, 3.0, 12)))
STRETCH_WIDTH = 0.7  # of its logarithm: twice is usual where it is any
RESTS: Array = np.append(0.0, 0.05 * np.exp(np.linspace(0.0, 6.0, 19)))  # over the noise said
USUAL_REST, REST_WIDTH = 0.5, 1.5  # over the noise said, and of its logarithm: hardly anything is known of it


@dataclass(frozen=True)
class Misfit:
    """Draws that go with the robots drawn from a posterior.

    Attributes:
        stretch: factor on their distance from its mean, (n,).
        rest: what moves the tool at each pose alone, along each axis, (n,) [m].
    """

    stretch: Array
    rest: Array

    @property
    def probability(self) -> float:
        """How likely there is any."""
        return float(((self.stretch > 1) | (self.rest > 0)).mean())

    @property
    def rest_square(self) -> float:
        """Mean square motion of the tool by the rest [m²]."""
        return POSITION_AXES * float((self.rest**2).mean())


@dataclass(frozen=True)
class HeldOutReadings:
    """Readings that were predicted by a posterior that did not see them, (m,) each.

    Attributes:
        residual: what is left of them [m].
        open: variance of the prediction by what the posterior leaves open [m²].
        noise: variance of the reading, gauge and joints as large beside each other as was fitted, and together at most
            as declared: what is fitted beyond that may be misfit [m²].
    """

    residual: Array
    open: Array
    noise: Array


def judge_misfit(
    before: Fit, run: Run, split: Split, whole: Model, background: Sequence[EffectFamily], time: float, count: int
) -> Misfit:
    """Return ``count`` draws of stretch and rest by poses that are left out; the rest as of ``draw_posterior``."""
    parts = [_predict(before, run, split.fold == f, whole, background, time) for f in range(min(FOLDS, split.folds))]
    return draw_misfit(parts, count)


def draw_misfit(parts: Sequence[HeldOutReadings], count: int, seed: int = 0) -> Misfit:
    """Return ``count`` draws of stretch and rest from their posterior by readings held out."""
    square = np.concatenate([p.residual for p in parts]) ** 2
    noise, open_ = (np.concatenate([getattr(p, name) for p in parts]) for name in ("noise", "open"))
    usual = float(noise.mean())
    moved = RESTS[:, None] ** 2 * usual
    logs = np.empty((len(NOISES), len(STRETCHES), len(RESTS)))
    for i, factor in enumerate(NOISES):
        for j, stretch in enumerate(STRETCHES):
            variance = factor**2 * noise + stretch**2 * open_ + moved
            logs[i, j] = -0.5 * (square / variance + np.log(variance)).sum(axis=1)
    logs += (-0.5 * (np.log(NOISES) / NOISE_WIDTH) ** 2)[:, None, None]
    logs += _spike_and_slab(np.log(STRETCHES[1:]) / STRETCH_WIDTH)[None, :, None]
    logs += _spike_and_slab(np.log(RESTS[1:] / USUAL_REST) / REST_WIDTH)
    chance = np.exp(logs - logs.max()).sum(axis=0)
    at = np.random.default_rng(seed).choice(chance.size, size=count, p=chance.ravel() / chance.sum())
    stretch, rest = np.unravel_index(at, chance.shape)
    return Misfit(STRETCHES[stretch], RESTS[rest] * np.sqrt(usual))


def _spike_and_slab(off: Array) -> Array:
    """Return log probabilities (1 + k,): of none, and of values so many standard deviations off the usual one."""
    weight = np.exp(-0.5 * off**2)
    return np.asarray(np.log(np.append(NONE, (1 - NONE) * weight / weight.sum())))


def _predict(
    before: Fit, run: Run, test: np.ndarray, whole: Model, background: Sequence[EffectFamily], time: float
) -> HeldOutReadings:
    """Predict the positions of the samples ``test`` (n,) bool by a posterior of the others."""
    seen, unseen = (_few(np.flatnonzero(which), whole.width) for which in (~test, test))
    time = max(1.0, time * len(seen) / (~test).sum())
    known = draw_posterior(before, run.take(seen), whole, background, time, sweeps=SWEEPS).fit()
    there = FitProblem.of(known.fit.model, run.take(unseen), known.fit.problem.whitener.noise)
    linear, width = there.linear(slice(0, len(there)), known.fit.errors), min(POSITION_AXES, whole.width)
    moved = linear.rows[:, :width] @ (known.drawn - known.fit.errors[:, None])
    fitted, declared = (
        np.einsum("nii->ni", white.covariance(slice(None))[:, :width, :width])
        for white in (there.whitener, there.whitener.with_noise(Noise()))
    )
    noise = fitted * min(1.0, declared.mean() / fitted.mean())
    return HeldOutReadings(linear.residual[:, :width].ravel(), (moved**2).mean(axis=2).ravel(), noise.ravel())


def _few(which: np.ndarray, width: int) -> np.ndarray:
    return which[even_positions(len(which), min(len(which), MOST_READINGS // width))]
