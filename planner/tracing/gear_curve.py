"""The whole error of a joint's gear over its angle, where single waves do not tell it.

A gear whose error is no pure tone shows as ripple after ripple. It is one effect: the joint's angle is off by a smooth
function of itself. How quickly it changes, and how large it is, the run decides.
"""

from collections.abc import Iterator

import numpy as np

from planner.common.units import Array
from planner.effects.effect import Effect
from planner.effects.gears import Sine
from planner.effects.nonparametric import GEAR_CURVE, gear_curve
from planner.effects.parameters import Parameter
from planner.model.model import Model
from planner.tracing.dictionary import column_products
from planner.tracing.score_test import ScoreTest
from planner.tracing.state import FittedEffect, base_kind

GEAR_CURVE_KIND = GEAR_CURVE
WAVE_KINDS = ("gear ripple", "encoder once a turn", "encoder twice a turn")
QUICKNESSES = (3.0, 6.0, 10.0, 15.0, 20.0, 30.0)  # waves a turn within which most of the error lies
SIZE_FACTORS = (0.3, 1.0, 3.0)  # times the expected one that are tried


def likeliest_curve(shade: ScoreTest, base: Model, joint: int) -> Effect:
    """The curve of a joint whose quickness the screened samples are likeliest under, any size being possible."""
    q = shade.problem.samples.q
    known = [gear_curve(base.setup, q, joint, f) for f in QUICKNESSES]
    return max(known, key=lambda e: curve_log_likelihood(shade, e))


def curve_log_likelihood(shade: ScoreTest, entry: Effect) -> float:
    """Logarithm of the likelihood of the screened samples with a curve over that without, at its likeliest size."""
    return max(_curve_log_likelihoods(shade, entry))


def _curve_log_likelihoods(shade: ScoreTest, entry: Effect) -> Iterator[float]:
    """Logarithm of the likelihood of the screened samples with the curve over that without, for several sizes."""
    done = column_products(shade.lay_out([(entry, None)]), shade.problem, shade.errors, shade.basis, shade.residual)
    noise = shade.variance / shade.worth
    mu, axes = np.linalg.eigh((done.squares[0] - done.shadow.T @ done.shadow) / noise)
    mu, along = np.maximum(mu, 0.0), axes.T @ done.along / noise
    for s in SIZE_FACTORS:
        yield float((along**2 / (mu + 1 / s**2)).sum() - np.log1p(s**2 * mu).sum()) / 2


def effects_beside_curve(effects: tuple[FittedEffect, ...], entry: Effect) -> tuple[FittedEffect, ...] | None:
    """Effects that stay when a joint's waves give way to its curve; ``None`` where there is no cause for a curve.

    ``entry`` is the wave that would come next. There is cause where the joint has waves already, or where another joint
    of the arm has a curve.
    """
    if entry.kind not in WAVE_KINDS:
        return None
    waves = [h for h in effects if base_kind(h.entry.kind) in (*WAVE_KINDS, GEAR_CURVE_KIND) and h.entry.on == entry.on]
    if not waves and all(h.entry.kind != GEAR_CURVE_KIND for h in effects):
        return None
    return tuple(h for h in effects if h not in waves)


def dominant_waves(parameters: tuple[Parameter, ...], sizes: Array, most: int = 3) -> list[float]:
    """Waves a turn at which a curve is strongest, the strongest first, one for each peak."""
    power = sizes[0::2] ** 2 + sizes[1::2] ** 2
    phis = [p.main.phi for p in parameters[0::2]]
    waves = np.array([phi.frequency for phi in phis if isinstance(phi, Sine)])
    inner = np.r_[0.0, power, 0.0]
    peaks = np.flatnonzero((inner[1:-1] >= inner[:-2]) & (inner[1:-1] > inner[2:]))
    best = sorted(peaks, key=lambda k: -power[k])[:most]
    return [float(waves[k]) for k in best if power[k] > 0.1 * power.max()]
