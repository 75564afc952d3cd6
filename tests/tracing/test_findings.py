"""Rivals, detection limits, silence on clean runs, several effects at once."""

import numpy as np
import pytest

from tests.simulation.generator.truth import Noise
from tests.tracing.worlds import arm, calibrated, effect, names


@pytest.mark.slow
def test_what_is_the_same_is_named_as_a_rival():
    """A clock that runs late and joints that run behind are one and the same to first order."""
    found = calibrated((effect("gauge-lag", 0, share=3.0),), build="edbb_continuous", logs=(), size=4000)
    first = found.findings[0]
    both = {f"{first.effect}, {first.on}", *first.rivals}
    assert {"gauge lag, gauge", "servo lag, all joints"} <= both


@pytest.mark.slow
def test_what_is_not_the_same_is_no_rival():
    found = calibrated((effect("backlash-approach", 3, share=3.0),), seed=2)
    assert names(found) == ["backlash, joint 3"]
    assert set(found.findings[0].rivals) <= {"hysteresis, joint 3"}, "play that lets go at once is the same"


def found_at(times, seeds):
    """In how many runs a backlash of so many times its detection limit is found, at each joint in turn."""
    hits = 0
    for seed in seeds:
        joint = 1 + seed // 2 % 5
        clean = calibrated((), seed=seed, size=150)
        limit = next(x for x in clean.limits if (x.effect, x.on) == ("backlash", f"joint {joint}"))
        found = calibrated((effect("backlash-approach", joint, times * limit.size),), seed=seed, size=150)
        hits += f"backlash, joint {joint}" in names(found)
    return hits


@pytest.mark.long
def test_an_effect_of_the_size_of_its_limit_is_found():
    assert found_at(1.0, range(2, 16, 2)) >= 6
    assert found_at(0.3, range(2, 10, 2)) <= 1


@pytest.mark.long
@pytest.mark.parametrize("shape", ["white", "heavy", "correlated"])
def test_nothing_is_added_to_a_clean_run(shape):
    for seed in (2,):
        found = calibrated((), seed=seed, noise=Noise(shape=shape), logs=("direction", "temperature", "command"))
        assert names(found) == []
        assert found.stages[-1].name == "geometry"
        assert found.limits


@pytest.mark.long
def test_compliances_are_named_where_the_links_weigh_other_than_stated():
    """Two joints that yield, and masses a tenth off: no weight and no third joint is invented."""
    size = 2e-3 / arm().reference_torque(2)
    planted = tuple(effect("joint-compliance", j, size) for j in (2, 3))
    found = calibrated(planted, seed=6)
    assert sorted(names(found)) == ["joint compliance, joint 2", "joint compliance, joint 3"]
    for f in found.findings:
        assert abs(f.value - size) < 4 * f.std
        assert f.std < 0.3 * size


@pytest.mark.slow
def test_two_waves_of_one_joint_are_two_findings():
    waves = tuple(effect("reducer-ripple", 3, share=3.0, frequency=f, phase=0.3) for f in (5.3, 12.1))
    found = calibrated(waves, seed=8)
    assert names(found) == ["gear ripple, joint 3"] * 2
    assert sorted(f.inner.value for f in found.findings) == pytest.approx([5.3, 12.1], abs=0.15)


@pytest.mark.long
def test_held_out_error_reaches_that_of_a_fit_without_the_effect():
    found = calibrated((effect("encoder-twice", 4, share=3.0, phase=0.5),), seed=4)
    clean = calibrated((), seed=4)
    assert found.stages[-1].held_out.rms < 1.1 * clean.stages[-1].held_out.rms
    geometry = next(s for s in found.stages if s.name == "geometry")
    assert geometry.held_out.rms > 2 * clean.stages[-1].held_out.rms
    gain = geometry.held_out.rms - found.stages[-1].held_out.rms
    assert np.isclose(found.findings[0].gain, gain, rtol=0.05)  # noise and prior sigmas stay
