"""Indices and covariance against formulas written out by hand and a second library."""

import numpy as np
import pytest
from scipy.linalg import svdvals

from planner.common.errors import InputError
from planner.design.observability.information import (
    all_indices,
    find_rule,
    index_value,
    predict_covariance,
    r_factor,
    rms_sensitivity,
)


def sample(seed=0, n=40, r=3, p=5):
    return np.random.default_rng(seed).standard_normal((n, r, p)) * np.array([1, 5, 0.2, 3, 0.01])


def test_every_index_matches_its_definition():
    rows = sample()
    mu = svdvals(rows.reshape(-1, 5))
    found = all_indices(rows)
    assert pytest.approx(np.prod(mu) ** (1 / 5) / np.sqrt(40)) == found["O1"]  # 40 poses, not 120 readings
    assert pytest.approx(mu[0] / mu[-1]) == found["O2"]
    assert pytest.approx(mu[-1]) == found["O3"]
    assert pytest.approx(mu[-1] ** 2 / mu[0]) == found["O4"]
    assert pytest.approx(1 / np.sum(1 / mu)) == found["O5"]


def test_scaling_makes_the_index_free_of_units():
    rows, scale = sample(), np.array([1e-3, 2e-3, 1e-2, 1e-3, 0.3])
    in_millimetres = rows / np.array([1, 1000, 1, 1, 1.0])
    assert index_value("O2", in_millimetres) != pytest.approx(index_value("O2", rows))
    assert index_value("O2", in_millimetres, scale * np.array([1, 1000, 1, 1, 1])) == pytest.approx(
        index_value("O2", rows, scale)
    )


@pytest.mark.parametrize(("kind", "worst"), [("O1", 0), ("O2", np.inf), ("O3", 0), ("O4", 0), ("O5", 0)])
def test_a_set_that_sees_too_little_has_the_worst_value(kind, worst):
    assert index_value(kind, sample()[:1, :2]) == worst


def test_an_unknown_index_is_refused_by_name():
    with pytest.raises(InputError, match=r'"?O6"?.*O1, O2, O3, O4, O5'):
        find_rule("O6")


def test_the_gap_has_the_sense_of_the_index():
    assert find_rule("O2").gap(33.0, 30.0) == pytest.approx(0.1)
    assert find_rule("O3").gap(0.9, 0.99) == pytest.approx(0.1)


def test_the_triangular_factor_in_pieces_keeps_small_singular_values():
    rows = np.random.default_rng(1).standard_normal((40_000, 1, 6))
    rows[..., 5] = rows[..., 0] + 1e-12 * rows[..., 5]
    factor = r_factor(rows)
    assert np.allclose(np.tril(factor, -1), 0)
    whole = svdvals(rows[:, 0])
    assert np.linalg.svd(factor, compute_uv=False)[-1] == pytest.approx(whole[-1], rel=1e-2)
    assert np.sqrt(np.linalg.eigvalsh(rows[:, 0].T @ rows[:, 0])[0].clip(0)) != pytest.approx(whole[-1], rel=0.5)


def test_rows_that_are_not_numbers_are_refused():
    rows = sample()
    rows[7, 1, 2] = np.nan
    with pytest.raises(InputError, match="row 22"):
        r_factor(rows)


def test_covariance_is_what_many_fits_scatter_by():
    rng = np.random.default_rng(3)
    rows, noise = sample(4, n=30), 0.3
    predicted = predict_covariance(rows, noise)
    tall = rows.reshape(-1, 5)
    fits = np.linalg.lstsq(tall, noise * rng.standard_normal((90, 20_000)), rcond=None)[0]
    assert np.std(fits, axis=1) == pytest.approx(predicted.std, rel=0.03)
    assert np.corrcoef(fits) == pytest.approx(predicted.correlation, abs=0.03)
    assert np.all(predicted.inflation >= noise * 0.999)


def test_a_prior_is_one_more_reading_and_a_reading_may_have_its_own_noise():
    rows, prior = sample(5, n=10), np.array([1, 2, 3, 4, 5.0])
    noise = np.linspace(0.1, 2, 30).reshape(10, 3)
    white = (rows / noise[..., None]).reshape(-1, 5)
    expected = np.linalg.inv(white.T @ white + np.diag(prior**-2))
    assert predict_covariance(rows, noise, prior).matrix == pytest.approx(expected, rel=1e-8)


def test_an_unseen_direction_needs_a_prior():
    rows = sample()
    rows[..., 4] = rows[..., 0]
    with pytest.raises(InputError, match="unseen"):
        predict_covariance(rows, 1.0)
    assert np.isfinite(predict_covariance(rows, 1.0, np.ones(5)).std).all()
    rows[..., 4] = 0
    with pytest.raises(InputError, match="parameter 4 moves no reading"):
        predict_covariance(rows, 1.0)
    with pytest.raises(InputError, match="above zero"):
        predict_covariance(rows, 0.0)


def test_sensitivity_is_the_rms_change_of_a_reading():
    assert rms_sensitivity(sample()) == pytest.approx(np.sqrt(np.mean(sample().reshape(-1, 5) ** 2, axis=0)))
