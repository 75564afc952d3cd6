"""The share of a command that is done never falls, never passes what is still to come, and says what is left."""

import time

import pytest

from planner.cli.terminal import UNKNOWN, TimeLeft
from planner.workflow.verbs import declared_calls

TIMED = {verb: call.starts for verb, call in declared_calls().items() if call.starts}
IDENTIFY = TIMED["identify"]


def test_the_long_commands_say_when_their_stages_begin():
    assert set(TIMED) == {"plan", "plan-both", "study", "identify", "papers"}


@pytest.mark.parametrize("starts", TIMED.values(), ids=TIMED)
def test_every_stage_begins_at_its_share(starts):
    left = TimeLeft(starts)
    for stage, share in starts.items():
        left.update(stage, 0, 0)
        assert left.share == share
    left.update(stage, 1, 1)
    assert left.share == 1.0


def test_steps_that_nobody_foresaw_come_nearer_to_the_next_stage_and_never_reach_it():
    left, shares = TimeLeft(IDENTIFY), []
    left.update("geometry", 0, 0)
    for k in range(50):
        left.update(f"trying {k}", 0, 0)
        shares.append(left.share)
    assert shares == sorted(shares)
    assert shares[0] == pytest.approx(IDENTIFY["geometry"] + UNKNOWN * (IDENTIFY["rivals"] - IDENTIFY["geometry"]))
    assert shares[-1] < IDENTIFY["rivals"]


def test_the_time_left_follows_from_the_time_gone(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    left = TimeLeft({"candidates": 0.0, "report": 0.5})
    left.update("candidates", 0, 10)
    assert left.text == ""
    now[0] += 20
    left.update("candidates", 4, 10)
    assert (left.share, left.text) == (0.2, "about 80 s left")
    left.update("candidates", 2, 10)  # what is told late takes nothing back
    assert left.share == 0.2
