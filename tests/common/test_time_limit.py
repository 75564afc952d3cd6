"""A limit of time cuts searches and notes it; without one nothing changes; proofs end with an error, not half-done."""

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.common.errors import NoSolutionError
from planner.common.progress import TimeLimit, current_limit, limit_time, must_stop
from planner.design.selection.index_search import exchange_poses
from planner.motion.path.constraints import Constraints


def test_a_share_that_is_over_is_noted_once() -> None:
    limit = TimeLimit(10.0)
    limit.start -= 5.0
    with limit_time(limit):
        assert current_limit() is limit
        assert must_stop(0.4, "this")
        assert must_stop(0.3, "this")
        assert not must_stop(0.6, "that")
    assert limit.notes == ("time limit of 10 s: this",)
    assert not must_stop(0.0, "no limit holds")


def test_a_search_that_is_cut_keeps_a_bound_that_holds() -> None:
    rows = np.random.default_rng(0).normal(size=(400, 1, 5))
    whole = exchange_poses(rows, 12, "O2")
    limit = TimeLimit(1.0, start=0.0)
    with limit_time(limit):
        cut = exchange_poses(rows, 12, "O2")
    assert limit.notes
    assert cut.certificate is not None
    assert whole.certificate is not None
    assert cut.certificate.verified
    assert cut.certificate.value <= whole.certificate.value * (1 + 1e-9)  # O2 is the smaller the better: a lower bound
    assert cut.value >= whole.value * (1 - 1e-9)


def test_no_motion_counts_as_proven_once_time_is_over() -> None:
    constraints = Constraints(load_cell("ur10/edbb"), bar=False)
    home = constraints.cell.home[None]
    assert constraints.prove(home, home).proven.all()
    with limit_time(TimeLimit(1.0, start=0.0)), pytest.raises(NoSolutionError, match="1 s is over"):
        constraints.prove(home, home)
