"""Stages as they are told: each leaves less than the one before, and the last is where the search ended."""

from types import SimpleNamespace

import pytest

from planner.tracing.trace import told_path


@pytest.mark.parametrize(
    ("errors", "told"),
    [
        ((5.0, 3.0, 2.0, 1.0), (3.0, 2.0, 1.0)),
        ((5.0, 3.0, 4.0, 1.0), (3.0, 1.0)),  # a way that was left again
        ((5.0, 3.0, 0.84, 0.99), (3.0, 0.99)),  # what was needless was taken out again
        ((5.0, 6.0), (6.0,)),
        ((5.0,), ()),
    ],
)
def test_no_stage_ends_worse_than_the_one_before(errors, told):
    path = [SimpleNamespace(stage=SimpleNamespace(held_out=SimpleNamespace(rms=e))) for e in errors]
    assert tuple(s.stage.held_out.rms for s in told_path(path)) == told
