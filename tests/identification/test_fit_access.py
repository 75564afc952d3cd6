"""Numbers of a fit in the hand: influence against statsmodels and against fits without a sample; draws; many runs."""

import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import polars as pl
import pytest
from scipy.stats import multivariate_normal

from planner import frame_of_run, identify, identify_many, run_of_frame, simulate, simulate_many
from planner.common.errors import InputError, MissingProgramError
from planner.fit.influence import Influence, _Linear
from planner.fit.least_squares import solve
from planner.runs.writer import save_run
from planner.workflow.plan_results import PosesResult
from tests.simulation.made import cell_in, wide_plan

ROBOT = "kuka-kr6-r700"


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    return wide_plan(tmp_path_factory.mktemp("plan"), calibrate=60)


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    return cell_in(tmp_path_factory.mktemp("cell"), ROBOT, 1, ())


@pytest.fixture(scope="module")
def fits(plan, cell):
    return identify_many([made.run for made in simulate_many(plan, range(3))], cell=cell, processes=1)


def linear(fit):
    """Columns and residual in standard deviations, weighed, prior readings below: an ordinary regression."""
    problem = fit.problem
    piece = problem.white_columns(fit.errors)
    rows, white = piece.rows[:, 0], piece.residual[:, 0]
    z = fit.errors / problem.prior
    return np.vstack([rows, np.eye(len(z))]), np.concatenate([white + rows @ z, 0 * z])


@pytest.mark.slow
def test_influence_is_that_of_the_regression_with_the_priors_as_readings(fits):
    """Against normal equations of the stacked rows, each sample left out in turn."""
    fit = fits[0].calibration.fit
    X, y = linear(fit)
    known, n = fits[0].influence, len(fit.problem)
    hat = np.diag(X @ np.linalg.pinv(X))
    np.testing.assert_allclose(known.leverage, hat[:n], atol=1e-8)
    assert known.leverage.sum() + hat[n:].sum() == pytest.approx(X.shape[1])
    prior, full = fit.problem.prior, np.linalg.lstsq(X, y, rcond=None)[0]
    for k in (0, 7, n - 1):
        rest = np.arange(len(X)) != k
        without = np.linalg.lstsq(X[rest], y[rest], rcond=None)[0]
        np.testing.assert_allclose(known.change[k], (without - full) * prior, atol=1e-7 * prior.max())
        ratio = known.left_out_residual[k, 0] / known.residual[k, 0]
        assert ratio == pytest.approx((y[k] - X[k] @ without) / (y[k] - X[k] @ full), rel=1e-5)
    np.testing.assert_allclose(known.covariance, np.linalg.inv(X.T @ X) * np.outer(prior, prior), rtol=1e-5, atol=1e-16)


def test_influence_is_that_of_statsmodels(fits):
    pytest.importorskip("statsmodels")
    from statsmodels.regression.linear_model import OLS
    from statsmodels.stats.outliers_influence import OLSInfluence

    X, y = linear(fits[0].calibration.fit)
    known = fits[0].influence
    n, other = len(known.leverage), OLSInfluence(OLS(y, X).fit())
    np.testing.assert_allclose(known.leverage, other.hat_matrix_diag[:n], atol=1e-8)
    np.testing.assert_allclose(
        known.left_out_residual[:, 0] / known.residual[:, 0], (other.resid_press / other.resid)[:n], rtol=1e-5
    )
    scale = other.results.mse_resid  # statsmodels estimates the size of the noise; here it is known
    np.testing.assert_allclose(known.distance, other.cooks_distance[0][:n] * scale, rtol=1e-5, atol=1e-12)


def test_a_fit_without_a_sample_is_the_left_out_one(fits):
    """The whole fit anew without one sample, noise and sizes held: what the linear diagnostics say it would be."""
    fit = fits[0].calibration.fit
    k = int(np.argmax(fits[0].influence.leverage))
    rest = fit.problem.take(np.arange(len(fit.problem)) != k)
    anew = solve(rest, fit.errors, converged=1e-6).errors
    expected = fit.errors + fits[0].influence.change[k]
    sigma = np.sqrt(np.diag(fits[0].covariance))
    assert np.abs((anew - expected) / sigma).max() < 0.05


def test_likelihood_is_that_of_scipy_and_left_out_densities_sum_below_it(fits):
    from scipy.stats import norm

    known, problem = fits[0].influence, fits[0].calibration.fit.problem
    sigma = (1 / np.abs(problem.whitener.root[:, 0, 0])) / np.sqrt(problem.weight)
    assert fits[0].log_likelihood == pytest.approx(norm.logpdf(known.residual[:, 0], 0.0, sigma).sum())
    assert known.log_density.sum() < fits[0].log_likelihood
    one = norm.logpdf(known.left_out_residual[3, 0], 0.0, known.left_out_std[3, 0])
    assert known.log_density[3] == pytest.approx(one)
    table = fits[0].leave_one_out()
    assert table.height == len(known.leverage)
    np.testing.assert_allclose(table["left_out_mm"], 1e3 * known.left_out_residual[:, 0])


def test_a_sample_of_several_numbers_is_left_out_as_a_whole():
    """As of a tracker: three correlated numbers a sample, against least squares without its three rows."""
    rng = np.random.default_rng(3)
    n, r, count, prior = 12, 3, 5, np.array([1.0, 2.0, 0.5, 1.0, 3.0])
    raw_rows, raw = rng.standard_normal((n, r, count)), rng.standard_normal((n, r))
    sigma = np.eye(r) * 0.3 + 0.2 * np.ones((r, r))
    root = np.broadcast_to(np.linalg.inv(np.linalg.cholesky(sigma)), (n, r, r))
    rows, y = root @ raw_rows * prior, (root @ raw[..., None])[..., 0]
    X = np.vstack([rows.reshape(-1, count), np.eye(count)])
    z = np.linalg.lstsq(X, np.append(y.ravel(), np.zeros(count)), rcond=None)[0]
    named = SimpleNamespace(names=tuple("abcde"))
    fit = SimpleNamespace(problem=SimpleNamespace(prior=prior), model=named)
    known = Influence(**_Linear(fit, rows, y - rows @ z, root).diagnostics())
    for k in (0, 5):
        rest = np.arange(n) != k
        A = np.vstack([rows[rest].reshape(-1, count), np.eye(count)])
        without = np.linalg.lstsq(A, np.append(y[rest].ravel(), np.zeros(count)), rcond=None)[0]
        np.testing.assert_allclose(known.change[k], (without - z) * prior, atol=1e-10)
        left_out = raw[k] - raw_rows[k] @ (without * prior)
        np.testing.assert_allclose(known.left_out_residual[k], left_out, atol=1e-10)
        spread = sigma + (raw_rows[k] * prior) @ np.linalg.inv(A.T @ A) @ (raw_rows[k] * prior).T
        np.testing.assert_allclose(known.left_out_std[k], np.sqrt(np.diag(spread)), rtol=1e-9)
        assert known.log_density[k] == pytest.approx(multivariate_normal(np.zeros(r), spread).logpdf(left_out))


def test_draws_scatter_as_the_covariance_says_and_go_to_arviz(fits, monkeypatch):
    found = fits[0]
    assert tuple(found.draws) == found.names
    drawn = np.stack([found.draws[name] for name in found.names])
    np.testing.assert_allclose(drawn.std(axis=1), np.sqrt(np.diag(found.covariance)), rtol=0.15)
    asked = {}
    for version, call in (("0.21.0", lambda **k: asked.update(k)), ("1.0.0", lambda groups: asked.update(groups))):
        asked.clear()
        monkeypatch.setitem(sys.modules, "arviz", SimpleNamespace(__version__=version, from_dict=call))
        found.to_arviz()
        assert asked["posterior"][found.names[0]].shape == (1, 1000)
        assert asked["observed_data"]["residual"].shape == found.influence.residual.shape
    monkeypatch.setitem(sys.modules, "arviz", None)
    with pytest.raises(MissingProgramError, match="pip install arviz"):
        found.to_arviz()


@pytest.mark.slow
def test_arviz_has_the_draws_and_counts_them_as_one_chain(fits):
    arviz = pytest.importorskip("arviz", minversion="0.20")
    found = fits[0]
    made = found.to_arviz()
    table = arviz.summary(made, round_to="none")
    assert tuple(table.index) == found.names
    np.testing.assert_allclose(table["mean"].astype(float), [d.mean() for d in found.draws.values()], rtol=1e-6)
    assert made["posterior"][found.names[0]].dims == ("chain", "draw")
    np.testing.assert_array_equal(made["observed_data"]["residual"], found.influence.residual)


@pytest.mark.slow
def test_many_runs_are_those_of_one_by_one_with_progress(plan, cell):
    said = []
    runs = simulate_many(plan, [4, 5], processes=2, progress=lambda *step: said.append(step))
    assert said == [("simulated runs", k, 2) for k in range(3)]
    np.testing.assert_array_equal(runs[1].run.readings.length, simulate(plan, seed=5).run.readings.length)
    many = identify_many([r.run for r in runs], cell=cell)
    assert [f.calibration.released for f in many] == [None, None]
    assert not np.array_equal(many[0].values, many[1].values)


@pytest.mark.slow
def test_many_files_are_read_and_identified_after_data_frames_were_used(plan, cell, tmp_path):
    """A copy of a process that has used data frames would wait for ever for their threads."""
    runs = [made.run for made in simulate_many(plan, [4, 5])]
    assert frame_of_run(runs[0]).select(pl.all().len()).height == 1
    paths = [tmp_path / f"{k}.csv" for k in range(2)]
    for run, path in zip(runs, paths, strict=True):
        save_run(run, path)
    many = identify_many(paths, cell=cell, validate=str(paths[0]))
    for found, run in zip(many, runs, strict=True):
        np.testing.assert_allclose(found.values, identify_many([run], cell=cell, processes=1)[0].values, atol=1e-6)
    assert simulate_many(plan, [1], truth=str(paths[0]))[0].run.truth == simulate(plan, truth=paths[0]).run.truth


@pytest.mark.slow
def test_a_truth_may_be_a_mapping_and_priors_too(plan, cell):
    run = simulate(plan, truth={"theta2_deg": 0.1, "a3_mm": -0.4}, seed=2).run
    assert {"theta2_deg = 0.1", "a3_mm = -0.4"} <= set(run.truth)
    whole = simulate(plan, truth={"errors": {"theta2_mrad": 1.0}, "noise": {"gauge_um": 1.0}}).run
    assert "gauge_um = 1" in whole.truth
    with pytest.raises(InputError, match=r"truth: 'errors\.theta2' names no error with its unit"):
        simulate(plan, truth={"theta2": 0.1})
    free, tight = (
        identify_many([run], cell=cell, priors=p, processes=1)[0] for p in (None, {"theta2_deg": 1e-5})
    )  # fmt: skip
    assert abs(free.values[free.names.index("theta2")]) > 1e-3
    if "theta2" in tight.names:
        assert abs(tight.values[tight.names.index("theta2")]) < 1e-5
    with pytest.raises(InputError, match="priors: 'theta9_deg'"):
        identify_many([run], cell=cell, priors={"theta9_deg": 0.1}, processes=1)


@pytest.mark.slow
def test_a_run_goes_out_as_a_frame_and_comes_back(plan, cell):
    run = simulate(plan, seed=1).run
    frame = frame_of_run(run)
    assert isinstance(frame, pl.DataFrame)
    back = run_of_frame(frame)
    np.testing.assert_allclose(back.samples.q, run.samples.q, atol=1e-9)
    again = replace(back, plan_id=run.plan_id)
    found = identify_many([again], cell=cell, processes=1)[0]
    assert found.values == pytest.approx(identify_many([run], cell=cell, processes=1)[0].values, abs=1e-6)
    with pytest.raises(InputError, match="a data frame is needed"):
        run_of_frame(3)


def test_a_frame_of_pandas_is_a_run_too(plan):
    pandas = pytest.importorskip("pandas")
    frame = frame_of_run(simulate(plan, seed=1).run)
    foreign = pandas.DataFrame({name: frame[name].to_numpy() for name in frame.columns})
    np.testing.assert_allclose(run_of_frame(foreign).readings.length, run_of_frame(frame).readings.length)


def test_a_plan_of_poses_alone_is_refused_by_what_it_lacks(plan, cell):
    poses = object.__new__(PosesResult)
    with pytest.raises(InputError, match="poses alone"):
        simulate(poses)
    with pytest.raises(InputError, match="a plan of poses, or the path"):
        identify(simulate(plan), cell=cell, plan=poses)
