"""A session that is to tell causes apart is recommended only where poses can."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from planner.cell.cell import setup_of
from planner.cell.reading import load_cell
from planner.model.finding import Finding
from planner.model.finding_groups import list_causes
from planner.workflow.identification import can_be_told_apart
from tests.independent_arms import runs


def calibration(findings, cell="comau-nj130/edbb", length=True):
    """What is asked of a calibration, on the planned poses of a bar with everything logged that can be."""
    setup = setup_of(load_cell(cell))
    q = runs.bar_poses()
    from planner.runs.run import Samples

    n = len(q)
    samples = Samples(
        q, np.zeros(n, dtype=int), t=np.arange(n) * 20.0, temperature=20 + np.arange(n) / n,
        direction=np.sign(np.diff(q, axis=0, prepend=q[:1] - 1e-3)),
    )  # fmt: skip
    readings = SimpleNamespace(length=np.ones(n) if length else None)
    run = SimpleNamespace(samples=samples, readings=readings)
    return SimpleNamespace(findings=findings, run=run, setup=replace(setup))


def found(rival, chance=0.3, name="encoder once a turn, joint 2"):
    effect, _, on = name.partition(", ")
    chances = None if chance is None else (chance,)
    return Finding(
        effect=effect, on=on, value=1e-4, unit="rad", probability=0.7, rivals=(rival,), rival_probabilities=chances
    )


@pytest.mark.parametrize(
    ("finding", "separable"),
    [
        (found("joint compliance, joint 2"), True),
        (found("joint compliance, joint 2", None), True),  # a file of before
        (found("backlash, joint 2"), True),
        (found("joint compliance, joint 2", 0.0), False),  # the readings have decided
        (found("unnamed, joint 2 by its load"), False),
        (found("thermal drift, joint 2"), False),  # no poses show what a thermometer must
        (found("step, tool point"), False),
        (found("joint compliance, joint 2", name="link growth, arm"), False),
    ],
)
def test_poses_tell_apart_what_they_show(finding, separable):
    assert can_be_told_apart(calibration([finding])) == separable


def test_what_is_one_of_many_is_looked_at_by_itself():
    own = [
        found("joint compliance, joint 2"),
        *(found("step, arm", name=f"encoder once a turn, joint {k}") for k in (3, 5)),
    ]
    (cause,) = list_causes(own)
    assert can_be_told_apart(calibration([cause]))
    assert not can_be_told_apart(calibration([cause.model_copy(update={"members": tuple(own[1:])})]))


def test_no_poses_are_chosen_for_a_band_of_a_gear():
    ripple = found("joint compliance, joint 2", name="gear ripple, joint 2")
    assert can_be_told_apart(calibration([ripple]))
    assert not can_be_told_apart(calibration([ripple.model_copy(update={"beside_stages": True})]))


def test_only_poses_of_a_bar_or_wire_are_chosen_so():
    assert not can_be_told_apart(calibration([found("joint compliance, joint 2")], length=False))
    assert not can_be_told_apart(calibration([]))
