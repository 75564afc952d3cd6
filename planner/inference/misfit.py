"""What a posterior is too sure of, by regions of the workspace that it did not see.

A posterior over a catalogue that lacks the cause is sure of the wrong thing; poses held out are not. One region after
the other is left out before anything is learnt of it, sizes of families included: a fit that chose its effects by all
poses predicts those that it chose them by, and one that was measured all round a pose need not know the workspace. What
is left of the readings there is held against what was expected: noise, what the other poses leave open, and two
unknowns. The ``stretch`` is for a model of the right shape that is too sure: as if the noise that was counted with were
so many times as large. It multiplies what the readings' noise puts the mean off by. What stays open because no reading
tells of it, such as the gauge's scale, is as large as its prior says, which no misfit refutes. The ``rest`` moves the
tool at each pose alone, as a law does that no column follows. A run without misfit needs neither, so either is most
likely absent (a spike and a slab).
Where the rest is of the noise's size, residuals alone do not tell one from the other, and a noise that is fitted takes
both: how large noise is follows from data sheets, and from poses that the arm came back to, where there are any.
How many families act without being named tells of a rest as well: a cause whose law the catalogue has takes about one
of them to be described, a law that it lacks takes several, each of which follows it in part only.
What is left open moves all poses of a region together: it is looked at in the directions in which it is independent, so
that a region counts as so many readings as it has of these. One region is stretched more than another, or has more of
a rest, and what is drawn for the workspace are those of a region not yet seen (a random effect, as of studies in a
meta-analysis: DerSimonian and Laird 1986, Controlled Clinical Trials 7(3)).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from planner.common.determinism import even_positions
from planner.common.units import Array, mean_by_group
from planner.effects.context import Context
from planner.fit.assumptions import (
    COUNTED,
    FAMILIES_OF_A_REST,
    LOG_REST_SIGMA,
    LOG_STRETCH_SIGMA,
    LOG_USUAL_NOISE_SIGMA,
    NAMELESS_FAMILIES,
    NO_REST_PROBABILITY,
    NO_STRETCH_PROBABILITY,
    POSITION_AXES,
    USUAL_NOISE_SHARE,
    USUAL_REST,
)
from planner.fit.cross_validation import number_targets, renumber_places, transferable_model
from planner.fit.least_squares import Fit
from planner.fit.noise import Noise
from planner.fit.problem import FitProblem
from planner.fit.wild_rows import validation_weights
from planner.inference.posterior_background import EffectFamily
from planner.inference.posterior_draws import ChainLimits
from planner.inference.posterior_fit import NO_LIMITS, PosteriorFit, draw_posterior
from planner.runs.run import Run, Samples

SWEEPS = 40  # how often sizes are drawn without each, from where those of the whole run stand
NOISES: Array = np.exp(np.linspace(-1.2, 1.5, 19))  # over the usual noise, and
LOGS: Array = np.linspace(-1.5, 4.0, 23)  # of the stretch of one region, and of what regions have in common
APART: Array = np.array([0.0, 0.25, 0.5, 0.75, 1.0])  # one sigma of the logarithm of a region's stretch
RESTS: Array = np.append(0.0, 0.05 * np.exp(np.linspace(0.0, 6.0, 19)))  # over the usual noise
LOG_RESTS = np.log(RESTS[1:])


@dataclass(frozen=True)
class Misfit:
    """Draws that go with the robots drawn from a posterior.

    Attributes:
        stretch: factor on their distance from its mean, (n,), at least 1: that regions came out better than expected is
            no reason to be surer of what no region shows, such as a scale.
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
    """Readings of one region, predicted by a posterior that did not see them, in directions that are independent.

    Attributes:
        residual: what is left of them, (m,) [m].
        open: variance of the prediction by what the posterior leaves open, (m,) [m²].
        kept: the part of ``open`` that is not stretched: what priors make of it and not the noise, (m,) [m²].
        noise: variance of the reading, gauge and joints as large beside each other as was fitted, and together as large
            as is usual by what is declared: what is fitted may be misfit, (m,) [m²].
        turn: from readings, one behind the other, to these directions, (m, m).
    """

    residual: Array
    open: Array
    noise: Array
    turn: Array
    kept: Array | float = 0.0

    @classmethod
    def of(cls, residual: Array, spread: Array, noise_root: Array, by_noise: Array | None = None) -> "HeldOutReadings":
        """Turn readings into the directions in which what is left open is independent.

        Args:
            residual: of n samples, (n, r) [m].
            spread: a square root of the covariance of their prediction, (n, r, k) [m].
            noise_root: L⁻¹ of the covariance L Lᵀ of every sample's noise, (n, r, r) [1/m].
            by_noise: the same as ``spread`` of the part that the readings' noise makes; none: of all of it.
        """
        size = float(np.exp(-np.log(np.abs(np.einsum("nii->ni", noise_root))).mean()))  # of the noise
        n, r = residual.shape
        flat = size * np.einsum("nij,njk->nik", noise_root, spread).reshape(n * r, -1)
        values, axes = np.linalg.eigh(flat @ flat.T)
        open_ = np.maximum(values, 0.0)
        turn = size * np.einsum("nia,nij->anj", axes.reshape(n, r, -1), noise_root).reshape(n * r, -1)
        part = open_ if by_noise is None else ((turn @ by_noise.reshape(n * r, -1)) ** 2).sum(axis=1)
        return cls(turn @ residual.ravel(), open_, np.full(n * r, size**2), turn, open_ - np.minimum(part, open_))

    def weigh(self, residual: Array) -> Array:
        """Return other residuals (n, r) of these readings in standard deviations of what was expected, (m,)."""
        return np.asarray(self.turn @ residual.ravel() / np.sqrt(self.open + self.noise))


@dataclass(frozen=True)
class HeldOutRegion:
    """A region of the workspace as the others predict it.

    Attributes:
        samples: that were looked at, (n,) int.
        readings: what is left of their positions, with what was expected.
    """

    samples: np.ndarray
    readings: HeldOutReadings


@dataclass(frozen=True)
class RepeatedReadings:
    """Readings of poses to which the arm came back: what they scatter by is noise, whatever the model lacks.

    Attributes:
        square: sum of their squares about the means of the poses, over the usual variance of the noise.
        freedom: degrees of freedom behind it.
    """

    square: float = 0.0
    freedom: int = 0

    @classmethod
    def of(cls, fit: Fit, run: Run) -> "RepeatedReadings":
        """Compare the first readings of every visit to a pose, less what a fit to the run has of time and approach."""
        if run.continuous:
            return cls()
        pose = number_targets(run.samples)
        # then the arm stands still; a row that stands outside says nothing of the noise
        first = np.flatnonzero(np.append(True, np.diff(pose) != 0) & (fit.problem.weight >= COUNTED))
        visited = np.unique(pose[first], return_inverse=True)[1].reshape(-1)
        width = min(POSITION_AXES, fit.model.width)
        left = fit.problem.residual(fit.errors)[first, :width]
        apart = left - mean_by_group(left, visited)[visited]
        white = np.einsum("nij,nj->ni", _noise_root(fit.problem, width)[first], apart)
        return cls(float((white**2).sum()), width * (len(first) - int(visited.max(initial=-1)) - 1))

    def log_density(self, factors: Array) -> Array:
        """Return the log density at noises (k,) over the usual one, without a constant."""
        return np.asarray(-0.5 * self.square / factors**2 - self.freedom * np.log(factors))


NEVER_REPEATED = RepeatedReadings()


def predict_regions(
    before: Fit,
    run: Run,
    base: FitProblem,
    background: Sequence[EffectFamily],
    time: float,
    start: Mapping[str, float],
    curves: frozenset[str],
    weight: Array,
    limits: ChainLimits = NO_LIMITS,
) -> tuple[HeldOutRegion, ...]:
    """Predict every region of the workspace by a posterior of the others; the arguments as of ``draw_posterior``.

    Rows that stand outside the noise are not held against any.
    """
    region, out = number_regions(run.samples, before), []
    for k in range(region.max() + 1):
        out.append(_predict_region(before, run, region == k, base, background, time, start, curves, weight, limits))
        base.memory.parts.clear()  # basis functions of a region and of the others
    return tuple(out)


def number_regions(samples: Samples, fit: Fit) -> np.ndarray:
    """Number the regions of the workspace to which samples belong, (n,) int.

    The workspace is halved by the joint whose angles move the tool apart most, and each half again.
    """
    context = Context(fit.setup, samples)
    reach = np.sqrt((context.motion.point_screws(context.joints) ** 2).sum(axis=1).mean(axis=1))  # [m/rad]
    place, out = samples.q * reach, np.zeros(len(samples), dtype=int)
    for halving in range(2):  # into four regions, each of which is predicted by the others
        for k in range(2**halving):
            mine = np.flatnonzero(out == k)
            if not len(mine):
                continue
            own = place[mine]
            along = own[:, int(np.argmax(own.std(axis=0)))]
            out[mine[along > np.median(along)]] += 2**halving
    return np.unique(out, return_inverse=True)[1].reshape(-1)


def draw_misfit(
    parts: Sequence[HeldOutReadings],
    count: int,
    acting: np.ndarray,
    repeats: RepeatedReadings = NEVER_REPEATED,
    seed: int = 0,
) -> Misfit:
    """Return ``count`` posterior draws of the misfit's stretch and rest, given the held-out readings.

    Args:
        parts: readings held out.
        count: of the draws.
        acting: how many families act without a name, in each draw of the sizes, (d,) int.
        repeats: what poses measured again say of the noise.
        seed: of the draws.
    """
    usual = float(np.mean([p.noise.mean() for p in parts]))
    each = np.stack([_log_density(part, usual) for part in parts])  # of noise, rest and stretch of each region
    logs = np.stack(
        [_mix_regions(each, *chances) for chances in zip(_chances_about(LOG_RESTS), _chances_about(LOGS), strict=True)]
    )
    logs += (-0.5 * (np.log(NOISES) / LOG_USUAL_NOISE_SIGMA) ** 2 + repeats.log_density(NOISES))[:, None, None]
    logs += _spike_and_slab(np.log(RESTS[1:] / USUAL_REST) / LOG_REST_SIGMA, no_rest_probability(acting))[:, None]
    logs += _spike_and_slab(LOGS / LOG_STRETCH_SIGMA, NO_STRETCH_PROBABILITY)
    # half normal, one sigma 0.5: regions of one robot differ by a factor of one and a half
    logs += (-0.5 * (APART / 0.5) ** 2)[:, None, None, None]
    chance = np.exp(logs - logs.max()).sum(axis=1)
    which, off = _spread_evenly(chance.ravel(), count, np.random.default_rng(seed))
    apart, rest, common = np.unravel_index(which, chance.shape)
    log = np.append(0.0, LOGS)[common] + np.where(common > 0, APART[apart] * off[0], 0.0)
    one = APART[apart] * off[1] - APART[apart] ** 2  # of one region, about the mean square over many
    return Misfit(np.exp(np.maximum(log, 0.0)), RESTS[rest] * np.exp(one) * np.sqrt(usual))


def _mix_regions(each: Array, of_rest: Array, of_stretch: Array) -> Array:
    """Return log densities (noises, rests, 1 + stretches) of regions whose rests and stretches lie about common ones.

    Args:
        each: of every region, (regions, noises, rests, stretches).
        of_rest, of_stretch: probabilities of the values of a region about each common one, (k, s).
    """
    some = np.moveaxis(_mix(np.moveaxis(each[:, :, 1:], 2, -1), of_rest), -1, 2)
    own = np.concatenate([each[:, :, :1], some], axis=2)
    none = own[..., [int(np.argmin(np.abs(LOGS)))]].sum(axis=0)
    return np.concatenate([none, _mix(own, of_stretch).sum(axis=0)], axis=-1)


def _spread_evenly(chance: Array, count: int, rng: np.random.Generator) -> tuple[np.ndarray, Array]:
    """Return positions in chances (k,) as often as they are likely, and pairs of normal values with them, (2, count).

    They are a lattice of rank 1 in random order: what 95 % of a few hundred robots stay below would else scatter by a
    twentieth from one seed to another.
    """
    from scipy.special import ndtri  # only here

    k = rng.permutation(count)
    golden = 0.5 * (np.sqrt(5) - 1)  # of its multiples the fractions lie evenly for any count, as do those of √2
    places = np.searchsorted(np.cumsum(chance), (k + 0.5) / count * chance.sum())
    off = ndtri(np.stack([(golden * k + 0.5 * golden) % 1.0, (np.sqrt(2) * k + 0.5) % 1.0]))
    return np.minimum(places, len(chance) - 1), np.asarray(off)


def no_rest_probability(acting: np.ndarray) -> float:
    """Return how likely there is no rest where so many families act without a name, in each draw of the sizes (d,).

    Their number is taken as geometric, with one mean for arms whose causes the catalogue has and one for all others.
    """

    def chance(mean: float) -> float:
        """Return the probability of as many families where their mean number is ``mean``."""
        return float((mean**acting / (1 + mean) ** (acting + 1.0)).mean())

    named, lacking = (chance(mean) for mean in (NAMELESS_FAMILIES, FAMILIES_OF_A_REST))
    return NO_REST_PROBABILITY * named / (NO_REST_PROBABILITY * named + (1 - NO_REST_PROBABILITY) * lacking)


def _log_density(part: HeldOutReadings, usual: float) -> Array:
    """Return log densities (noises, rests, stretches) of the readings of one region; ``usual`` noise variance [m²]."""
    out = np.empty((len(NOISES), len(RESTS), len(LOGS)))
    square, moved = part.residual**2, (RESTS**2 * usual)[:, None]
    for i, factor in enumerate(NOISES):
        for j, log in enumerate(LOGS):
            left = np.exp(2 * log) * (part.open - part.kept) + part.kept
            variance = factor**2 * part.noise + left + moved
            out[i, :, j] = -0.5 * (square / variance + np.log(variance)).sum(axis=1)
    return out


def _chances_about(logs: Array) -> Array:
    """Return the probabilities (a, k, s) of the values of a region (s,), of each spread and about each of them (k,)."""
    off = (logs - logs[:, None]) / np.maximum(APART, 1e-3)[:, None, None]
    weight = np.exp(-0.5 * (off**2 - (off**2).min(axis=2, keepdims=True)))
    return np.asarray(weight / weight.sum(axis=2, keepdims=True))


def _mix(logs: Array, chance: Array) -> Array:
    """Return the log densities (…, k) of mixtures of those with logs (…, s), with probabilities (k, s)."""
    top = logs.max(axis=-1, keepdims=True)
    return np.asarray(top + np.log(np.exp(logs - top) @ chance.T + 1e-300))


def _spike_and_slab(off: Array, none: float) -> Array:
    """Return log probabilities (1 + k,): ``none`` of 0, and of values so many standard deviations off the usual one."""
    weight = np.exp(-0.5 * off**2)
    return np.asarray(np.log(np.append(none, (1 - none) * weight / weight.sum())))


def _predict_region(
    before: Fit,
    run: Run,
    test: np.ndarray,
    base: FitProblem,
    background: Sequence[EffectFamily],
    time: float,
    start: Mapping[str, float],
    curves: frozenset[str],
    weight: Array,
    limits: ChainLimits,
) -> HeldOutRegion:
    """Predict the positions of the samples ``test`` (n,) bool by a posterior of the others."""
    seen = _thin(np.flatnonzero(~test), 2_400 // base.model.width)  # readings of a long run that fit and judge
    unseen = _worth_one_each(np.flatnonzero(test & (weight >= COUNTED)), time, base.model.width)
    worth, share = max(1.0, time * len(seen) / (~test).sum()), float((~test).mean())
    own, others = base.take(seen), run.take(seen)
    given = before, others, base.model, background, worth, curves
    drawn = draw_posterior(
        *given, sweeps=SWEEPS, share=share, start=start, weight=weight[seen], limits=limits, base=own
    )
    known, noise_root = drawn.fit_at_start()
    noise = _scale_noise(known.problem.whitener.noise, 1 / np.sqrt(worth))
    there = base.take(unseen).restart_with(known.model, noise)
    return HeldOutRegion(unseen, _hold_out(there, known.errors, known.solution.root(known.problem.prior), noise_root))


def predict_validation(posterior: PosteriorFit, run: Run, time: float) -> HeldOutReadings | None:
    """Predict the positions of a run that no fit saw by a posterior of which ``time`` samples are worth one.

    ``None`` where the run stands in frames of its own. Rows that are off far more than the others are left out.
    """
    known = posterior.fit
    if (usable := transferable_model(known, run)) is None:
        return None
    model, which = usable
    whole = FitProblem.of(model, renumber_places(run, known.setup))
    fine = np.flatnonzero(validation_weights(whole.residual(known.errors[which])) >= COUNTED)
    few = run.take(_worth_one_each(fine, time if run.continuous else 1.0, model.width))
    noise = _scale_noise(known.problem.whitener.noise, 1 / np.sqrt(time))
    there = FitProblem.of(model, renumber_places(few, known.setup), noise)
    roots = (known.solution.root(known.problem.prior), posterior.noise_root)
    return _hold_out(there, known.errors[which], *(root[which] for root in roots))


def _hold_out(there: FitProblem, errors: Array, root: Array, by_noise: Array) -> HeldOutReadings:
    """Return what is left of positions with errors (P,), known by roots (P, k) of covariance and its noise's part."""
    linear, width = there.linearize(errors), min(POSITION_AXES, there.model.width)
    noise_root = _noise_root(there, width)
    rows = linear.rows[:, :width]
    spread, own = ((rows.reshape(-1, len(r)) @ r).reshape(*rows.shape[:2], -1) for r in (root, by_noise))
    return HeldOutReadings.of(linear.residual[:, :width], spread, noise_root, own)


def _noise_root(problem: FitProblem, width: int) -> Array:
    """Return L⁻¹ of the covariance L Lᵀ of each position's noise, as large as usual, (n, width, width) [1/m]."""
    white = problem.whitener
    fitted, declared = (w.covariance()[:, :width, :width] for w in (white, white.with_noise(Noise())))
    usual = USUAL_NOISE_SHARE**2 * np.einsum("nii->", declared) / np.einsum("nii->", fitted)
    return np.asarray(np.linalg.inv(np.linalg.cholesky(usual * fitted)))


def _worth_one_each(which: np.ndarray, time: float, width: int) -> np.ndarray:
    """Return some of the samples: neighbours in time err alike, and only so many are worth one each."""
    most = 600  # readings of a region that are looked at
    return _thin(which, min(int(len(which) / time) + 1, most // min(POSITION_AXES, width)))


def _scale_noise(noise: Noise, factor: float) -> Noise:
    """Return noise a factor as large."""
    return Noise(noise.gauge * factor, noise.joints * factor, noise.angle * factor)


def _thin(which: np.ndarray, most: int) -> np.ndarray:
    return which[even_positions(len(which), min(len(which), most))]
