"""Arrays: what is done in place against numpy's own way."""

import numpy as np
import pytest

from planner.common.arrays import mirror_lower


@pytest.mark.parametrize("size", [1, 5, 256, 700])
@pytest.mark.parametrize("order", ["C", "F"])
def test_a_lower_triangle_is_mirrored_whatever_stands_above_it(size, order):
    matrix = np.asarray(np.random.default_rng(0).normal(size=(size, size)), order=order)
    expected = np.tril(matrix) + np.tril(matrix, -1).T
    assert mirror_lower(matrix) is matrix
    np.testing.assert_array_equal(matrix, expected)
