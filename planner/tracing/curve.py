"""The whole error of a joint's gear over its angle, where single waves do not tell it.

A gear whose error is no pure tone shows as ripple after ripple. It is one effect: the joint's angle is off by a smooth
function of itself. How quickly it changes, and how large it is, the run decides.
"""

from collections.abc import Iterator

import numpy as np

from planner.catalogue import Entry
from planner.catalogue.curves import CURVE, gear_curve
from planner.effects.waves import Sine
from planner.model import Model, Parameter
from planner.tracing.again import plain
from planner.tracing.dictionary import products
from planner.tracing.screen import Shade
from planner.tracing.state import Held
from planner.units import Array

KIND = CURVE
TONES = ("gear ripple", "encoder once a turn", "encoder twice a turn")
QUICKEST = (3.0, 6.0, 10.0, 15.0, 20.0, 30.0)  # waves a turn within which most of the error lies
SIZES = (0.3, 1.0, 3.0)  # times the expected one that are tried


def likeliest(shade: Shade, base: Model, joint: int) -> Entry:
    """The curve of a joint whose quickness the screened samples are likeliest under, any size being possible."""
    q = shade.problem.samples.q
    known = [gear_curve(base, q, joint, f) for f in QUICKEST]
    return max(known, key=lambda e: evidence(shade, e))


def evidence(shade: Shade, entry: Entry) -> float:
    """Logarithm of the likelihood of the screened samples with a curve over that without, at its likeliest size."""
    return max(_evidence(shade, entry))


def _evidence(shade: Shade, entry: Entry) -> Iterator[float]:
    """Logarithm of the likelihood of the screened samples with the curve over that without, for several sizes."""
    done = products(shade.lay_out([(entry, None)]), shade.problem, shade.errors, shade.basis, shade.residual)
    noise = shade.variance / shade.worth
    mu, axes = np.linalg.eigh((done.squares[0] - done.shadow.T @ done.shadow) / noise)
    mu, along = np.maximum(mu, 0.0), axes.T @ done.along / noise
    for s in SIZES:
        yield float((along**2 / (mu + 1 / s**2)).sum() - np.log1p(s**2 * mu).sum()) / 2


def instead(effects: tuple[Held, ...], entry: Entry) -> tuple[Held, ...] | None:
    """Effects that stay when a joint's waves give way to its curve; ``None`` where there is no cause for a curve.

    ``entry`` is the wave that would come next. There is cause where the joint has waves already, or where another joint
    of the arm has a curve.
    """
    if entry.kind not in TONES:
        return None
    waves = [h for h in effects if plain(h.entry.kind) in (*TONES, KIND) and h.entry.on == entry.on]
    if not waves and all(h.entry.kind != KIND for h in effects):
        return None
    return tuple(h for h in effects if h not in waves)


def periods(parameters: tuple[Parameter, ...], sizes: Array, most: int = 3) -> list[float]:
    """Waves a turn at which a curve is strongest, the strongest first, one for each peak."""
    power = sizes[0::2] ** 2 + sizes[1::2] ** 2
    phis = [p.main.phi for p in parameters[0::2]]
    waves = np.array([phi.frequency for phi in phis if isinstance(phi, Sine)])
    inner = np.r_[0.0, power, 0.0]
    peaks = np.flatnonzero((inner[1:-1] >= inner[:-2]) & (inner[1:-1] > inner[2:]))
    best = sorted(peaks, key=lambda k: -power[k])[:most]
    return [float(waves[k]) for k in best if power[k] > 0.1 * power.max()]
