"""Effects of the gauge on its reading (n, k): k is 1 for a bar, 3 for a tracker."""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from tests.simulation.generator.kinds import Kind

LENGTH = ("edbb",)
COUNTER = ("edbb", "tracker")


def _offset(scene, e, reading, bar):
    return reading + e.size


def _scale(scene, e, reading, bar):
    return reading * (1 + e.size)


def _growth(scene, e, reading, bar):
    return reading * (1 + e.size * scene.warmth[:, None])


def _bow(scene, e, reading, bar):
    span = 0.11  # [m] half of the bar's range; a parabola over it
    return reading + e.size * ((reading - 0.41) / span) ** 2


def _lag(scene, e, reading, bar):
    return CubicSpline(scene.t, reading)(scene.t - e.size)


def _filter(scene, e, reading, bar):
    """First-order low-pass with time constant ``size``, exact for readings that are straight between samples."""
    if e.size <= 0:
        return reading
    step = np.median(np.diff(scene.t))
    keep = np.exp(-step / e.size)
    slope = np.diff(reading, axis=0, prepend=reading[:1]) / step
    return reading - lfilter([e.size * (1 - keep)], [1.0, -keep], slope, axis=0)


def _ball_centre(scene, e, reading, bar):
    centre = np.array([e["ex"], e["ey"], e["ez"]])
    return reading + e.size * (bar / np.linalg.norm(bar, axis=1, keepdims=True)) @ centre[:, None]


def _interpolation(scene, e, reading, bar):
    return reading + e.size * np.sin(2 * np.pi * reading / e["period"] + e["phase"])


def _sag(scene, e, reading, bar):
    level = 1 - (bar[:, 2:] / np.linalg.norm(bar, axis=1, keepdims=True)) ** 2
    return reading - e.size * (reading / 0.4) ** 3 * level


def _step(scene, e, reading, bar):
    steps = np.array([0.0, *(e[f"step{k}"] for k in (1, 2, 3))])
    return reading + e.size * steps[scene.session % 4, None]


def _direction(rng, arm, joint):
    e = rng.normal(size=3)
    return dict(zip(("ex", "ey", "ez"), e / np.linalg.norm(e), strict=True))


def _period(rng, arm, joint):
    return {"period": float(rng.choice([1e-3, 2e-3, 5e-3])), "phase": rng.uniform(0, 2 * np.pi)}


def _steps(rng, arm, joint):
    s = rng.choice([-1.0, 1.0], 3) * rng.uniform(0.4, 1.0, 3)
    return {f"step{k + 1}": v for k, v in enumerate(s)}


KINDS = (
    Kind("gauge-offset", "m", (5e-6, 1e-3), reads=_offset, gauges=LENGTH, absorbed=True),
    Kind("gauge-scale", "1", (1e-5, 1e-3), reads=_scale, gauges=COUNTER, absorbed=True),
    Kind("ball-centre", "m", (2e-6, 1e-4), reads=_ball_centre, gauges=LENGTH, inner=_direction, absorbed=True),
    Kind("gauge-growth", "1/K", (2e-6, 1e-4), reads=_growth, gauges=COUNTER, logs=("temperature",)),
    Kind("gauge-nonlinearity", "m", (5e-6, 5e-4), reads=_bow, gauges=LENGTH),
    Kind(
        "gauge-lag", "s", (2e-4, 5e-2), reads=_lag, gauges=COUNTER, motion=("continuous",),
        right_anywhere=("gauge-lag", "lag", "servo-lag"),
    ),
    Kind("gauge-interpolation", "m", (2e-6, 1e-4), reads=_interpolation, gauges=LENGTH, inner=_period),
    Kind("gauge-sag", "m", (5e-6, 5e-4), reads=_sag, gauges=LENGTH),
    Kind(
        "session-step", "m", (5e-6, 5e-4), reads=_step, gauges=LENGTH, motion=("static",), logs=("session",),
        inner=_steps, right=("zero-step",),
    ),
    Kind(
        "gauge-filter", "s", (2e-4, 5e-2), reads=_filter, gauges=COUNTER, motion=("continuous",), in_catalogue=False,
        right_anywhere=("gauge-lag", "lag", "servo-lag"),
    ),
)  # fmt: skip
