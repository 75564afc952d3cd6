"""What is summed up over the pieces of a long run, against the run as a whole."""

from types import SimpleNamespace

import numpy as np
import pytest

from planner.fit.covariance import _scores
from planner.fit.cross_validation import Split, _grams
from planner.fit.problem import LinearPiece
from planner.model.columns import Columns

WHOLE = np.random.default_rng(0).normal(size=(4, 2, 50))  # columns and residual, two numbers a sample
PIECES = (slice(0, 17), slice(17, 34), slice(34, 50))


class Problem:
    """Stands in for a fit problem."""

    memory = SimpleNamespace(folds=None)

    def piece(self, part, errors):
        columns = WHOLE[:, :, part]
        return LinearPiece(Columns(columns, np.arange(4), np.zeros((0, *columns.shape[1:]))))

    def map_pieces(self, task):
        return map(task, PIECES)


@pytest.mark.parametrize("size", [1, 7, 50])
def test_scores_of_blocks_are_sums_over_their_samples_whatever_the_pieces(size):
    count = 50 // size
    block = np.minimum(np.arange(50) // size, count - 1)
    found = _scores(SimpleNamespace(problem=Problem(), errors=np.zeros(3)), block, count)
    each = (WHOLE[:3] * WHOLE[3]).sum(axis=1)
    np.testing.assert_allclose(found, [each[:, block == b].sum(axis=1) for b in range(count)])


@pytest.mark.parametrize("fold", [np.arange(50) // 10, np.arange(50) % 5], ids=["a few in a piece", "all in a piece"])
def test_products_of_folds_are_those_of_their_samples_whatever_the_pieces(fold):
    found = _grams(Problem(), np.zeros(3), Split("pose", fold, fold, fold))
    for f, gram in enumerate(found):
        own = WHOLE[:, :, fold == f].reshape(4, -1)
        np.testing.assert_allclose(gram, own @ own.T)
