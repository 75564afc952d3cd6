"""Judging a fit on a second run that had no part in it."""

from dataclasses import replace

import numpy as np

from planner.cell.setup import MeasurementSetup
from planner.effects.basis import ONE, Times
from planner.effects.parameters import ParameterMove
from planner.effects.phi_keys import columns_of, depends_on_run
from planner.identification.least_squares import Fit, fit
from planner.identification.problem import FitProblem
from planner.identification.run_setup import locate_gauge
from planner.model.identification_document import Metrics
from planner.model.model import Model
from planner.runs.run import Run


def validate_fit(found: Fit, run: Run, bare: MeasurementSetup) -> Metrics:
    """Return the errors of the fitted model on another run [m]; frames that only this run has are fitted on it.

    ``bare`` is the setup of that run with nothing placed yet.
    """
    setup = found.model.setup
    model = _timeless(found, run)
    if not new_frames(setup, run):
        problem = FitProblem.of(model, _renumber_places(run, setup))
        return Metrics.of(problem.residual(np.zeros(0)))
    model = _with_frames(replace(model, setup=locate_gauge(_calibrated_tool(bare, found), run)))
    # robust: one ball that was seated badly must not move the plate of all others
    here = fit(FitProblem.of(model, run, found.problem.whitener.noise), robust=True)
    return Metrics.of(here.problem.residual(here.errors))


def new_frames(setup: MeasurementSetup, run: Run) -> bool:
    """Tell whether the run stands in frames that the setup does not know: a plate set down anew, another station."""
    return setup.gauge.needs_new_frames(setup, run)


def _timeless(found: Fit, run: Run) -> Model:
    """Fix the fitted model; what hangs on the fitted run's own clock or sessions stands at its mean over that run.

    So does what hangs on a column that ``run``, which is to be judged, does not have.
    """
    model = found.model.fixing(found.errors)

    def standing(move: ParameterMove) -> ParameterMove:
        key = move.phi.key
        if not depends_on_run(key) and all(getattr(run.samples, c) is not None for c in columns_of(key)):
            return move
        return replace(move, phi=Times(float(np.mean(found.problem.context.value(move.phi))), ONE))

    fixed = tuple((replace(p, moves=tuple(standing(m) for m in p.moves)), v) for p, v in model.fixed)
    return replace(model, fixed=fixed)


def _renumber_places(run: Run, setup: MeasurementSetup) -> Run:
    """Number the places of the run as the setup does."""
    order = np.array([setup.place_names.index(name) if name in setup.place_names else 0 for name in run.places])
    return replace(run, samples=replace(run.samples, place=order[run.samples.place]))


def _calibrated_tool(bare: MeasurementSetup, found: Fit) -> MeasurementSetup:
    """Return the setup with the tool points as fitted, so that placing the new frames does not touch them."""
    setup = found.model.setup
    shift = dict(zip(found.model.names, found.errors, strict=True))
    p_FM = np.array(setup.p_FM)
    for t, name in enumerate(setup.point_names):
        label = f"map_{name}" if name else "map"
        p_FM[t] += [shift.get(f"{label}_{axis}", 0.0) for axis in "xyz"]
    return replace(bare, p_FM=p_FM, R_FM=setup.R_FM, point_names=setup.point_names, tool_prior=0.0)


def _with_frames(model: Model) -> Model:
    """Free the frames of the new run, everything else fixed as fitted; the tool's shift now stands in the setup."""
    fixed = tuple((p, v) for p, v in model.fixed if p.group != "gauge")
    frames = [p for p in Model.of(model.setup, frozenset()).parameters if p.group == "gauge"]
    return replace(model, parameters=tuple(frames), fixed=fixed)
