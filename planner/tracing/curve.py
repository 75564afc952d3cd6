"""The whole error of a joint's gear over its angle, where single waves do not tell it.

A gear whose error is no pure tone shows as ripple after ripple. It is one effect: the joint's angle is off by a smooth
function of itself. Its waves are expected the smaller the quicker they run (a Gaussian process with a squared
exponential kernel, in its Fourier series; Rasmussen & Williams 2006, ch. 4); how quick, and how large, the run decides.
"""

from collections.abc import Iterator

import numpy as np

from planner.catalogue import Entry
from planner.effects.waves import Cosine, Sine
from planner.model import Model, Parameter
from planner.model.parameters import transform
from planner.tracing.again import plain
from planner.tracing.dictionary import products
from planner.tracing.screen import Shade
from planner.tracing.state import Held
from planner.units import Array

KIND = "gear error curve"
TONES = ("gear ripple", "encoder once a turn", "encoder twice a turn")
QUICKEST = (3.0, 6.0, 10.0, 15.0, 20.0, 30.0)  # waves a turn within which most of the error lies
LAST = 2.0  # times that: the quickest waves that are modelled
SIZE = 2e-4  # [rad], root mean square
SIZES = (0.3, 1.0, 3.0)  # times that are tried
LARGEST = 5e-3  # [rad]
ROOM = 1.3  # length over which the function repeats itself, over the joint's range
TURN = 2 * np.pi


def curve(base: Model, q: Array, joint: int, quickest: float) -> Entry:
    """Return the entry of a joint (from 0) with the angles q (n, N) [rad] of the run."""
    spread = min(TURN, ROOM * float(np.ptp(q[:, joint])))
    step = TURN / spread
    waves = step * np.arange(1, max(2, int(LAST * quickest / step) + 1))
    size = np.exp(-0.5 * (waves / quickest) ** 2)
    size *= SIZE / np.sqrt((size**2).sum())
    where = next(k for k, t in enumerate(base.rig.chain.transforms) if t.joint == joint)
    on = f"joint {joint + 1}"
    parameters = tuple(
        Parameter(
            f"gear_curve{joint + 1}_{name}{k}", "rad", float(s), f"gear error of {on}, {w:.4g} waves a turn",
            transform(where, phi), f"{KIND}, {on}",
        )
        for k, (w, s) in enumerate(zip(waves, size, strict=True), 1)
        for name, phi in (("sin", Sine(joint, float(w))), ("cos", Cosine(joint, float(w))))
    )  # fmt: skip
    sentence = f"{on}: gear or encoder runs unevenly over the joint's own angle, {{size}}"
    return Entry(KIND, on, lambda _: parameters, sentence, LARGEST, "measured curve: no model of a gear behind it")


def likeliest(shade: Shade, base: Model, joint: int) -> Entry:
    """The curve of a joint whose quickness the screened samples are likeliest under, any size being possible."""
    q = shade.problem.samples.q
    known = [curve(base, q, joint, f) for f in QUICKEST]
    return max(known, key=lambda e: max(_evidence(shade, e)))


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
