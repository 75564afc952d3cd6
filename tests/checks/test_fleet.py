"""A fleet of 200 robots: how often a check cries wolf, how often it finds what changed, and whether it says what."""

from functools import partial

import numpy as np
import pytest
from scipy import stats

from planner.checks.assumptions import FALSE_ALARM, POWER
from planner.checks.detection import Detector
from planner.checks.evaluation import evaluate_check
from planner.common.units import DEG
from tests.checks.fleet import NAME, fleet, tracker_fleet
from tests.identification.worlds import arm_of
from tests.simulation.generator.truth import draw_errors

ROBOTS, COLLISIONS = 200, 40
SINGLE = ("zero of joint 2", "zero of joint 5", "tool", "fixture A")
FLEETS = {"bar": fleet, "tracker": partial(tracker_fleet, False), "tracker with a probe": partial(tracker_fleet, True)}


@pytest.fixture
def one_threshold(monkeypatch):
    """One threshold for all robots: they differ in it by less than draws can tell, and each would cost 0.1 s."""
    whole = vars(Detector)["threshold"].func
    known: list[float] = []

    def threshold(detector):
        if not known:
            known.append(whole(detector))
        return known[0]

    monkeypatch.setattr(Detector, "threshold", property(threshold))


def robot(f, k):
    rng = np.random.default_rng([21, k])
    errors = draw_errors(arm_of(NAME), rng)
    return errors, f.baseline(errors, rng), rng


def changed(errors, name, size, rng):
    """The errors of an arm after a change that moves its tool by ``size`` [m]; for an axis by so many radians."""
    after = dict(errors)
    if name.startswith("zero"):
        after[f"theta{name[-1]}"] += size * rng.choice([-1.0, 1.0])
        return after
    way = rng.standard_normal(3)
    for axis, v in zip("xyz", way / np.linalg.norm(way) * size, strict=True):
        after[f"{'map' if name == 'tool' else 'fixture_A'}_{axis}"] += v
    return after


@pytest.mark.long
@pytest.mark.parametrize("gauge", FLEETS)
def test_a_fleet_gives_alarms_and_findings_as_often_as_stated(one_threshold, gauge):
    f = FLEETS[gauge]()
    single = [name for name in SINGLE if gauge == "bar" or not name.startswith("fixture")]
    alarms, found, right, hit = 0, 0, 0, 0
    count = ROBOTS // 2 if "probe" in gauge else ROBOTS
    for k in range(count):
        errors, baseline, rng = robot(f, k)
        verdict = evaluate_check(baseline, f.cell, f.read(errors, rng))
        alarms += verdict.outcome != "unchanged"
        name = single[k % len(single)]
        mine = next(j for j in verdict.judged if j.change.name == name)
        lever = float(np.sqrt(mine.change.square[0, 0]))  # of an axis; 1 of what moves as a whole
        verdict = evaluate_check(baseline, f.cell, f.read(changed(errors, name, mine.detectable / lever, rng), rng))
        found += verdict.outcome != "unchanged"
        right += verdict.outcome != "unchanged" and name in [
            j.change.name for j in (verdict.likeliest_change, *verdict.rivals) if j
        ]
        if k < COLLISIONS:
            bent = {**errors, **{f"theta{i}": errors[f"theta{i}"] + rng.normal(0, 0.03) * DEG for i in (1, 2, 3, 4, 5)}}
            verdict = evaluate_check(baseline, f.cell, f.read(changed(bent, "tool", 1e-3, rng), rng))
            hit += verdict.outcome == "changed"
    print(f"{gauge}: {alarms} alarms, {found} of {count} found, {right} with their cause, {hit} of {COLLISIONS} hit")
    assert stats.binom.sf(alarms - 1, count, FALSE_ALARM) > 1e-3
    assert stats.binom.cdf(found, count, POWER) > 1e-3
    assert right > 0.9 * found
    assert hit == COLLISIONS
