"""Joint compliances from the deflections of loaded circles: force (JᵀF) against deflection.

Each angle of each circle and sense has a free offset of its own: geometry, centring and the bar's zero drop out, and
what is left is the deflection between loads (EDBB paper, eq. 8), the noise of the base load counted once, not in every
difference. Rows and torques are those of the model that every other fit uses. A turn differs from its repeats by a
smooth curve, not by single readings, so each harmonic over the angle is weighed by its own noise (``harmonics``).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.loaded.balance import balanced, raised, samples_of, settled
from planner.loaded.harmonics import Waves
from planner.loaded.told import Combination, Compliances
from planner.loaded.types import Curves
from planner.model import Model
from planner.model.parameters import compliance_parameters
from planner.rig import Rig, Targets
from planner.units import MM, Array, frozen

ROUNDS = 6  # linear but for what the deflection itself changes of the arm's pose, and for the noise
ROUGH = 2.0  # times the variance of the repeats: beyond that it is no chance of the noise
STILL = 1e-5  # of the prior sizes: a step that changes nothing
FAINTEST = 1e-12  # of the largest information in prior sizes: what is below is rounding
RAISE = 0.5 * MM  # for the numeric derivative by the fixture's height


@dataclass(frozen=True)
class Found:
    """Compliances, and how much higher each circle's fixture stands than stated, (S,) [m]."""

    compliances: Compliances
    heights: Array


def compliances(rig: Rig, curves: Sequence[Curves]) -> Found:
    """Fit the compliance of every joint to all circles together.

    How far below the circle the fixture's ball lies decides where the load points; it is known as well as the cell
    says, and what that leaves open counts in the uncertainties.
    """
    model = Model(rig, tuple(compliance_parameters(rig)))
    value, prior = np.zeros(len(model.parameters)), model.prior
    heights, noise, misfit = np.zeros(len(curves)), [np.full(1, np.nan)] * len(curves), 1.0
    sizes = [float(rig.place_prior[c.circle.place]) for c in curves]
    for k in range(ROUNDS):
        moved = [replace(model, rig=raised(rig, c, h)) for c, h in zip(curves, heights, strict=True)]
        waves = [waves_of(m, c, value) for m, c in zip(moved, curves, strict=True)]
        noise = noise if k else [_first_noise(w, c) for w, c in zip(waves, curves, strict=True)]
        told = [w.told(s, p, h) for w, s, p, h in zip(waves, noise, sizes, heights, strict=True)]
        information = np.asarray(sum(t.information for t in told))
        pulled = np.asarray(sum(t.pulled for t in told)) + information @ value
        change = np.linalg.solve(information * np.outer(prior, prior) + np.eye(len(prior)), pulled * prior)
        step, value = prior * change - value, prior * change
        raise_by = np.array([t.height(step) for t in told])
        heights = heights + raise_by
        left = [w.after(step, h) for w, h in zip(waves, raise_by, strict=True)]
        misfit = _misfit(left, curves, len(value))
        noise = [_noise(w, c, misfit) for w, c in zip(left, curves, strict=True)]
        if k > 1 and np.abs(step / prior).max() < STILL and np.abs(raise_by).max() < STILL * MM:
            break
    size = np.sqrt(np.mean([np.mean(w.averaged(_first_noise(w, c))) for w, c in zip(left, curves, strict=True)]))
    found = posterior(model.names, prior, information, pulled, float(size), float(np.sqrt(misfit)))
    return Found(found, frozen(heights))


def _first_noise(waves: Waves, curves: Curves) -> Array:
    """Variance of one turn's harmonics, (H,) [m²], by the repeats, or without any flat, by what differs."""
    if np.all(np.isfinite(curves.noise)):
        return curves.noise
    return np.full_like(waves.scatter, float(np.mean(waves.scatter)))


def _misfit(left: Sequence[Waves], curves: Sequence[Curves], parameters: int) -> float:
    """How much more variance the loads' curves have about the fit than the repeats about their mean; 1 without any."""
    known = [(w, c) for w, c in zip(left, curves, strict=True) if np.all(np.isfinite(c.noise))]
    if not known:
        return 1.0
    return sum(w.misfit(c.noise) for w, c in known) / max(1, sum(w.readings for w, _ in known) - parameters)


def _noise(left: Waves, curves: Curves, misfit: float) -> Array:
    """Variance of one turn's harmonics to weigh by, (H,) [m²].

    Where the curves differ a little more than the repeats all of it is scaled (Birge 1932). Where they differ by much
    more the cause lies in some harmonics, the low ones mostly, and each has the variance that is left in it.
    """
    if not np.all(np.isfinite(curves.noise)):
        return left.scatter
    return curves.noise * max(1.0, misfit) if misfit < ROUGH else np.maximum(curves.noise, left.scatter)


def waves_of(model: Model, curves: Curves, value: Array) -> Waves:
    """Rows and residuals of a circle about some compliances, the fixture's height last."""
    rig = settled(model.rig, curves, value)
    samples = balanced(rig, samples_of(curves), value)
    about = replace(model, rig=rig).linear(samples, Targets(length=curves.length.ravel()))
    up, down = (_length(raised(model.rig, curves, h), curves, value) for h in (RAISE, -RAISE))
    columns = np.column_stack([about.rows[:, 0], (up - down) / (2 * RAISE), about.residual[:, 0]])
    return Waves.of(columns.reshape(*curves.length.shape, -1), curves.repeats.astype(float))


def _length(rig: Rig, curves: Curves, value: Array) -> Array:
    """Predicted readings, (D·K·B,) [m], of an arm in balance with its loads."""
    rig = settled(rig, curves, value)
    samples = balanced(rig, samples_of(curves), value)
    return -Model(rig, ()).residual(samples, Targets(length=np.zeros(len(samples))))[:, 0]


def bar_deflection(rig: Rig, curves: Curves, value: Array) -> Array:
    """Change of the reading by the bar's whole load, (D, K, B) [m], with joints of the compliances (N,) [rad/Nm]."""
    free = replace(curves, force=np.zeros_like(curves.force))
    change = _length(rig, curves, value) - _length(rig, free, value)
    return np.asarray(change.reshape(curves.length.shape))


def posterior(
    names: tuple[str, ...], prior: Array, information: Array, pulled: Array, noise: float, misfit: float
) -> Compliances:
    """Put what the deflections tell (N, N), (N,) beside the prior sizes (N,) [rad/Nm]."""
    scaled = information * np.outer(prior, prior)
    covariance = np.linalg.inv(scaled + np.eye(len(prior)))
    value = prior * (covariance @ (pulled * prior))
    std = prior * np.sqrt(np.diag(covariance))
    return Compliances(
        names, frozen(value), frozen(std), frozen(prior), frozen(information), frozen(pulled),
        combinations(names, scaled), noise, misfit,
    )  # fmt: skip


def combinations(names: tuple[str, ...], scaled: Array) -> tuple[Combination, ...]:
    """Directions of an information matrix in prior sizes (N, N), from the best known to the least."""
    size, axes = np.linalg.eigh(scaled)
    out = []
    for k in np.argsort(-size, kind="stable"):
        axis = axes[:, k] * np.sign(axes[int(np.argmax(np.round(np.abs(axes[:, k]), 9))), k])
        seen = max(float(size[k]), FAINTEST * float(size.max()), 1e-300)
        out.append(Combination(names, frozen(axis), float(1.0 / np.sqrt(seen))))
    return tuple(out)
