"""A first run names an effect and its rivals; the plan made for it tells them apart, whichever of them is the truth.

The arms and their runs are made by the generator, which shares no code with the planner.
"""

from dataclasses import replace

import numpy as np
import pytest

from tests.design.discrimination.worlds import CALLED, again, blindly, first, identified, named, pool, separated

pytestmark = pytest.mark.long

SEEDS = (1, 2)


@pytest.mark.parametrize("kind", CALLED)
def test_rivals_of_a_first_run_are_told_apart_by_the_second(kind, tmp_path):
    for seed in SEEDS:
        made = first(kind, seed)
        calibration = identified(made)
        (found, rivals), *more = named(calibration)
        assert not more
        assert rivals
        assert CALLED[kind] in {found, *rivals}
        chosen = separated(calibration, tmp_path)
        assert again(made, chosen.choice.q, seed + 200) == [(CALLED[kind], ())]
        _and_blindly_drawn_poses_are_less_sure(chosen, seed)


def test_blindly_drawn_poses_may_leave_it_open():
    """Of three draws for a wrong reduction ratio one or more; the aimed poses of the test above never do."""
    kind, seed = "reduction-ratio", SEEDS[0]
    draws = [pool().q[blindly(seed + 50 + k)] for k in range(3)]
    assert any(again(first(kind, seed), q, seed + 200) != [(CALLED[kind], ())] for q in draws)


def _and_blindly_drawn_poses_are_less_sure(chosen, seed):
    told = {t.pair: t for t in chosen.separation.told if t.named}
    for k in range(5):
        drawn = blindly(seed + 50 + k)
        there = pool().samples.take(drawn)
        one = replace(there, t=np.arange(len(drawn)) * 10.0, direction=np.ones_like(there.q))
        for t in chosen.judge_driven_visits((one,)).told:
            if t.named:
                assert t.noncentrality < told[t.pair].noncentrality
