"""``edbb identify`` leaves a baseline, ``edbb check`` judges a later run by it; readings are the generator's."""

import json

import numpy as np
import pytest

import tests.simulation.generator.runs as runs
from planner.cell.reading import load_cell
from planner.common.units import DEG
from planner.documents.baseline import Baseline
from planner.runs.loader import load_runs
from planner.runs.run import Readings, Run, Samples
from planner.runs.writer import save_run
from planner.workflow.identification import identify
from tests.checks.fleet import NAME
from tests.command import edbb
from tests.identification.worlds import arm_of
from tests.simulation.generator.kinds import Effect
from tests.simulation.generator.truth import Noise, Truth, draw_errors

SOFT = tuple(Effect("joint-compliance", j, 3e-5) for j in (2, 3))


@pytest.mark.long
def test_a_calibrated_robot_passes_and_one_that_lost_a_zero_is_mastered_again(tmp_path):
    arm = arm_of(NAME)
    errors = draw_errors(arm, np.random.default_rng(3))
    truth = Truth(3, errors, SOFT, Noise(2e-6, 1e-5), (1.0,) * 6)
    made = runs.edbb_static(arm, n_poses=90, seed=3, truth=truth, logs=())
    path, cell = made.write(tmp_path)
    run = load_runs([path], 6)
    poses = np.unique(run.samples.pose)
    later, first = (np.isin(run.samples.pose, poses[k]) for k in (slice(0, 12), slice(12, None)))
    save_run(run.take(first), tmp_path / "first.csv")
    done = edbb("identify", tmp_path / "first.csv", "--cell", cell, "-o", tmp_path / "known", "--no-trace")
    assert done.returncode == 0, done.stderr
    whole = load_cell(str(cell), planning=False)
    baseline = Baseline.read(tmp_path / "known", whole)
    _predicts_what_the_posterior_does(baseline, run.take(first), cell)
    logged = baseline.restrict_to_samples(run.samples)
    shift = logged.rows(run.samples)[:, [p.name for p in logged.model.parameters].index("theta3")] * 0.04 * DEG
    for name, length, cause in (("sound", 0.0, None), ("moved", shift[later], "zero of joint 3")):
        part = run.take(later)
        save_run(
            Run(name, part.samples, Readings(part.readings.length + length), part.places), tmp_path / f"{name}.csv"
        )
        folder = tmp_path / name
        done = edbb("check", tmp_path / f"{name}.csv", "--model", tmp_path / "known", "--cell", cell, "-o", folder)
        assert done.returncode == 0, done.stderr
        assert json.loads((folder / "check.json").read_text())["cause"] == cause, done.stderr


def _predicts_what_the_posterior_does(baseline, run, cell):
    """Readings and their uncertainty by the file against those by the fit in memory."""
    found = identify(run, cell=str(cell), no_trace=True).calibration
    fit = found.released.posterior.fit
    at = Samples(fit.problem.samples.q, fit.problem.samples.place, direction=fit.problem.samples.direction)
    known = baseline.restrict_to_samples(at)
    names = [fit.model.names.index(p.name) for p in known.model.parameters]
    part = fit.model.subset(names)
    apart = known.model.reading(at, known.values)[:, 0] - part.reading(at, fit.errors[names])[:, 0]
    assert np.ptp(apart) < 2e-8  # but for the zero, which every session sets anew
    spread = part.rows(at, fit.errors[names])[:, 0] @ fit.solution.root(fit.problem.prior)[names]
    whole, mine = (np.sqrt(((s - s.mean(axis=0)) ** 2).sum(axis=1)) for s in (spread, known.rows(at) @ known.root))
    assert np.abs(np.sqrt(mine**2 + baseline.file.rest**2) / whole - 1).max() < 0.3
