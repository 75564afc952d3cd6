"""Every kind of effect acts, vanishes with its size, and is scaled to the share that was asked for."""

import numpy as np
import pytest

import tests.simulation.generator.oracle as oracle
from tests.simulation.generator.catalogue import KINDS
from tests.simulation.generator.draw import as_in_a_real_arm, random_effect, random_run, random_truth, shown_by
from tests.simulation.generator.made import change
from tests.simulation.generator.runs import edbb_static
from tests.simulation.generator.shared import RUNS, arm, rng, run
from tests.simulation.generator.sizing import Implausible


def where_shown(kind):
    return [w for w in RUNS if kind_in(kind, w)]


def kind_in(kind, what):
    gauge, moving = ("edbb", True) if what == "moving" else (what, False)
    return gauge in kind.gauges and ("continuous" if moving else "static") in kind.motion


@pytest.mark.parametrize("kind", list(KINDS))
def test_effect_changes_the_reading_and_vanishes_with_its_size(kind):
    shown = where_shown(KINDS[kind])
    assert shown
    for what in shown:
        m = run(what)
        e = random_effect(m.scene.arm, kind, rng(4))
        change_of = change(m.scene, m.station, m.truth, e)
        assert np.all(np.isfinite(change_of))
        assert 1e-8 < np.abs(change_of).max() < 0.05, (kind, what)
        assert np.abs(change(m.scene, m.station, m.truth, e.of_size(0.0))).max() < 1e-12, (kind, what)
        nearly = change(m.scene, m.station, m.truth, e.of_size(e.size * 1e-3))
        assert np.allclose(nearly * 1e3, change_of, atol=0.1 * np.abs(change_of).max()), (kind, what)


@pytest.mark.parametrize("kind", [k for k in KINDS if KINDS[k].absorbed])
def test_geometry_takes_the_whole_of_an_absorbed_effect(kind):
    for what in where_shown(KINDS[kind]):
        m = run(what)
        e = random_effect(m.scene.arm, kind, rng(4))
        assert m.share_of(e) < 0.02 < oracle.rms(m.left_by(e)) / m.noise_rms


@pytest.mark.parametrize("what", list(RUNS))
@pytest.mark.parametrize("inside", [True, False])
def test_share_is_what_a_full_fit_leaves(what, inside):
    gauge, moving = ("edbb", True) if what == "moving" else (what, False)
    kinds = shown_by(gauge, moving, inside)
    how = {"n_rows": 4000, "waypoints": 12} if moving else {"n_poses": 120}
    m = random_run(RUNS[what], arm("comau-nj130"), 11, kinds, 3.0, **how)
    e = m.truth.effects[0]
    sizes = KINDS[e.kind].sizes(m.scene.arm, e.joint)
    assert m.share_of(e) == pytest.approx(3.0, rel=0.1)
    assert 0 < e.size <= 2 * sizes[1]
    assert KINDS[e.kind].in_catalogue == inside


@pytest.mark.long
def test_share_out_of_reach_is_refused():
    with pytest.raises(Implausible, match="gauge-scale"):
        random_run(edbb_static, arm("ur10"), 1, ("gauge-scale",), 3.0, n_poses=60)


def test_likeness_tells_rivals_from_strangers():
    m = run("moving")
    lag, delay = (random_effect(m.scene.arm, k, rng(1)).of_size(2e-3) for k in ("gauge-filter", "gauge-lag"))
    once, ripple = (random_effect(m.scene.arm, k, rng(1), joint=3) for k in ("encoder-once", "reducer-ripple"))
    assert m.likeness(lag, delay) > 0.99
    assert abs(m.likeness(once, ripple)) < 0.8
    assert m.likeness(once, once.of_size(-2 * once.size)) == pytest.approx(-1.0, abs=1e-3)


@pytest.mark.slow
def test_an_arm_as_in_life_has_its_seven_effects():
    m = as_in_a_real_arm(edbb_static, arm("comau-nj130"), 1, 2.0, n_poses=150)
    kinds = [e.kind for e in m.truth.effects]
    assert (kinds.count("joint-compliance"), kinds.count("reducer-ripple"), len(kinds)) == (3, 2, 7)
    assert [m.share_of(e) for e in m.truth.effects] == pytest.approx([2.0] * 7, rel=0.02)
    assert not np.allclose(m.scene.mass, m.scene.arm.mass)
    assert m.oracle()[1] < 0.5 * m.oracle(knows_effects=False)[1]


def test_random_truths_differ_in_kind_place_and_size():
    of, kinds = arm("comau-nj130"), shown_by("edbb", False)
    drawn = [random_truth(of, kinds, rng(s), 3.0, count=2).effects for s in range(60)]
    assert len({e.kind for pair in drawn for e in pair}) > 0.8 * len(kinds)
    assert all((a.kind, a.joint) != (b.kind, b.joint) for a, b in drawn)
    assert {e.joint for pair in drawn for e in pair} == {0, 1, 2, 3, 4, 5}


def test_table_says_what_counts_as_right():
    e = random_effect(arm("ur10"), "hysteresis", rng(), joint=4)
    row = KINDS["hysteresis"]
    assert row.counts_as_right(e, "backlash-approach", 4)
    assert not row.counts_as_right(e, "backlash-approach", 3)
    assert not row.counts_as_right(e, "joint-compliance", 4)
    assert KINDS["gauge-filter"].counts_as_right(e, "gauge-lag", 0)
    outside = {k.name for k in KINDS.values() if not k.in_catalogue}
    asked = {"hysteresis", "wobble", "warm-up-two", "sawtooth", "soft-floor-xy", "gauge-filter", "link-twist"}
    assert outside == {*asked, "gear-uneven", "hose-drag"}
