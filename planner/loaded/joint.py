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
from planner.loaded.runs import at_rest
from planner.model import Model
from planner.model.parameters import compliance_parameters
from planner.run import Run
from planner.run.joining import joined
from planner.units import UM, Array, frozen

APART = 3.0  # times what it leaves by itself, from which on a run does not fit to the other
ROUNDS = 2  # of the torques in balance before the last steps


@dataclass(frozen=True)
class Joint:
    """One fit of both kinds of run.

    Attributes:
        run: all samples, as poses at rest.
        estimates: every parameter, seen or not.
        names, errors, covariance: of the fitted parameters, (P,), (P, P).
        rms: of the residuals without load, and with load [m].
        problems: reasons not to use the fit.
    """

    run: Run
    estimates: tuple[Estimate, ...]
    names: tuple[str, ...]
    errors: Array
    covariance: Array
    rms: tuple[float, float]
    problems: tuple[str, ...] = ()


def joint_fit(cell: Cell, unloaded: Run, loaded: Run, turns: Sequence[Array]) -> Joint:
    """Fit geometry, gauge and compliances to an unloaded run and the averaged curves of a loaded one together.

    ``turns`` is the noise of the averages, see :func:`planner.loaded.runs.averages_noise`.

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
    rms = _rms(last.residual[~under]), _rms(last.residual[under])
    return Joint(
        replace(whole_run, samples=replace(whole_run.samples, torque=None, reversals=None, length=None)),
        estimates(whole, found, dropped, covariance),
        model.names,
        last.errors,
        covariance,
        rms,
        _disagreement(model, whole_run, under, rms),
    )


def _disagreement(model: Model, run: Run, under: np.ndarray, rms: tuple[float, float]) -> tuple[str, ...]:
    """Say where one model cannot follow both runs: one of them leaves far more than in a fit of its own."""
    for part, left, words in ((~under, rms[0], "without load"), (under, rms[1], "under load")):
        alone = fit(Problem.of(model, run.take(part)))
        own = _rms(alone.problem.residual(alone.errors))
        if left > APART * float(np.hypot(own, model.rig.noise)):
            return (
                f"the runs without load and under load disagree: fitted together, {left / UM:.1f} µm are left {words}, "
                f"by itself that run leaves {own / UM:.1f} µm; were both measured on one robot, at the fixtures that "
                "they name?",
            )
    return ()


def _balanced(run: Run, model: Model, errors: Array) -> Run:
    return replace(run, samples=with_torque(run.samples, model, errors))


def _rms(residual: Array) -> float:
    return float(np.sqrt(np.mean(residual**2)))


def _check(unloaded: Run, loaded: Run) -> None:
    if unloaded.readings.length is None:
        raise InputError(f"{unloaded.name}: the joint fit needs length_mm, a bar's run without load")
    shared = sorted(set(unloaded.places) & set(loaded.places))
    if shared:
        raise InputError(
            f"{unloaded.name}: shares the fixture '{shared[0]}' with the loaded run; two bars stand on two fixtures, "
            "each with its name in [[fixtures]] and in the column fixture"
        )
