"""The posterior: gauge, geometry, findings and background fitted together, with sizes that the run says.

Sizes of the families maximise the evidence (see ``posterior_evidence``). Their logarithms have a normal prior about the
catalogue's; those of the background share a part of it, so that an arm whose families are small where the run sees them
is not expected to be bad where it sees nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.common.determinism import even_positions
from planner.common.units import Array
from planner.effects.parameters import Parameter
from planner.identification.least_squares import Fit, fit
from planner.identification.noise import RATIO, Noise
from planner.identification.posterior_background import GAUGE_SCALE, OF_SHAPE, EffectFamily
from planner.identification.posterior_evidence import MOST_STEPS, RandomEffects
from planner.identification.problem import FitProblem
from planner.model.model import Model
from planner.runs.run import Run

LEARNING_READINGS = 900  # of a long run that say how large the families are
FEW_STEPS = 15  # that tell what the rest is worth without one finding
ROUNDS = 3  # of linearising and learning
SETTLED = 0.05  # change of all logarithms that ends the rounds
CENTRE, WIDTH, SHARED = -1.0, 1.0, 2.0  # of the logarithm of a background factor: mean, one sigma, that of all alike
FREE_WIDTH = 1.5  # the same of gauge, time and temperature, each for itself
OWN_WIDTH = 1.0  # the same of geometry and of findings, about 0
NOISE_WIDTH = 0.7  # of the logarithm of the noise
FINDING_EVIDENCE = 12.0  # fall of the deviance that a finding must bring: it is one of some hundred that were tried
SHAPED = tuple(f"{kind}, gauge" for kind in (*OF_SHAPE, GAUGE_SCALE))  # a wrong exponent of them moves all lengths
UNKNOWN = 1.0  # [m, rad] prior size that stands for none at all


@dataclass(frozen=True)
class FamilySize:
    """How large a family is: factor on the sizes that the catalogue expects."""

    name: str
    factor: float


@dataclass(frozen=True)
class PosteriorFit:
    """The posterior.

    Attributes:
        fit: mean and information of all parameters, prior sizes and noise as learnt.
        families: sizes that were learnt.
        deviance: minus twice the logarithm of the evidence with the prior of the sizes, without a constant.
    """

    fit: Fit
    families: tuple[FamilySize, ...]
    deviance: float


def fit_posterior(
    before: Fit, run: Run, whole: Model, background: Sequence[EffectFamily], correlation_time: float = 1.0
) -> PosteriorFit:
    """Fit everything together.

    Args:
        before: the fit that it starts from; effects in it stay, with sizes of their own, where they pay.
        run: what was measured.
        whole: gauge and geometry, what the run cannot identify too, with the prior sizes of the robot's file.
        background: what else may be there.
        correlation_time: how many samples of the run are worth one.

    Raises:
        NoSolutionError: the fit does not come to rest.
    """
    most = LEARNING_READINGS // whole.width
    few = run.take(even_positions(len(run), most)) if len(run) > most else run
    best = _learn(before, _without(before.model, *SHAPED), few, whole, background)
    while True:
        groups = {p.group for p in best.own.parameters} - {p.group for p in whole.parameters}
        fewer = [
            best.own.subset([k for k, p in enumerate(best.own.parameters) if p.group != g]) for g in sorted(groups)
        ]
        others = [_learn(before, model, few, whole, background, best) for model in fewer]
        least = min(others, key=lambda o: o.deviance, default=None)
        if least is None or least.deviance > best.deviance + FINDING_EVIDENCE:
            break
        best = least
    problem = FitProblem.of(best.families.model, run)
    prior = problem.prior * best.factors
    sized = tuple(replace(p, prior=float(s)) for p, s in zip(best.families.model.parameters, prior, strict=True))
    noise = Noise(*(float(v) * float(np.sqrt(correlation_time)) for v in best.noise))
    final = FitProblem.of(replace(best.families.model, parameters=sized), run, noise)
    if len(final) == len(before.problem):
        final = replace(final, weight=before.problem.weight)
    sizes = tuple(FamilySize(n, float(f)) for n, f in zip(best.families.names, np.exp(best.logs), strict=False))
    return PosteriorFit(fit(final, start=best.errors, settle=False), sizes, best.deviance)


def _without(model: Model, *groups: str) -> Model:
    return model.subset([k for k, p in enumerate(model.parameters) if p.group not in groups])


@dataclass(frozen=True)
class _Learnt:
    """Sizes learnt with the effects of the model ``own``: logarithms, errors (P,) there, and the deviance."""

    own: Model
    families: "_Families"
    logs: Array
    factors: Array
    noise: Array
    errors: Array
    deviance: float


def _learn(
    before: Fit, own: Model, run: Run, whole: Model, background: Sequence[EffectFamily], near: _Learnt | None = None
) -> _Learnt:
    """Learn the sizes, starting where ``near`` with one finding more ended."""
    families = _Families.of(own, whole, background)
    known = dict(zip(before.model.names, before.errors, strict=True))
    if near is not None:
        known = dict(zip(near.families.model.names, near.errors, strict=True))
    errors = np.array([known.get(p.name, 0.0) for p in families.model.parameters])
    problem = FitProblem.of(families.model, run)
    logs = None if near is None else families.logs_of(near)
    for _ in range(ROUNDS if near is None else 1):
        effects = _linearize(problem, errors, families)
        learnt = effects.learn(logs, MOST_STEPS if near is None else FEW_STEPS)
        settled = logs is not None and bool(np.abs(learnt.logs - logs).max() < SETTLED)
        logs = learnt.logs
        errors = problem.prior * learnt.factors * effects.posterior(logs).mean
        if settled:
            break
    return _Learnt(own, families, learnt.logs, learnt.factors, learnt.noise, errors, learnt.objective)


@dataclass(frozen=True)
class _Families:
    """The model of everything, and which parameters share a size.

    ``family`` (P,) int is −1 where the size is known, as of what places the gauge; ``centre`` (f,) and ``spread``
    (f, f) are mean and covariance of the logarithms of the factors.
    """

    model: Model
    names: tuple[str, ...]
    family: np.ndarray
    centre: Array
    spread: Array

    @classmethod
    def of(cls, before: Model, whole: Model, background: Sequence[EffectFamily]) -> "_Families":
        own = {p.name: p for p in (*whole.parameters, *before.parameters)}  # as fitted only where ``whole`` lacks it
        own |= {p.name: p for p in whole.parameters}
        label = {name: _own_family(p) for name, p in own.items()}
        parameters, rest = dict(own), dict[str, str]()
        for family in background:
            for p in family.parameters:
                if p.name not in parameters:
                    parameters[p.name], rest[p.name] = p, "" if family.known else _background_name(family)
        names = tuple(dict.fromkeys(v for v in (*label.values(), *rest.values()) if v))
        number = {name: k for k, name in enumerate(names)} | {"": -1}
        of_robot = {_background_name(f): f.of_robot for f in background}
        behind = np.array([name in of_robot for name in names], dtype=float)
        alike = np.array([of_robot.get(name, False) for name in names], dtype=float)
        own_width = np.where(behind > alike, FREE_WIDTH, np.where(behind > 0, WIDTH, OWN_WIDTH))
        spread = np.diag(own_width**2) + SHARED**2 * np.outer(alike, alike)
        finite = [p if np.isfinite(p.prior) else replace(p, prior=UNKNOWN) for p in parameters.values()]
        family_of = np.array([number[(label | rest)[p.name]] for p in finite])
        return cls(replace(whole, parameters=tuple(finite)), names, family_of, CENTRE * behind, spread)

    def logs_of(self, near: _Learnt) -> Array:
        """Return logarithms to start from: those of families that another model has too."""
        there = dict(zip(near.families.names, near.logs, strict=False))
        count = len(near.logs) - len(near.families.names)
        own = [float(there.get(n, c)) for n, c in zip(self.names, self.centre, strict=True)]
        return np.append(own, near.logs[-count:])


def _background_name(family: EffectFamily) -> str:
    return f"{family.name} (background)"


def _own_family(p: Parameter) -> str:
    if p.group == "gauge":
        return ""
    return ("lengths" if p.unit == "m" else "angles") if p.group == "geometry" else p.group


def _linearize(problem: FitProblem, errors: Array, families: _Families) -> RandomEffects:
    """Linearise about errors (P,), positions and angles each in axes in which gauge and joints do not mix."""
    linear = problem.linear(slice(0, len(problem)), errors)
    rows, y = linear.rows * problem.prior, linear.residual + linear.rows @ errors
    declared, shaken = problem.whitener.declared, problem.whitener.shaken
    columns, targets, noise = [], [], []
    width = rows.shape[1]
    for start in range(0, width, 3):
        block = slice(start, min(start + 3, width))
        unit = 1 / np.sqrt(declared[block])
        ratio, axes = np.linalg.eigh(shaken[:, block, block] * unit[:, None] * unit)
        turn = np.einsum("nji,j->nij", axes, unit)
        columns.append((turn @ rows[:, block]).reshape(-1, rows.shape[2]))
        targets.append(np.einsum("nij,nj->ni", turn, y[:, block]).ravel())
        part = np.zeros((ratio.size, 2 if width <= 3 else 3))
        part[:, 2 if start else 0], part[:, 1] = 1.0, np.maximum(ratio, 0.0).ravel()
        noise.append(part)
    count = noise[0].shape[1]
    centre = np.append(families.centre, np.zeros(count))
    precision = np.zeros((len(centre), len(centre)))
    precision[:-count, :-count] = np.linalg.inv(families.spread)
    apart = np.eye(count)[0] - np.eye(count)[1]
    precision[-count:, -count:] = np.eye(count) / NOISE_WIDTH**2 + np.outer(apart, apart) / RATIO**2
    return RandomEffects(
        np.concatenate(columns), np.concatenate(targets), families.family, np.concatenate(noise), centre, precision
    )
