"""A small blind run, and the judge itself."""

import pytest

from planner.identification.pipeline import FitSettings
from tests.blind.plan import PARTS, tasks
from tests.blind.table import table
from tests.blind.trial import Outcome, Task, right, tried
from tests.simulation.generator.kinds import Effect


def test_the_judge_tells_right_from_wrong():
    ripple = Effect("reducer-ripple", 3)
    assert right(ripple, "gear ripple, joint 3")
    assert not right(ripple, "gear ripple, joint 2")
    assert not right(ripple, "backlash, joint 3")
    assert not right(ripple, "unnamed, joint 3")
    coupling = Effect("coupling", 5, 0.0, (("by", 4.0),))
    assert right(coupling, "coupling, joint 5 by joint 4")
    assert not right(coupling, "coupling, joint 5 by joint 6")
    assert right(Effect("gauge-sag", 0), "gauge sag, gauge")


@pytest.mark.slow
def test_building_and_table_share_no_seed():
    for part in PARTS:
        building, kept = ({t.seed for t in tasks(part, 50, table)} for table in (False, True))
        assert len(building) == len(kept) == 50
        assert not building & kept
        assert {s % 2 for s in building} == {0}
        assert {s % 2 for s in kept} == {1}


@pytest.mark.long
def test_few_blind_runs():
    """Half a dozen single effects, an arm with seven, and a clean run; even seeds."""
    kinds = ("encoder-twice", "backlash-approach", "joint-compliance", "gauge-sag", "coupling", "reducer-ripple")
    single = [Task("single", "edbb", "comau-nj130", kind, 3.0, "white", 40 + 2 * k) for k, kind in enumerate(kinds)]
    every, stages = [*single, *tasks("arm", 1, False), *tasks("clean", 1, False)], FitSettings(release=False)
    outcomes = [tried(t, stages) for t in every]  # no robot is released: the judge looks at the stages
    assert not any(o.failed for o in outcomes)
    assert sum(o.all_named for o in outcomes) >= len(outcomes) - 1
    assert sum(o.invented for o in outcomes) <= 1
    assert all(o.held_out < 1.1 * o.oracle for o in outcomes)
    assert all(o.geometry > 1.5 * o.oracle for o in outcomes if o.planted)
    lines = "\n".join(table(outcomes))
    assert "single at 3 x noise: 6/6" in lines or "single at 3 x noise: 5/6" in lines


def test_the_table_counts_what_was_missed_and_invented():
    task = Task("clean", "edbb", "comau-nj130", "", 0.0, "white", 0)
    lines = "\n".join(table([Outcome(task, held_out=1.0, oracle=1.0), Outcome(task, failed="broken: here")]))
    assert "added to 0/1" in lines
    assert "1 broken" in lines
