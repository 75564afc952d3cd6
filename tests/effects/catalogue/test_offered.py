"""What is offered: only what the setup has and the logged columns can tell; every entry whole and in order."""

from dataclasses import replace
from string import Formatter

import numpy as np
import pytest

import tests.identification.rigs as rigs
from planner.effects.catalogue import catalogue
from planner.effects.context import Context
from planner.effects.effect import implausible_text
from planner.effects.gauge_errors import BallShape
from planner.effects.gears import JointWave
from tests.effects.catalogue.test_phis import everything

NEEDS = {
    "temperature": {"link growth", "thermal drift", "gauge growth"},
    "t": {"drift", "warm-up"},
    "torque": {"compliance under drive torque"},
    "session": {"session step", "remounting"},
    "q_cmd": {"unsettled angle"},
    "speed": {"servo lag", "gauge lag"},
    "length": {"scale interpolation"},
    "reversals": {"hysteresis"},
    "payload": {"payload compliance"},
}
CONSTANT = ("temperature", "t", "torque", "session", "speed", "payload")


def site(kind="length", n=60, name="comau-nj130"):
    rng = np.random.default_rng(2)
    setup = rigs.setup(name, kind, rng)
    return setup, everything(setup, n, rng)


def kinds(setup, samples):
    return {e.kind for e in catalogue(setup, samples)}


@pytest.mark.parametrize("column", list(NEEDS))
def test_what_needs_a_column_is_offered_only_with_it(column):
    setup, samples = site()
    assert NEEDS[column] <= kinds(setup, samples)
    assert not NEEDS[column] & kinds(setup, replace(samples, **{column: None}))


@pytest.mark.parametrize("column", CONSTANT)
def test_what_needs_a_column_is_not_offered_where_it_stands_still(column):
    setup, samples = site()
    still = np.zeros_like(getattr(samples, column)) + getattr(samples, column)[:1]
    assert not NEEDS[column] & kinds(setup, replace(samples, **{column: still}))


def test_backlash_needs_both_directions():
    setup, samples = site()
    one = replace(samples, speed=None, direction=np.where(np.arange(6) == 2, 1.0, samples.direction))
    on = {str(e.place) for e in catalogue(setup, one) if e.kind == "backlash"}
    assert on == {f"joint {i}" for i in (1, 2, 4, 5, 6)}
    assert "backlash" not in kinds(setup, replace(samples, speed=None, direction=None))


def test_a_joint_that_never_moved_has_no_waves():
    setup, samples = site()
    q = samples.q.copy()
    q[:, 3] = 0.2
    entries = catalogue(setup, replace(samples, q=q))
    waves = {(e.kind, e.place) for e in entries if "turn" in e.kind or "ripple" in e.kind}
    assert waves
    assert not any(place.joint == 3 for _, place in waves)


def test_gauges_have_their_own_errors():
    bar, tracker, plate = (kinds(*site(kind)) for kind in ("length", "position", "sockets"))
    assert {"gauge sag", "ball centre", "gauge nonlinearity", "scale interpolation"} <= bar - tracker
    assert "gauge scale" in bar & tracker & plate
    assert "refraction" not in bar


def test_gear_ratio_names_the_motors_own_errors():
    setup, samples = site()
    assert not {"strain-wave error", "motor-side error"} & kinds(setup, samples)
    ratios = (100.0, None, None, None, None, 50.0)
    setup = replace(setup, robot=replace(setup.robot, gear_ratio=ratios))
    named = {(e.kind, str(e.place)): e for e in catalogue(setup, samples) if "error" in e.kind}
    assert set(named) == {(k, f"joint {i}") for k in ("strain-wave error", "motor-side error") for i in (1, 6)}
    waves = [m.phi for p in named["strain-wave error", "joint 6"].make(None) for m in p.moves]
    assert [phi.frequency for phi in waves if isinstance(phi, JointWave)] == [100.0] * 2


def test_scan_of_frequencies_is_a_quarter_wave_fine():
    setup, samples = site()
    for e in catalogue(setup, samples):
        if e.kind == "gear ripple":
            travel = np.ptp(samples.q[:, e.place.joint])
            steps = np.diff(e.nonlinear.values) * travel / (2 * np.pi)
            assert np.allclose(steps, 0.25)
            assert e.nonlinear.values[0] == 2.5
            assert e.nonlinear.values[-1] > 395


@pytest.mark.parametrize("kind", ["length", "position", "pose", "sockets"])
@pytest.mark.parametrize("name", rigs.ROBOTS)
def test_entries_are_whole(name, kind):
    setup, samples = site(kind, name=name)
    entries = catalogue(setup, samples)
    assert len({e.name for e in entries}) == len(entries)
    labels = []
    for e in entries:
        value = None if e.nonlinear is None else float(e.nonlinear.values[0])
        words = {field for _, field, _, _ in Formatter().parse(e.sentence) if field}
        assert words - {"grow"} == ({"size"} if e.nonlinear is None else {"size", "inner"}), e.sentence
        parameters = e.make(value)
        assert parameters
        assert {p.group for p in parameters} == {e.name}
        assert len({p.unit for p in parameters}) == 1
        assert all(0 < p.prior < e.largest for p in parameters), e.name
        assert e.literature
        labels += [p.name for p in parameters]
    assert len(set(labels)) == len(labels)


@pytest.mark.parametrize("minutes", [2, 60 * 18])
def test_no_arm_tilts_by_degrees_an_hour_or_warms_up_for_days(minutes):
    setup, samples = site()
    t = np.linspace(0.0, 60.0 * minutes, len(samples.q))
    offered = {(e.kind, str(e.place)): e for e in catalogue(setup, replace(samples, t=t))}
    tilt = offered["drift", "base tilt"]
    assert np.rad2deg(3600 * tilt.largest) < 0.3
    assert all(0 < p.prior < tilt.largest for p in tilt.make())
    assert "not plausible: at most" in implausible_text(tilt, np.deg2rad(8) / 3600)
    assert "µrad/h" in implausible_text(tilt, np.deg2rad(8) / 3600)
    constants = offered["warm-up", "joint 2"].nonlinear.values
    assert constants.max() <= 4 * 3600
    assert np.all(np.diff(constants) > 0)


def test_a_weight_other_than_stated_is_told_by_how_far_the_joints_turn():
    """Its columns are those of a kilogram more at a joint that yields, over the largest of them."""
    setup, samples = site()
    mass = next(e for e in catalogue(setup, samples) if e.kind == "payload mass")
    assert mass.unit == "rad"
    c = Context(setup, samples)
    for p in mass.make():
        assert np.abs(p.main_move.phi(c)).max() == pytest.approx(1.0)


def test_same_samples_give_the_same_entries():
    setup, samples = site()
    once, again = (
        [(e.name, e.make(e.grid[min(1, len(e.grid) - 1)])) for e in catalogue(setup, samples)] for _ in range(2)
    )
    assert once == again


def test_links_of_unknown_mass_have_a_share_of_their_own():
    setup, samples = site("position")
    unknown = replace(setup, robot=replace(setup.robot, masses=(None,) * 6), tool_mass=0.0)
    bare = replace(samples, payload=None, force=None)
    entries = {(e.kind, str(e.place)): e for e in catalogue(unknown, bare)}
    assert [p.name for p in entries["joint compliance", "joint 3"].make(None)] == [
        f"compliance3_link{k}" for k in (3, 4, 5, 6)
    ]
    assert ("tool compliance", "tool") in entries


def test_a_ball_of_two_lobes_is_a_quadratic_form():
    """Any symmetric form of the bar's direction without its mean is a sum of the five harmonics, at either end."""
    setup, samples = site()
    c = Context(setup, samples)
    form = np.random.default_rng(4).normal(size=(3, 3))
    for end, axes in (("fixture", np.eye(3)), ("tool", None)):
        e = c.bar.direction if axes is not None else np.einsum("ni,ian->na", c.bar.direction, c.motion.R)
        wanted = np.einsum("ni,ij,nj->n", e, form + form.T, e) - np.trace(form + form.T) / 3
        shapes = np.stack([BallShape(end, 2, k)(c) for k in range(5)], axis=1)
        assert np.abs(shapes).max() <= 1 + 1e-12
        assert np.allclose(shapes @ np.linalg.lstsq(shapes, wanted)[0], wanted)


def test_a_spring_that_balances_the_arm_pulls_by_the_two_waves_of_its_entry():
    """A spring of no free length between a post and a crank: its torque from its energy, turned by a little."""
    setup, samples = site()
    (spring,) = [e for e in catalogue(setup, samples) if e.kind == "balancing spring"]
    assert str(spring.place) == "joint 2"
    post, crank = np.array([-0.1, 0.6]), 0.2

    def energy(q):
        end = crank * np.stack([np.cos(q + 0.4), np.sin(q + 0.4)], axis=-1)
        return 0.5 * 3e4 * ((end - post) ** 2).sum(axis=-1)

    q = samples.q[:, 1]
    torque = (energy(q + 1e-6) - energy(q - 1e-6)) / 2e-6
    waves = np.column_stack([p.main_move.phi(Context(setup, samples)) for p in spring.make()])
    left = torque - waves @ np.linalg.lstsq(waves, torque, rcond=None)[0]
    assert np.abs(left).max() < 1e-5 * np.ptp(torque)


def test_arms_that_hold_themselves_up_have_no_balancing_spring():
    assert "balancing spring" not in kinds(*site(name="ur5e"))
