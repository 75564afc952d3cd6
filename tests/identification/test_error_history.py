"""The history of a run against covariances that are inverted here, pose by pose."""

from dataclasses import replace

import numpy as np
import pytest

from planner.release.error_history import error_history
from planner.report.calibration_data import CalibrationFacts
from planner.report.history_charts import history_charts
from planner.workflow.identification import identify
from tests.identification.few_draws import few_draws
from tests.identification.joint_world import BAR_LEFT, World


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    made = World.drawn(4).measure(tmp_path_factory.mktemp("run"), BAR_LEFT, 4)
    with few_draws():
        return identify(made.run, cell=made.cell, no_trace=True).calibration


def left_by(found, which):
    """Mean square error of the tool [m²] after the readings ``which``, by the inverse of the information."""
    released = found.released
    fit = released.posterior.fit
    size = np.sqrt((released.posterior.mixture.scaled_sizes**2).mean(axis=0))
    acting = size > 0
    rows = (fit.problem.white_columns(fit.errors).rows[which] * size)[..., acting].reshape(-1, int(acting.sum()))
    covariance = np.linalg.inv(np.eye(rows.shape[1]) + rows.T @ rows)
    root = (size * fit.problem.prior)[acting]
    names = [n for n, a in zip(fit.model.names, acting, strict=True) if a]
    own = [released.tool.names.index(n) if n in released.tool.names else -1 for n in names]
    moved = released.tool.rows.reshape(-1, len(released.tool.names))
    columns = np.where(np.array(own) >= 0, moved[:, own], 0.0) * root
    return float((columns @ covariance * columns).sum()) / len(released.tool.q) + released.beside_square


@pytest.mark.slow
def test_each_reading_leaves_what_the_inverse_says(found):
    history, n = error_history(found.released, found.run.samples), len(found.run)
    square = history.error**2
    for k in (1, 7, 30, n):
        expected = left_by(found, np.arange(k)) / left_by(found, np.arange(n))
        assert square[k - 1] / square[-1] == pytest.approx(expected, rel=1e-4)
    assert history.error[-1] == pytest.approx(found.workspace_error)
    assert np.all(np.diff(history.error) <= 1e-15)
    assert history.minutes is None


@pytest.mark.slow
def test_the_worth_of_a_pose_is_what_is_lost_without_it(found):
    history, every = error_history(found.released, found.run.samples), np.arange(len(found.run))
    whole = left_by(found, every)
    for k in (0, 11, int(np.argmax(history.worth))):
        assert history.worth[k] == pytest.approx(left_by(found, np.delete(every, k)) / whole - 1.0, rel=1e-3, abs=1e-7)


@pytest.mark.slow
def test_the_chart_shows_what_was_planned_beside_what_was_reached(found):
    planned = found.model_copy(update={"planned_errors": (tuple(np.linspace(2e-3, 1e-4, 40)),)})
    chart = history_charts(CalibrationFacts(planned))[0]
    assert [s.name for s in chart.panels[0].series] == ["reached", "planned"]
    np.testing.assert_allclose(chart.panels[0].series[1].y, np.linspace(2.0, 0.1, 40))
    best = 1 + int(np.argmax(error_history(found.released, found.run.samples).worth))
    assert f"pose {best}" in chart.caption


@pytest.mark.slow
def test_of_two_sessions_each_plan_begins_where_its_session_does_and_the_clock_goes_on(found):
    n = len(found.run)
    first = n // 2
    session = np.repeat([0, 1], (first, n - first))
    t = np.concatenate([30.0 * np.arange(first), 20.0 * np.arange(n - first)])  # the second clock begins anew
    run = replace(found.run, samples=replace(found.run.samples, session=session, t=t))
    planned = (tuple(np.linspace(2e-3, 1e-3, first)), tuple(np.linspace(1e-3, 1e-4, 5)))
    both = found.model_copy(update={"planned_errors": planned, "run": run})
    panel = history_charts(CalibrationFacts(both))[0].panels[0]
    assert [s.name for s in panel.series] == ["reached", "planned", "planned, run 2"]
    reached, before, after = (s.x for s in panel.series)
    assert np.all(np.diff(reached) > 0)
    assert reached[-1] == pytest.approx((30.0 * first + 20.0 * (n - first - 1)) / 60.0)
    np.testing.assert_allclose(before, reached[:first])
    np.testing.assert_allclose(after, reached[first : first + 5])
