"""Effects that a cell declares as its own model: planned, fitted, predicted and told with one set of parameters."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType

import numpy as np
import pytest
from scipy import stats

import tests.simulation.generator.runs as runs
from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.design.candidates.balls import draw_ball_candidates
from planner.design.observability.information import predict_covariance
from planner.design.pose_selection import identify_candidates
from planner.design.selection.d_optimal import detmax
from planner.fit.least_squares import solve
from planner.identification.pipeline import FitSettings, identify
from planner.model.model import Model
from planner.report.calibration_text import declared_effects_text
from planner.report.formatting import digits
from planner.runs.loader import load_run
from planner.runs.run import Samples
from planner.simulation.simulated_run import simulate_run
from planner.simulation.truth import draw_truth
from planner.tracing.trace import trace
from tests.identification.worlds import arm_of
from tests.not_everywhere import require_planning
from tests.simulation.generator.benches import BENCHES
from tests.simulation.generator.kinds import Effect
from tests.simulation.generator.truth import Noise, Truth

FITTED = FitSettings(release=False)  # the last stage is what these tests look at

NAME = "kuka-kr6-r700"
FREE = [f"{kind}{i}" for kind in ("alpha", "a") for i in range(1, 6)] + ["d3", "d4", "d5", "d6", "beta2"]
FREE += [f"theta{i}" for i in range(2, 7)]  # of the paper's 31, what is the arm's own
SOFT = range(2, 7)
SEEDS = 4


@cache
def cell():
    """The shipped cell: four balls, a tool that a CMM measured, joint compliance declared."""
    return load_cell(f"{NAME}/trical")


@cache
def as_identified():
    """The same as the command line reads it to identify."""
    return load_cell(f"{NAME}/trical", planning=False)


@cache
def planned():
    """Model of the plan, and 24 poses (n, N) [rad] out of a small pool with their balls (n,)."""
    require_planning()
    pool = draw_ball_candidates(cell(), 400)
    model, seen, rows = identify_candidates(cell(), pool)
    chosen = detmax(rows, 24, group=pool.ball)
    return model, seen, pool.q[chosen]


@cache
def identified(traced=False):
    """The calibration from a run at the planned poses."""
    q = planned()[2]
    samples = Samples(q, np.zeros(len(q), dtype=int), pose=np.arange(len(q)))
    run = simulate_run(cell(), "0" * 12, samples, draw_truth(cell(), 3), 3)
    return identify(run, as_identified(), tracer=trace if traced else None, settings=FITTED)


def made(seed, soft, poses=40, tool=0.0):
    """A run of the generator's arm with errors drawn in all that the paper's model has, and the truth by name.

    ``tool``: standard deviation of its point along each axis [m].
    """
    rng = np.random.default_rng([4, seed])
    true = {n: float(rng.normal(0.0, 4e-4)) for n in FREE}
    point = {
        f"map_{axis}": float(v)
        for axis, v in zip("xyz", tool * np.random.default_rng(seed).normal(size=3), strict=True)
    }
    give = {j: float(c) for j, c in zip(SOFT, rng.normal(0.0, soft, len(SOFT)), strict=True)}
    effects = tuple(Effect("joint-compliance", j, c) for j, c in give.items() if soft)
    truth = Truth(seed, MappingProxyType(true | point), effects, Noise(2.5e-6, 1e-5), (1.0,) * 6)
    bench = replace(
        BENCHES[NAME], map_mm=(70, 0, 150), tool_kg=6.0, com_mm=(20, 0, 65), plate_mm=(536.32, 21.901, 58.349)
    )
    files = runs.balls(arm_of(NAME), n_poses=poses, seed=seed, truth=truth, logs=(), bench=bench)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "run.csv"
        path.write_text(files.run_csv)
        return load_run(path, 6), true | {f"compliance{j}": c for j, c in give.items()}


@pytest.mark.slow
@pytest.mark.parametrize("traced", [False, True])
def test_plan_and_fit_have_one_set_of_parameters(traced):
    """Geometry, frames and compliances, the tool held by what a CMM knows of it, each left-out one with its reason."""
    _, seen, _ = planned()
    found = identified(traced)
    assert {e.name for e in found.estimates if e.identifiable} == set(seen.names)
    assert len(seen.names) == 31
    why = {e.name: e.because for e in found.estimates if not e.identifiable}
    assert set(why) == {d.name for d in seen.dropped}
    assert all("measured on the tool to 1.9 µm" in why[f"map_{axis}"] for axis in "xyz")
    assert "no weight turns joint 1" in why["compliance1"]
    told = {d.name: d.because for d in seen.dropped}
    assert all(why[name] == told[name] for name in ("a0", "d2", "theta1", "compliance1"))


@pytest.mark.slow
def test_the_declared_effect_is_a_stage_behind_the_geometry_and_is_not_sought_again():
    found = identified(True)
    assert [s.name for s in found.stages[:4]] == ["nominal", "frames", "geometry", "joint compliance"]
    assert [s.parameters for s in found.stages[:4]] == [0, 6, 26, 31]
    assert all("joint compliance" in s.effects for s in found.stages[3:])
    assert "joint compliance" not in {f.effect for f in found.findings} | {m.effect for m in found.limits}


@pytest.mark.slow
def test_predicted_and_found_standard_deviations_agree():
    """Up to the size of the noise, which the fit learns from the run: one factor for all parameters."""
    model, _, q = planned()
    predicted = predict_covariance(model.rows(at := Samples.at(q)), model.noise(at)[:, None] * np.ones(3), model.prior)
    found = identified()
    plain = np.linalg.norm(found.fit.solution.root(found.fit.problem.prior), axis=1)  # what the tool adds left aside
    std = dict(zip(found.fit.model.names, plain, strict=True))
    ratio = np.array([std[n] / s for n, s in zip(model.names, predicted.std, strict=True)])
    assert 0.6 < np.median(ratio) < 1.4
    assert np.all(np.abs(ratio / np.median(ratio) - 1) < 0.35), dict(zip(model.names, ratio, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("tool", [pytest.param(0.0, marks=pytest.mark.long), 1.9e-6])
def test_all_parameters_come_back_as_their_joint_chi_square_allows(tool):
    """Signed compliances of the size of Table 8 and errors in all 25 of the arm's own, over several arms.

    A tool point that is off by what its CMM allows goes into the last offset and angle: their uncertainties know it.
    """
    total, count = 0.0, 0
    for seed in range(SEEDS):
        run, true = made(seed, soft=1e-4, tool=tool)
        found = identify(run, cell(), settings=FITTED)
        names = found.fit.model.names
        assert len(names) == 31
        which = [names.index(n) for n in true]
        off = found.fit.errors[which] - np.array(list(true.values()))
        total += float(off @ np.linalg.solve(found.covariance[np.ix_(which, which)], off))
        count += len(which)
        assert found.stages[-1].held_out.rms < 0.1 * found.stages[2].held_out.rms
    low, high = stats.chi2.ppf([5e-4, 1 - 5e-4], count)
    assert low < total < high


@pytest.mark.slow
def test_a_declared_effect_stays_though_nothing_gains_and_that_is_said():
    run, _ = made(0, soft=0.0)
    found = identify(run, cell(), settings=FITTED)
    assert found.stages[-1].name == "joint compliance"
    assert found.stages[-1].held_out.rms > found.stages[-2].held_out.rms
    assert any("held-out samples came out worse with it" in w for w in found.warnings)
    undeclared = replace(cell(), plan=replace(cell().plan, effects=()))
    assert identify(run, undeclared, settings=FITTED).stages[-1].name == "geometry"


@pytest.mark.slow
def test_undeclared_compliance_comes_where_held_out_samples_gain():
    run, true = made(1, soft=1e-4)
    undeclared = replace(cell(), plan=replace(cell().plan, effects=()))
    found, own = identify(run, undeclared, settings=FITTED), identify(run, cell(), settings=FITTED)
    assert found.stages[-1].name == "joint compliance"
    assert found.fit.model.names == own.fit.model.names
    assert np.allclose(found.fit.errors, own.fit.errors, rtol=0, atol=1e-9)
    assert {n for n in true if n.startswith("compliance")} <= set(found.fit.model.names)


@pytest.mark.slow
def test_an_effect_that_nobody_knows_is_refused():
    run, _ = made(0, soft=0.0)
    wrong = replace(cell(), plan=replace(cell().plan, effects=("joint complience",)))
    with pytest.raises(InputError, match=r"'joint complience'.*joint compliance"):
        identify(run, wrong, settings=FITTED)


def test_the_report_tells_the_declared_effect_with_its_values():
    found = identified(True)
    (sentence,) = [
        s for s in declared_effects_text(found) if s.startswith("Fitted beside the geometry: joint compliance")
    ]
    for e in found.estimates:
        if e.group == "joint compliance" and e.identifiable:
            assert f"{e.name} {digits(1e6 * e.value)} ± {digits(1e6 * e.std, 2)} µrad/Nm" in sentence


def test_the_last_offset_and_angle_are_known_no_better_than_the_point_that_hangs_from_them():
    """Against a fit that has the tool point as a parameter, with the CMM's uncertainty for its prior sigma."""
    found = identified()
    problem, names = found.fit.problem, found.fit.model.names
    tool = [p for p in Model.of(problem.model.setup, frozenset({"tool"})).parameters if p.name.startswith("map_")]
    open_ = solve(problem.with_model(problem.model.plus(tool)), np.append(found.fit.errors, np.zeros(3)))
    wanted = np.linalg.norm(open_.root(np.append(problem.prior, [p.prior for p in tool])), axis=1)[: len(names)]
    std, alone = np.sqrt(np.diag(found.covariance)), np.linalg.norm(found.fit.solution.root(problem.prior), axis=1)
    assert np.all(np.abs(std / wanted - 1) < 0.1)  # the run tells a little of the point itself
    assert {n for n, r in zip(names, std / alone, strict=True) if r > 1.1} >= {"theta6", "d6"}
    assert std[names.index("theta6")] > cell().tool.prior / cell().tool.p_FM[0]


@pytest.mark.slow
def test_effects_come_in_the_order_in_which_they_are_declared_each_once():
    run, _ = made(1, soft=1e-4)
    several = ("soft base", "joint compliance", "soft base")
    found = identify(run, replace(cell(), plan=replace(cell().plan, effects=several)), settings=FITTED)
    assert [s.name for s in found.stages[2:]] == ["geometry", "soft base", "joint compliance"]
    assert found.stages[-1].effects == ("soft base", "joint compliance")
    assert len(set(found.fit.model.names)) == len(found.fit.model.names) == found.stages[-1].parameters
