"""What of a loaded and of an unloaded run enters their common fit, and with what noise."""

from dataclasses import replace

import numpy as np

from planner.loaded.types import Curves, Loaded
from planner.run import Readings, Run, Samples
from planner.units import Array, frozen

APART, SPARSE = 3.0, 300  # [s], samples: from one sample of a continuous run to the next that enters
ANGLES = 24  # of each turn that enter: neighbours share their error, and curves vary a few times a turn


def averaged_run(found: Loaded) -> Run:
    """Return averaged curves as a run of poses at rest, a sample for each of ``ANGLES`` angles, loads and senses."""
    rows = []
    for k, c in enumerate(x.curves for x in found.circles):
        which = _few(c)
        q, length, force = (v[:, :, which] for v in (c.q, c.length, c.force))
        n = length.size
        rows.append((q.reshape(n, -1), length.ravel(), force.ravel(), np.full(n, k)))
    q, length, force, place = (np.concatenate([r[k] for r in rows]) for k in range(4))
    samples = Samples(q=frozen(q), place=place, force=frozen(force), session=np.zeros(len(q), dtype=int))
    places = tuple(c.curves.circle.name for c in found.circles)
    return Run(f"{found.name}, averaged", samples, Readings(length=frozen(length)), places, robot=found.robot)


def averages_noise(found: Loaded) -> tuple[Array, ...]:
    """Return the covariance of the rows of :func:`averaged_run`: for each circle and sense (K, A, A) [m²].

    It is what the repeats say of turns, harmonic by harmonic, larger by as much as the loads' curves differ more.
    """
    out = []
    for c in (x.curves for x in found.circles):
        B, which = len(c.theta), _few(c)
        flat = np.full(B // 2 + 1, found.compliances.noise**2 * float(np.mean(c.repeats)))
        spectrum = c.noise if np.all(np.isfinite(c.noise)) else flat
        apart = np.fft.irfft(spectrum, B) * max(1.0, found.compliances.misfit) ** 2
        turn = apart[(which[:, None] - which) % B]
        out += [turn / c.repeats[d, :, None, None] for d in range(len(c.directions))]
    return tuple(out)


def _few(c: Curves) -> np.ndarray:
    """Angles of averaged curves that enter, (A,) int."""
    groups = np.array_split(np.arange(len(c.theta)), min(ANGLES, len(c.theta)))
    return np.array([g[len(g) // 2] for g in groups])


def at_rest(run: Run) -> Run:
    """Return a run without its clock; of a continuous one so few samples that each has an error of its own.

    Neighbours along a drive share the deviation of the arm from where it reads: all of them would outweigh the turns,
    which are averages. One in ``APART`` seconds is left, or where there is no clock one of ``SPARSE``.
    """
    samples = run.samples
    if not run.continuous:
        return replace(run, samples=replace(samples, t=None))
    step = SPARSE
    if samples.t is not None and len(run) > 1:
        step = max(1, round(APART / float(np.median(np.abs(np.diff(samples.t))))))
    which = np.arange(0, len(run), step)
    thin = replace(samples.take(which), t=None, speed=None)
    return replace(run, samples=thin, readings=run.readings.take(which), continuous=False)
