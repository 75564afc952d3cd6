"""The posterior: gauge, geometry, findings and background fitted together, averaged over the sizes that they may have.

A family of the background is absent until the run says otherwise: on an arm without effects the robot is that of
geometry alone, on one with effects absence loses by orders of magnitude. Between them, where a run of few poses leaves
it open, mean and covariance are those of the mixture, so that the stated error tells of the choice as well.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.common.determinism import even_positions
from planner.common.units import Array
from planner.effects.compliance import LINK_MASSES
from planner.effects.effect import Parameter
from planner.effects.sizes import LINK_MASS, UNKNOWN_PRIOR
from planner.effects.steps import SLIP
from planner.effects.usual_errors import usual_factors
from planner.fit.assumptions import LOG_NOISE_SIGMA, STANDING_PROBABILITY
from planner.fit.cross_validation import Split, predict_held_out
from planner.fit.least_squares import Fit, Solution
from planner.fit.noise import RATIO, Noise
from planner.fit.problem import FitProblem
from planner.fit.wild_rows import unseen_weights
from planner.inference.posterior_background import (
    OF_BACKGROUND,
    EffectFamily,
    Variant,
    has_name,
    is_left_to_background,
    without_rivals_of,
)
from planner.inference.posterior_draws import ChainLimits, DrawnSizes, RandomEffects, SizeDraw, SizePrior, draw_sizes
from planner.inference.size_mixture import EACH, MixtureMoments, SizeMixture
from planner.model.identification_document import SizeOfFamily
from planner.model.model import Model
from planner.runs.run import Run

FINDING = float(np.exp(-6.0))  # probability of a finding: it is one of some hundred that were tried
NO_LIMITS = ChainLimits()
RARE, COMMON, UNNAMED = 1, 2, 3  # pools: few of many acts; joints and links that yield, of which most arms have some
SLAB: Array = 0.1 * 2.0 ** np.arange(7, dtype=float)  # factors of a family that acts; weights normal in the log
SLAB_WEIGHT: Array = np.exp(-0.5 * (np.log(SLAB) + 1.0) ** 2)  # normal in the log about 1/e, its sigma 1
OWN: Array = np.exp(np.linspace(-2.0, 2.0, 9))  # the same of geometry and of findings
OWN_WEIGHT: Array = np.exp(-0.5 * np.log(OWN) ** 2)  # normal in the log about 1, its sigma 1


@dataclass(frozen=True)
class PosteriorFit:
    """The posterior.

    Attributes:
        fit: mean and information of all parameters that may act; its prior sigmas and noise are means over the draws.
        mixture: sizes that were drawn.
        noise_root: root of the part of its covariance that the readings' noise makes, and not the priors, (P, P).
        drawn: parameters drawn from it, (P, n) [m, rad, …].
        of_noise: the part of their distance from the mean that the readings' noise makes, (P, n).
        gram: products of whitened rows per prior sigma and residuals, (P + 1, P + 1).
        families: sizes of them.
        findings: groups of ``before`` that stand.
        record: what was drawn of the sizes.
    """

    fit: Fit
    mixture: SizeMixture
    noise_root: Array
    drawn: Array
    of_noise: Array
    gram: Array
    families: tuple[SizeOfFamily, ...]
    findings: tuple[str, ...]
    record: "DrawRecord"


@dataclass(frozen=True)
class DrawRecord:
    """The draws of the sizes of all families, and what they were drawn by.

    Attributes:
        model: of all that may act.
        run: samples that sizes were learnt from.
        errors: of the model's parameters, about which it was linearised, (P,).
        names: of the families, (f,).
        variants: of findings, by the names of their families.
        effects: the linear model.
        draws: in order.
    """

    model: Model
    run: Run
    errors: Array
    names: tuple[str, ...]
    variants: Mapping[str, Variant]
    effects: RandomEffects
    draws: tuple[DrawnSizes, ...]

    @property
    def last_factors(self) -> dict[str, float]:
        """Factors of the families in the last draw, by name."""
        return dict(zip(self.names, map(float, self.draws[-1].factors), strict=True))

    def finding_of(self, family: str) -> str:
        """Return the finding that a family is a variant of; of any other family its name."""
        return self.variants[family].finding if family in self.variants else family

    def probability(self, finding: str) -> float:
        """Return how likely a finding acts, at whatever value of its inner number."""
        own = [k for k, name in enumerate(self.names) if self.finding_of(name) == finding]
        return float(np.mean([d.acting[own].max() for d in self.draws]))

    def other_values(self, finding: str) -> dict[float, float]:
        """Return how likely a finding has each other value of its inner number, the likeliest first, if it acts."""
        acts = {n: float(np.mean([d.acting[k] for d in self.draws])) for k, n in enumerate(self.names)}
        whole = sum(p for n, p in acts.items() if self.finding_of(n) == finding)
        out = {v.value: acts[n] / whole for n, v in self.variants.items() if v.finding == finding and whole > 0}
        return dict(sorted(out.items(), key=lambda item: -item[1]))

    def count_nameless(self) -> np.ndarray:
        """Return how many families of the background that may be absent act in each draw, (d,) int."""
        may_miss = [p.factors[0] == 0.0 for p in self.effects.priors]
        nameless = np.array([name.endswith(OF_BACKGROUND) for name in self.names]) & may_miss
        return np.array([np.count_nonzero(d.factors[nameless]) for d in self.draws])


@dataclass(frozen=True)
class DrawnPosterior:
    """The prior sigmas of all families as they were drawn, before the model is fitted with them.

    Attributes:
        problem: of all parameters that may act, with the draws' mean noise.
        start: values that the fit starts from, (P,).
        mixture, families, findings, record: see :class:`PosteriorFit`.
        seed: of the robots that are drawn.
    """

    problem: FitProblem
    start: Array
    mixture: SizeMixture
    families: tuple[SizeOfFamily, ...]
    findings: tuple[str, ...]
    record: DrawRecord
    seed: int = 0

    def predict_held_out(self, split: Split) -> Array:
        """Return residuals (n, r) of samples held out, by the fit with the draws' rms sizes."""
        size = np.sqrt((self.mixture.scaled_sizes**2).mean(axis=0))
        rough = Fit(self.problem, Solution(self.start, np.zeros((0, 0)), 0.0), 0.0)
        return predict_held_out(rough, split, size[None]).residual

    def fit(self) -> PosteriorFit:
        """Fit everything together: mean and information of the mixture, and parameters drawn from it."""
        problem = self.problem
        errors = problem.prior * self.mixture.mean(_gram(problem, self.start), self.start / problem.prior)
        if len(self.record.run) < len(problem):  # so many rows that none of them decides what the others say
            problem = replace(problem, weight=unseen_weights(problem.white_residual(errors)))
        gram = _gram(problem, errors)
        fit, moments = replace(self, problem=problem)._fit_about(gram, errors, EACH)
        unit = problem.prior[:, None]
        noise, drawn, of_noise = unit * moments.noise_root, unit * moments.drawn, unit * moments.of_noise
        return PosteriorFit(fit, self.mixture, noise, drawn, of_noise, gram, self.families, self.findings, self.record)

    def fit_at_start(self) -> tuple[Fit, Array]:
        """Return mean and information alone, linearised where the fit starts, and the root of the noise's part."""
        fit, moments = self._fit_about(_gram(self.problem, self.start), self.start, 0)
        return fit, np.asarray(self.problem.prior[:, None] * moments.noise_root)

    def _fit_about(self, gram: Array, errors: Array, each: int) -> tuple[Fit, MixtureMoments]:
        """Return the mean as linearised about errors (P,), and what else the mixture says."""
        problem, z = self.problem, errors / self.problem.prior
        moments = self.mixture.moments(gram, z, each, self.seed)
        step = np.append(moments.mean - z, -1.0)
        cost = float(step @ gram @ step + moments.mean @ moments.mean)
        found = Solution(problem.prior * moments.mean, moments.information_root, cost)
        effective = float(len(z) - (found.inverse**2).sum())
        return Fit(problem, found, effective), moments


def draw_posterior(
    before: Fit,
    run: Run,
    whole: Model,
    background: Sequence[EffectFamily],
    correlation_time: float = 1.0,
    curves: frozenset[str] = frozenset(),
    sweeps: int | None = None,
    share: float = 1.0,
    start: Mapping[str, float] | None = None,
    weight: Array | None = None,
    limits: ChainLimits = NO_LIMITS,
    base: FitProblem | None = None,
) -> DrawnPosterior:
    """Draw the sizes of everything that may act.

    Args:
        before: the fit that it starts from; effects in it have sizes of their own, or none where they do not pay.
        run: what was measured.
        whole: gauge and geometry, what the run cannot identify too, with the prior sigmas of the robot's file.
        background: what else may be there.
        correlation_time: how many samples of the run are worth one.
        curves: groups of whole curves of gears that stand for what the background has of these gears.
        sweeps: how often every size is drawn, as usual if not given.
        share: of a run that is looked at, which is what ``run`` is.
        start: factors of families that the draws begin with, by name; of others those of the fit.
        limits: seed of the draws, and how many causes may act.
        base: a fit of the same set-up to ``run``, whose basis functions are used; none: a new one.
        weight: by how much each sample of ``run`` counts in the fit, (n,); in full where it is not given.
    """
    # 600: readings of a long run say how large the families are, of a short one those that are independent: noise that
    # stays alike from one to the next would be taken for causes
    most = min(round(600 * share) // whole.width, int(len(run) / correlation_time) + 1)
    looked = even_positions(len(run), min(most, len(run)))
    few = run.take(looked) if len(looked) < len(run) else run
    base = FitProblem.of(whole, run) if base is None else base
    weight = np.ones(len(run)) if weight is None else weight
    found = before.model.subset([k for k, p in enumerate(before.model.parameters) if _is_kept(p.group, curves)])
    families = _Families.of(found, whole, without_rivals_of(curves, background))
    errors = before.at(families.model.names)
    looked_at = base.take(looked) if len(looked) < len(run) else base
    effects = _linearize(looked_at.restart_with(families.model), errors, families, weight[looked])
    count = effects.noise.shape[1]
    noise = before.problem.whitener.noise
    logs = np.log([noise.gauge, noise.joints, noise.angle][:count])
    first = {} if start is None else start
    begin = np.array([first.get(n, own) for n, own in zip(families.names, families.start, strict=True)])
    draws = draw_sizes(families.limit(effects, limits), SizeDraw(begin, logs), limits.seed, sweeps)
    factors = np.stack([d.factors for d in draws])
    acting = factors.any(axis=0)
    kept = np.flatnonzero(np.append(acting, True)[families.family])
    size = np.append(factors, np.ones((len(draws), 1)), axis=1)[:, families.family[kept]]
    variance = np.stack([effects.variance(d.noise_logs) for d in draws])
    ease = (variance / variance.mean(axis=0)).mean(axis=1)
    parts = np.sqrt(np.exp(2 * np.stack([d.noise_logs for d in draws])).mean(axis=0) * correlation_time)
    drawn_weight = np.mean([d.weight for d in draws], axis=0)
    effects, weight = replace(effects, weight=drawn_weight), weight.copy()
    weight[looked] = drawn_weight
    problem = base.restart_with(families.model.subset(list(kept)), Noise(*map(float, parts)))
    problem = replace(problem, weight=weight)
    mixture = SizeMixture(size, ease)
    acts = np.mean([d.acting for d in draws], axis=0)
    sizes = tuple(
        SizeOfFamily(name=name, factor=float(np.sqrt((f**2).mean())), probability=float(p))
        for name, f, p in zip(families.names, factors.T, acts, strict=True)
    )
    record = DrawRecord(families.model, few, errors, families.names, families.variants, effects, draws)
    stand = tuple(name for name in families.findings if record.probability(name) >= STANDING_PROBABILITY)
    return DrawnPosterior(problem, errors[kept], mixture, sizes, stand, record, limits.seed)


def _is_kept(group: str, curves: frozenset[str]) -> bool:
    """Tell whether a group of what was fitted has a place in the posterior; wrong rows count for little there."""
    return group in curves or not (is_left_to_background(group) or group.startswith(SLIP))


def _gram(problem: FitProblem, errors: Array) -> Array:
    """Products of rows per prior sigma and residuals about errors, (P + 1, P + 1)."""
    return problem.white_columns(errors).gram


@dataclass(frozen=True)
class _Families:
    """The model of everything, and which parameters share a size.

    ``family`` (P,) int is −1 where the size is known, as of what places the gauge; ``findings`` are the names of
    families that were found, ``start`` (f,) the factors that the draws begin with, and ``variants`` those of findings.
    """

    model: Model
    names: tuple[str, ...]
    family: np.ndarray
    priors: tuple[SizePrior, ...]
    findings: tuple[str, ...]
    start: Array
    variants: Mapping[str, Variant]

    @classmethod
    def of(cls, before: Model, whole: Model, background: Sequence[EffectFamily]) -> "_Families":
        """Return the families of what was fitted and of what is looked at beside it."""
        fitted = map(_with_known_size, before.parameters)
        own = {p.name: p for p in (*whole.parameters, *fitted)}  # as fitted only where ``whole`` lacks it
        own |= {p.name: p for p in whole.parameters}
        label = {name: _own_family(p) for name, p in own.items()}
        findings = tuple(dict.fromkeys(p.group for p in before.parameters if label[p.name] == p.group))
        parameters, rest = dict(own), dict[str, str]()
        same = {p.moves: p.name for p in own.values()}
        # findings that stand for a family of the background; what is common; what has no name; what always acts, of the
        # gauge and of the robot
        usual, common, unnamed, certain, ever = set[str](), set[str](), set[str](), set[str](), set[str]()
        variants = {f.name: f.variant for f in background if f.variant is not None and f.variant.finding in findings}
        for family in (f for f in background if f.variant is None or f.name in variants):
            for p in family.parameters:
                if p.name in parameters or p.moves in same:
                    name = label[same.get(p.moves, p.name)]
                    usual.add(name)
                else:
                    name = "" if family.known else family.name + ("" if family.variant else OF_BACKGROUND)
                    parameters[p.name], rest[p.name] = p, name
                common |= {name} if family.common else set()
                unnamed |= {name} if family.unnamed else set()
                certain |= {name} if family.certain else set()
                ever |= {name} if family.usual else set()
        names = tuple(dict.fromkeys(v for v in (*label.values(), *rest.values()) if v))
        behind = set(rest.values())
        number = {name: k for k, name in enumerate(names)} | {"": -1}
        finite = tuple(p if np.isfinite(p.prior) else replace(p, prior=UNKNOWN_PRIOR) for p in parameters.values())
        family_of = np.array([number[(label | rest)[p.name]] for p in finite])
        slab, often, foreign = (_spike_and_slab(SLAB, SLAB_WEIGHT, 0.5, pool) for pool in (RARE, COMMON, UNNAMED))
        found, plain = _spike_and_slab(OWN, OWN_WEIGHT, FINDING), _spike_and_slab(OWN, OWN_WEIGHT, 1.0)
        usual = behind | usual.intersection(findings)
        kinds = dict.fromkeys(findings, found) | dict.fromkeys(usual, slab) | dict.fromkeys(variants, found)
        kinds |= dict.fromkeys(common & usual, often) | dict.fromkeys(unnamed, foreign)
        kinds |= dict.fromkeys(certain, _spike_and_slab(SLAB, SLAB_WEIGHT, 1.0))
        kinds |= dict.fromkeys(ever, SizePrior(*usual_factors()))
        priors = tuple(kinds.get(n, plain) for n in names)
        start = np.array([0.0 if n in behind else 1.0 for n in names])
        return cls(replace(whole, parameters=finite), names, family_of, priors, findings, start, variants)

    def limit(self, effects: RandomEffects, limits: ChainLimits) -> RandomEffects:
        """Let no more causes with a name act together than are asked for."""
        optional = [(f, name) for f, name in enumerate(self.names) if self.priors[f].factors[0] == 0.0]
        limited = tuple(f for f, name in optional if has_name(name) and limits.counts(name))
        return replace(effects, limited=limited, most=limits.most_causes or 0)


def _spike_and_slab(factors: Array, weight: Array, acting: float, pool: int = 0) -> SizePrior:
    """Return a prior on factors (k,) with weights (k,), and on 0 with what ``acting`` leaves."""
    chance = acting * weight / weight.sum()
    if acting >= 1.0:
        return SizePrior(factors, chance)
    return SizePrior(np.append(0.0, factors), np.append(1 - acting, chance), pool)


def _with_known_size(p: Parameter) -> Parameter:
    """Return a mass with its size as usual, all else as it is.

    A size that is learnt would let masses, which show through compliances alone, stand for the compliances themselves.
    """
    return replace(p, prior=LINK_MASS.usual) if p.group == LINK_MASSES else p


def _own_family(p: Parameter) -> str:
    """Return the family of what was fitted; none where the size is known."""
    if p.group in ("gauge", LINK_MASSES):
        return ""
    return ("lengths" if p.unit == "m" else "angles") if p.group == "geometry" else p.group


def _linearize(problem: FitProblem, errors: Array, families: _Families, weight: Array) -> RandomEffects:
    """Linearise about errors (P,), each row of the run with a weight (n,)."""
    readings = IndependentReadings.of(problem, errors)
    count = readings.noise.shape[1]
    apart = np.eye(count)[0] - np.eye(count)[1]
    precision = np.eye(count) / LOG_NOISE_SIGMA**2 + np.outer(apart, apart) / RATIO**2
    return RandomEffects(
        readings.columns, readings.y, families.family, readings.noise, families.priors, precision, readings.row, weight
    )


@dataclass(frozen=True)
class IndependentReadings:
    """A linearised problem, positions and angles each in axes in which gauge and joints do not mix.

    Attributes:
        columns: per prior sigma, (m, P).
        y: readings less what is expected of a robot without errors, (m,).
        noise: variance of each by component of the noise as declared, (m, c).
        row: number of the row of the run that each is of, (m,) int.
    """

    columns: Array
    y: Array
    noise: Array
    row: np.ndarray

    @classmethod
    def of(cls, problem: FitProblem, errors: Array) -> "IndependentReadings":
        """Linearise about errors (P,)."""
        linear = problem.linearize(errors)
        rows, y = linear.rows * problem.prior, linear.residual + linear.rows @ errors
        columns, targets, noise, row = [], [], [], []
        width = rows.shape[1]
        for start in range(0, width, 3):
            block = slice(start, min(start + 3, width))
            ratio, axes, unit = problem.whitener.noise_axes(block)
            turn = np.einsum("nji,nj->nij", axes, unit)
            columns.append((turn @ rows[:, block]).reshape(-1, rows.shape[2]))
            targets.append(np.einsum("nij,nj->ni", turn, y[:, block]).ravel())
            part = np.zeros((ratio.size, 2 if width <= 3 else 3))
            part[:, 2 if start else 0], part[:, 1] = 1.0, ratio.ravel()
            noise.append(part)
            row.append(np.repeat(np.arange(len(rows)), ratio.shape[1]))
        return cls(*(np.concatenate(part) for part in (columns, targets, noise, row)))
