"""Arrays: what is done in place against numpy's own way."""

from dataclasses import dataclass

import numpy as np
import pytest

from planner.common.units import Rows, mirror_lower


@pytest.mark.parametrize("size", [1, 5, 256, 700])
@pytest.mark.parametrize("order", ["C", "F"])
def test_a_lower_triangle_is_mirrored_whatever_stands_above_it(size, order):
    matrix = np.asarray(np.random.default_rng(0).normal(size=(size, size)), order=order)
    expected = np.tril(matrix) + np.tril(matrix, -1).T
    assert mirror_lower(matrix) is matrix
    np.testing.assert_array_equal(matrix, expected)


@dataclass(frozen=True)
class Angles(Rows):
    read: np.ndarray
    used: np.ndarray
    commanded: np.ndarray
    time: np.ndarray | None = None


def test_rows_of_one_array_in_two_fields_are_taken_once():
    read = np.arange(12.0).reshape(6, 2)
    few = Angles(read, read, read.copy()).take(np.array([4, 1]))
    assert few.used is few.read
    assert few.commanded is not few.read
    assert few.time is None
    for each in (few.read, few.commanded):
        np.testing.assert_array_equal(each, [[8.0, 9.0], [2.0, 3.0]])
