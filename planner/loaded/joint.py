"""Unloaded and loaded runs in one fit of kinematics and compliances, which the EDBB paper calls for (section 5).

An unloaded bar all over its shell sees the geometry, a loaded one on its circles sees what yields; each helps the
other: the geometry places the load's levers, and weights bend the arm in every unloaded pose too. Each bar has a zero
of its own. Model and fit are those of every identification; what places the gauges is never left out, as it decides
where the load points, and turns are weighed as turns (see ``refining``).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.cell import Cell
from planner.errors import InputError
from planner.identification import Estimate, Problem, fit
from planner.identification.estimates import estimates
from planner.identification.placed import placed, rig_for, with_motion
from planner.identification.seeing import seen_by
from planner.identification.spread import correlation_time
from planner.loaded.balance import by_held_torque, with_torque
from planner.loaded.refining import refined
from planner.loaded.types import Curves, Loaded
from planner.model import Model
from planner.model.parameters import compliance_parameters
from planner.run import Readings, Run, Samples
from planner.run.joining import joined
from planner.units import Array, frozen

APART, SPARSE = 3.0, 300  # [s], samples: from one sample of a continuous run to the next that enters
ROUNDS = 2  # of the torques in balance before the last steps
ANGLES = 24  # of each turn that enter: neighbours share their error, and curves vary a few times a turn


@dataclass(frozen=True)
class Joint:
    """One fit of both kinds of run.

    Attributes:
        run: all samples.
        estimates: every parameter, seen or not.
        names, errors, covariance: of the fitted parameters, (P,), (P, P).
        rms: of the residuals without load, and with load [m].
    """

    run: Run
    estimates: tuple[Estimate, ...]
    names: tuple[str, ...]
    errors: Array
    covariance: Array
    rms: tuple[float, float]


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


def joint_fit(cell: Cell, unloaded: Run, loaded: Run, turns: Sequence[Array]) -> Joint:
    """Fit geometry, gauge and compliances to an unloaded run and the averaged curves of a loaded one together.

    ``turns`` is the noise of the averages, see :func:`averages_noise`.

    Raises:
        InputError: the runs do not belong to the cell, share a fixture, or the first is no bar's.
        NoSolutionError: the fit does not come to rest.
    """
    _check(unloaded, loaded)
    whole_run = joined([with_motion(run) for run in (at_rest(unloaded), loaded)])
    rig = replace(placed(rig_for(cell, whole_run), whole_run), loaded=loaded.places)
    own = [whole_run.places.index(p) for p in loaded.places]
    whole = Model.of(rig, cell.plan.free).plus(list(by_held_torque(compliance_parameters(rig))))
    whole_run = _balanced(whole_run, whole, np.zeros(len(whole.parameters)))
    _, seen = seen_by(whole, whole_run.samples)
    gauge = [k for k, p in enumerate(whole.parameters) if p.group == "gauge"]
    model = whole.subset(sorted({*seen.kept, *gauge}))
    for _ in range(ROUNDS):
        found = fit(Problem.of(model, whole_run))
        whole_run = _balanced(whole_run, model, found.errors)
    last = refined(found.problem, whole_run, found.errors, turns)
    found = replace(found, solution=replace(found.solution, errors=last.errors))
    dropped = tuple(d for d in seen.dropped if d.name not in model.names)
    under = np.isin(whole_run.samples.place, own)
    alike = correlation_time(last.residual[~under]) if unloaded.continuous else 1.0
    covariance = frozen(max(1.0, alike) * last.covariance)
    return Joint(
        whole_run,
        estimates(whole, found, dropped, covariance),
        model.names,
        last.errors,
        covariance,
        (_rms(last.residual[~under]), _rms(last.residual[under])),
    )


def _balanced(run: Run, model: Model, errors: Array) -> Run:
    return replace(run, samples=with_torque(run.samples, model, errors))


def _rms(residual: Array) -> float:
    return float(np.sqrt(np.mean(residual**2)))


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


def _check(unloaded: Run, loaded: Run) -> None:
    if unloaded.readings.length is None:
        raise InputError(f"{unloaded.name}: the joint fit needs length_mm, a bar's run without load")
    shared = sorted(set(unloaded.places) & set(loaded.places))
    if shared:
        raise InputError(
            f"{unloaded.name}: shares the fixture '{shared[0]}' with the loaded run; two bars stand on two fixtures, "
            "each with its name in [[fixtures]] and in the column fixture"
        )
