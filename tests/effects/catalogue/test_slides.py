"""Effects of joints that slide: what is offered, its columns against differences, and what turning joints have."""

import numpy as np
import pytest

import tests.identification.rigs as rigs
from planner.effects.catalogue import catalogue
from planner.effects.compliance import LoadTorque
from planner.effects.context import Context
from planner.effects.phi_keys import phi_from_key
from planner.model.model import Model
from tests.effects.catalogue.test_phis import column_and_differences, everything
from tests.kinematics.sliding_arms import write_rail

OF_SLIDES = {"slide scale", "guide straightness", "carriage tilt", "slide play", "slide compliance"}
UNITS = {"slide scale": "1", "guide straightness": "m", "carriage tilt": "rad", "slide play": "m"}
UNITS |= {"slide compliance": "m/N"}


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """An arm on a rail before a tracker, and what its samples can show."""
    rng = np.random.default_rng(3)
    setup = rigs.setup(str(write_rail(tmp_path_factory.mktemp("rail"), "mdh")), "position", rng)
    s = everything(setup, 12, rng)
    return setup, s, rigs.targets(setup, "position", s, rng), catalogue(setup, s)


def test_a_slide_has_the_effects_of_slides_alone(bench):
    setup, *_, entries = bench
    own = [e for e in entries if e.place.number == 0 and e.place.part == "joint"]
    assert {e.kind for e in own} - {"unsettled angle"} == OF_SLIDES  # that one is a share of what is not reached
    assert {e.kind: e.unit for e in own if e.kind in OF_SLIDES} == UNITS
    others = {e.kind for e in entries if e.place.part == "joint" and e.place.number == 1}
    assert not others & OF_SLIDES
    assert {"joint compliance", "encoder once a turn", "backlash"} <= others
    assert setup.robot.slides.tolist() == [True, *[False] * 6]


def test_columns_of_slides_are_the_derivative_of_the_prediction(bench):
    setup, s, target, entries = bench
    parameters = [p for e in entries if e.kind in OF_SLIDES for p in e.make(None)]
    assert len(parameters) == 1 + 4 + 6 + 1 + 1
    for p in parameters:
        column, found = column_and_differences(setup, s, target, p)
        size = np.abs(column).max()
        assert size > 0, p.name
        assert np.abs(column - found).max() < 2e-5 * size, p.name
        assert all(phi_from_key(m.phi.key, 7) == m.phi for m in p.moves)


def test_geometry_of_a_rail_has_its_derivatives(bench):
    setup, s, target, _ = bench
    model = Model.of(setup, frozenset())
    for p in model.parameters:
        column, found = column_and_differences(setup, s, target, p)
        assert np.abs(column - found).max() < 2e-5 * max(np.abs(column).max(), 1e-9), p.name
    assert "d1" in model.names
    assert next(p for p in model.parameters if p.name == "d1").unit == "m"


def test_the_load_of_a_slide_is_a_force(bench):
    setup, s, *_ = bench
    weight = sum(m.mass for m in setup.robot.masses) + setup.tool_mass + s.payload
    force = LoadTorque(0)(Context(setup, s))
    u = setup.chain.forward(setup.robot.theta(s.q), setup.offsets(s)).u[setup.chain.joint_places[0]]
    assert np.allclose(force, weight * (setup.gravity_B @ u), rtol=1e-9)
