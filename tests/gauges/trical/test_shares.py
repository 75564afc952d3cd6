"""Equal shares of the balls in DETMAX: against every possible choice where there are few, and below the bound."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from planner.common.errors import InputError
from planner.common.progress import Stages
from planner.design.observability.information import index_value
from planner.design.pose_selection import identify_candidates, select_poses
from planner.design.selection.d_optimal import detmax
from planner.design.selection.index_bound import certify_bound
from planner.session.options import PlanOptions
from planner.workflow.planning import plan_cell


@pytest.mark.parametrize("seed", range(6))
def test_nothing_better_among_all_choices_with_equal_shares(seed):
    rng = np.random.default_rng(seed)
    rows = rng.standard_normal((14, 2, 3)) * rng.uniform(0.2, 3, (14, 1, 1))
    group = np.repeat([0, 1], 7)
    best = max(
        index_value("O1", rows[[*a, *b]]) for a in combinations(range(7), 3) for b in combinations(range(7, 14), 3)
    )
    chosen = detmax(rows, 6, seed=seed, group=group)
    assert np.bincount(group[chosen]).tolist() == [3, 3]
    assert index_value("O1", rows[chosen]) >= 0.995 * best


def test_groups_that_differ_much_still_share():
    """All the information is in one group: without shares it would give all poses."""
    rng = np.random.default_rng(0)
    rows = rng.standard_normal((60, 3, 5))
    rows[30:] *= 0.01
    group = np.repeat([0, 1], 30)
    assert np.bincount(group[detmax(rows, 10)]).tolist() == [10]
    assert np.bincount(group[detmax(rows, 10, group=group)]).tolist() == [5, 5]


@pytest.mark.slow
def test_the_plans_poses_are_shared_and_near_the_bound(cell, pool):
    choice, curve = select_poses(cell, pool, 24, "O1", 0)
    curve.result()
    assert np.bincount(choice.ball).tolist() == [6, 6, 6, 6]
    _, _, rows = identify_candidates(cell, pool)
    assert choice.value == pytest.approx(index_value("O1", rows[choice.chosen]))
    assert choice.certificate.verified
    assert choice.value <= certify_bound(rows, "O1", 24).value * (1 + 1e-9)
    assert choice.value > 0.95 * choice.certificate.value


def test_uneven_counts_and_other_indices_are_refused(cell, pool):
    with pytest.raises(InputError, match="26 poses cannot be shared evenly between 4 balls"):
        select_poses(cell, pool, 26, "O1", 0)
    for options, told in (
        (PlanOptions(poses=26), "26 poses cannot be shared evenly"),
        (PlanOptions(index="O2"), "DETMAX on O1"),
    ):
        with pytest.raises(InputError, match=told):
            plan_cell(cell, options, Stages(lambda *_: None))
    with pytest.raises(InputError, match=r"'plan.poses' is missing"):
        plan_cell(replace(cell, plan=replace(cell.plan, poses=None)), PlanOptions(), Stages(lambda *_: None))
    with pytest.raises(InputError, match="8 poses cannot identify 31 parameters: ask for at least 11"):
        select_poses(cell, pool, 8, "O1", 0)
