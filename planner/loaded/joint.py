"""Unloaded and loaded runs in one fit of kinematics and compliances, which the EDBB paper calls for (section 5).

An unloaded bar all over its shell sees the geometry, a loaded one on its circles sees what yields; each helps the
other: the geometry places the load's levers, and weights bend the arm in every unloaded pose too. Each bar has a zero
of its own. Model, fit, noise and covariance are those of every identification.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.cell import Cell
from planner.effects import AtPlace
from planner.errors import InputError
from planner.identification import Estimate, Problem, fit
from planner.identification.estimates import estimates
from planner.identification.placed import placed, rig_for, with_motion
from planner.identification.seeing import seen_by
from planner.identification.spread import parameter_covariance
from planner.loaded.types import Loaded
from planner.model import Model, Parameter
from planner.model.parameters import PRIOR_ZERO, compliance_parameters, reading
from planner.rig import Rig
from planner.run import Readings, Run, Samples
from planner.run.joining import joined
from planner.units import Array, frozen

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
        groups = np.array_split(np.arange(len(c.theta)), min(ANGLES, len(c.theta)))
        which = np.array([g[len(g) // 2] for g in groups])
        q, length, force = (v[:, :, which] for v in (c.q, c.length, c.force))
        n = length.size
        rows.append((q.reshape(n, -1), length.ravel(), force.ravel(), np.full(n, k)))
    q, length, force, place = (np.concatenate([r[k] for r in rows]) for k in range(4))
    samples = Samples(q=frozen(q), place=place, force=frozen(force), session=np.zeros(len(q), dtype=int))
    places = tuple(c.curves.circle.name for c in found.circles)
    return Run(f"{found.name}, averaged", samples, Readings(length=frozen(length)), places, robot=found.robot)


def joint_fit(cell: Cell, unloaded: Run, loaded: Run) -> Joint:
    """Fit geometry, gauge and compliances to an unloaded run and the averaged curves of a loaded one together.

    Raises:
        InputError: the runs do not belong to the cell, share a fixture, or the first is no bar's.
        NoSolutionError: the fit does not come to rest.
    """
    _check(unloaded, loaded)
    both = (
        replace(unloaded, samples=replace(unloaded.samples, t=None)),
        replace(loaded, continuous=unloaded.continuous),
    )
    whole_run = joined([with_motion(run) for run in both])
    rig = placed(rig_for(cell, whole_run), whole_run)
    own = [whole_run.places.index(p) for p in loaded.places if p in whole_run.places]
    base = Model.of(rig, cell.plan.free)
    more = _zeros(own, rig) if "zero" in cell.plan.free else []
    whole = replace(base, parameters=(*base.parameters, *more, *compliance_parameters(rig)))
    model, seen = seen_by(whole, whole_run.samples)
    found = fit(Problem.of(model, whole_run))
    covariance, _ = parameter_covariance(found, whole_run.continuous)
    residual = found.problem.residual(found.errors)[:, 0]
    under = np.isin(whole_run.samples.place, own)
    return Joint(
        whole_run,
        estimates(whole, found, seen.dropped, covariance),
        model.names,
        frozen(found.errors),
        frozen(covariance),
        (float(np.sqrt(np.mean(residual[~under] ** 2))), float(np.sqrt(np.mean(residual[under] ** 2)))),
    )


def _zeros(own: Sequence[int], rig: Rig) -> list[Parameter]:
    """How much the zero of the loaded bar differs from the other's."""
    moves = tuple(m for s in own for m in reading(AtPlace(s)))
    return [Parameter("zero_loaded", "m", PRIOR_ZERO, "zero of the loaded bar beside the other's", moves, "gauge")]


def _check(unloaded: Run, loaded: Run) -> None:
    if unloaded.readings.length is None:
        raise InputError(f"{unloaded.name}: the joint fit needs length_mm, a bar's run without load")
    shared = sorted(set(unloaded.places) & set(loaded.places))
    if shared:
        raise InputError(
            f"{unloaded.name}: shares the fixture '{shared[0]}' with the loaded run; two bars stand on two fixtures, "
            "each with its name in [[fixtures]] and in the column fixture"
        )
