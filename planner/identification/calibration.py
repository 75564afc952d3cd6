"""The result of identification: stages, parameters, findings, and what the tests of the residual say."""

from dataclasses import dataclass

import numpy as np

from planner.common.units import Array
from planner.design.observability.identifiability import DroppedParameter
from planner.identification.least_squares import Fit
from planner.runs.run import Run


@dataclass(frozen=True)
class Metrics:
    """Root mean square, mean and largest error of a set of samples [m]; ``spread`` of the rms over the folds [m]."""

    rms: float
    mean: float
    largest: float
    spread: float | None = None

    @classmethod
    def of(cls, residual: Array, fold: np.ndarray | None = None) -> "Metrics":
        """Judge residuals (n, r) [m]; a probe's orientation is left aside."""
        size = error_size(residual)
        spread = None
        if fold is not None:
            square = np.bincount(fold, size**2) / np.bincount(fold)
            spread = float(np.std(np.sqrt(square), ddof=1)) if len(square) > 1 else None
        return cls(float(np.sqrt((size**2).mean())), float(size.mean()), float(size.max()), spread)


def error_size(residual: Array) -> Array:
    """Length of each sample's error (n,) [m] of residuals (n, r)."""
    return np.asarray(np.linalg.norm(residual[:, :3], axis=1))


@dataclass(frozen=True)
class Stage:
    """One stage of the fit and its errors.

    Attributes:
        name: ``nominal``, ``frames``, ``geometry``, or the effect that was added.
        effects: all effects in the model at this stage.
        parameters: how many were fitted.
        train, held_out, validation: the errors; ``validation`` only where a second run was given.
        residual, held_residual: of every sample, (n, r) [m, rad].
    """

    name: str
    effects: tuple[str, ...]
    parameters: int
    train: Metrics
    held_out: Metrics
    validation: Metrics | None
    residual: Array
    held_residual: Array


@dataclass(frozen=True)
class Estimate:
    """One parameter after the fit, in SI units.

    Attributes:
        name, unit, what: as in the model.
        value, nominal: of the elementary transform, the fixture or the reading.
        std: standard deviation; ``None`` where the data do not show the parameter.
        identifiable: whether it was fitted.
        absorbs: names of left-out parameters whose error it also carries.
        because: why it was left out.
        group: ``gauge``, ``geometry`` or the effect it belongs to.
    """

    name: str
    unit: str
    what: str
    value: float
    nominal: float
    std: float | None
    identifiable: bool
    absorbs: tuple[str, ...]
    because: str | None
    group: str


@dataclass(frozen=True)
class Finding:
    """An effect that the run shows, in SI units.

    Attributes:
        effect, on: what and where, for instance ``gear ripple`` and ``joint 3``.
        value, std, unit: size of the effect (length of its parameters' vector) and, its shape held, how well that is
            known.
        inner_name, inner, inner_std, inner_unit: the number inside it, where it has one.
        log_p: logarithm of the chance of so large an effect, corrected for everything that was tried.
        held_out_gain: fall of the root mean square error on held-out samples by this effect [m].
        rivals: other effects that explain the same within uncertainty.
        note: what a mechanic would say.
    """

    effect: str
    on: str
    value: float
    std: float
    unit: str
    inner_name: str | None
    inner: float | None
    inner_std: float | None
    inner_unit: str | None
    log_p: float
    held_out_gain: float
    rivals: tuple[str, ...]
    note: str


@dataclass(frozen=True)
class DetectionLimit:
    """The smallest size of an effect that the run would have shown in 95 of 100 cases, in ``unit``."""

    effect: str
    on: str
    size: float
    unit: str


@dataclass(frozen=True)
class TracingResult:
    """What tracing found, and how it went.

    Attributes:
        findings: effects in the model, in the order in which they were found.
        limits: for every effect that was looked for and not found.
        rejected: (name, why) of what was refitted and not kept.
        tried: number of effects and inner values that were looked at.
    """

    findings: tuple[Finding, ...]
    limits: tuple[DetectionLimit, ...]
    rejected: tuple[tuple[str, str], ...]
    tried: int


@dataclass(frozen=True)
class Calibration:
    """A robot identified from a run.

    Attributes:
        run: what was measured.
        split_by, hold_out, n_groups: how poses were held out.
        within: the last stage's errors on single poses held out, beside those of whole sessions, placements or blocks.
        stages: in order.
        fit: the last stage's.
        dropped: parameters the data cannot see.
        estimates: every parameter, seen or not.
        covariance: of the fitted parameters, (P, P).
        correlation_time: how many samples are worth one.
        condition_number: of the rows per prior size.
        noise_floor: standard deviation of repeated readings [m], or ``None`` without repeats.
        known_anywhere: error of the tool to be expected over the whole workspace by the covariance [m], rms.
        traced: what the residual was traced to, ``None`` where that was not asked for.
        problems: reasons not to use the result; empty when the fit passed its own checks.
        warnings: what a person should know.
    """

    run: Run
    split_by: str
    hold_out: float
    n_groups: int
    within: Metrics | None
    stages: tuple[Stage, ...]
    fit: Fit
    dropped: tuple[DroppedParameter, ...]
    estimates: tuple[Estimate, ...]
    covariance: Array
    correlation_time: float
    condition_number: float
    noise_floor: float | None
    workspace_error: float
    traced: TracingResult | None
    problems: tuple[str, ...]
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class ResidualTest:
    """One test: along what, how likely chance is after Bonferroni, rms of what follows it [m]."""

    along: str
    p_value: float
    rms: float


@dataclass(frozen=True)
class ResidualDiagnosis:
    """What all tests of the last stage's residual said.

    Attributes:
        trials: all of them, in order; empty where the run is too small.
        found: those that are not chance, the largest first.
        rms: of what follows all of ``found`` together [m].
        sentence: the same in words.
    """

    trials: tuple[ResidualTest, ...]
    found: tuple[ResidualTest, ...]
    rms: float
    sentence: str

    @property
    def structured(self) -> bool:
        """Whether the residual is not chance."""
        return bool(self.found)
