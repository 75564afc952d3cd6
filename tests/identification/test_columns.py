"""Columns in blocks of a screw times functions say the same as the columns themselves."""

import numpy as np
import pytest

from planner.model.columns import Columns
from planner.model.row_basis import posterior_basis


@pytest.fixture
def made(rng):
    """Five plain columns and two blocks, of 6 numbers and 40 samples, with a root of the noise and a residual."""
    order = rng.permutation(16)
    phi = (rng.standard_normal((7, 40)), rng.standard_normal((4, 40)))
    plain, screws = rng.standard_normal((5, 6, 40)), rng.standard_normal((2, 6, 40))
    root = np.tril(rng.standard_normal((40, 6, 6))) + 3 * np.eye(6)
    return Columns(plain, order[:5], screws, phi, (order[5:12], order[12:])), root, rng.standard_normal((40, 6))


@pytest.fixture
def rng():
    """Random numbers."""
    return np.random.default_rng(1)


def test_blocks_are_the_screw_times_the_functions(made):
    columns = made[0]
    for k, at in enumerate(columns.phi_at[0]):
        assert np.array_equal(columns.dense[at], columns.screws[0] * columns.phi[0][k])


def test_products_of_whitened_columns(made, rng):
    columns, root, residual = made
    scale = rng.uniform(0.5, 2.0, 16)
    white = columns.whiten(np.ascontiguousarray(root.T), scale, residual)
    every = np.concatenate([columns.dense * scale[:, None, None], residual.T[None]])
    expected = np.einsum("nij,pjn->pin", root, every)
    flat = expected.reshape(17, -1)
    assert white.dense == pytest.approx(expected, rel=1e-12, abs=1e-12)
    assert white.gram == pytest.approx(flat @ flat.T, rel=1e-12, abs=1e-10)
    vector = rng.standard_normal(17)
    assert white.times(vector) == pytest.approx(np.tensordot(vector, expected, axes=1).T, rel=1e-11, abs=1e-11)
    turn = np.triu(rng.standard_normal((16, 16)))
    turned = np.einsum("pq,pin->qin", turn, expected[:-1])
    assert white.square_sums(turn) == pytest.approx((turned**2).sum(axis=0).T, rel=1e-11)
    few = np.array([3, 4, 20])
    assert np.array_equal(white.take(few).dense, white.dense[:, :, few])


def test_a_basis_of_many_rows_is_orthonormal_with_the_prior_below(rng):
    rows = rng.standard_normal((12_000, 90)) * np.geomspace(1e-3, 1e5, 90)
    rows[:, 1] = rows[:, 2] * 1e-3 + rows[:, 1]  # nearly alike
    basis, triangle = posterior_basis(rows, 1.0)
    inverse = np.linalg.inv(triangle)
    assert basis.T @ basis + inverse.T @ inverse == pytest.approx(np.eye(90), abs=1e-9)
    np.testing.assert_allclose(basis @ triangle, rows, rtol=1e-9, atol=1e-6)
    expected = np.linalg.qr(np.vstack([rows, np.eye(90)]))[0][:12_000]
    y = rng.standard_normal(12_000)
    np.testing.assert_allclose(basis @ (basis.T @ y), expected @ (expected.T @ y), rtol=0, atol=1e-9)
