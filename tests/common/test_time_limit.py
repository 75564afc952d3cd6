"""A limit of time cuts searches and notes it; without one nothing changes; proofs end with an error, not half-done."""

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.common.errors import NoSolutionError
from planner.common.progress import UNLIMITED, Stages, TimeLimit
from planner.design.selection.index_search import exchange_poses
from planner.motion.path.constraints import Constraints
from tests.not_everywhere import require_planning


def test_a_share_that_is_over_is_noted_once() -> None:
    limit = TimeLimit(10.0)
    limit.start -= 5.0
    assert limit.must_stop(0.4, "this")
    assert limit.must_stop(0.3, "this")
    assert not limit.must_stop(0.6, "that")
    assert limit.notes == ("time limit of 10 s: this",)


def test_without_a_limit_nothing_is_over() -> None:
    assert Stages().limit is UNLIMITED
    assert not UNLIMITED.must_stop(0.0, "nothing")
    assert UNLIMITED.remaining_seconds(0.5) == np.inf
    UNLIMITED.check("proving")
    assert UNLIMITED.notes == ()


@pytest.mark.slow
def test_a_search_that_is_cut_keeps_a_bound_that_holds() -> None:
    rows = np.random.default_rng(0).normal(size=(400, 1, 5))
    whole = exchange_poses(rows, 12, "O2")
    limit = TimeLimit(1.0, start=0.0)
    cut = exchange_poses(rows, 12, "O2", limit=limit)
    assert limit.notes
    assert cut.certificate is not None
    assert whole.certificate is not None
    assert cut.certificate.verified
    assert cut.certificate.value <= whole.certificate.value * (1 + 1e-9)  # O2 is the smaller the better: a lower bound
    assert cut.value >= whole.value * (1 - 1e-9)


def test_no_motion_counts_as_proven_once_time_is_over() -> None:
    require_planning()
    free = Constraints(load_cell("ur10/edbb"), bar=False)
    home = free.cell.home[None]
    assert free.prove(home, home).proven.all()
    held = Constraints(free.cell, bar=False, scene=free.scene, limit=TimeLimit(1.0, start=0.0))
    with pytest.raises(NoSolutionError, match="1 s is over"):
        held.prove(home, home)
