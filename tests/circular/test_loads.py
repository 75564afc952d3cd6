"""Load steps on a circle beside its fixture's plane: the loaded bar's cell, whole turns one after the other."""

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.circular.plan import circle_samples
from planner.circular.planning import plan_circles
from planner.programs.dialect import PathForm
from planner.programs.instructions import Pause
from planner.session.neutral_program import session_program
from planner.session.options import PlanOptions
from planner.simulation.simulated_run import SAMPLE_RATE
from tests.circular.conftest import quiet

pytestmark = pytest.mark.long  # a whole plan
CIRCLE = """
[[circles]]
centre_mm = [1350, -125, 1250]
radius_mm = 125
overshoot_deg = 180
directions = ["cw"]
speed_mm_s = 200
loads_N = [125, 250]
repeats = 2
"""


@pytest.fixture(scope="module")
def loaded(tmp_path_factory):
    text = load_cell("abb-irb6700/ldbb").path.read_text().split("[[circles]]")[0]
    path = tmp_path_factory.mktemp("loaded") / "ldbb.toml"
    path.write_text(text + CIRCLE)
    return plan_circles(load_cell(str(path)), PlanOptions(dialect=("krl",)), quiet())


def test_a_turn_with_half_turns_before_and_after_ends_where_it_began(loaded):
    (drive,) = loaded.drives
    (arc,) = drive.arcs
    assert np.abs(arc.q[0] - arc.q[-1]).max() < 1e-6
    assert [(p.load, p.repeat, p.direction) for p in drive.passes] == [
        (125.0, 0, "cw"),
        (125.0, 1, "cw"),
        (250.0, 0, "cw"),
        (250.0, 1, "cw"),
    ]
    height = arc.circle.p_BC[2] - loaded.cell.fixtures[0].p_BX[2]
    assert np.allclose(arc.length, np.hypot(0.125, height), atol=1e-9)
    x = loaded.cell.map_position(drive.passes[0].path.q)
    assert np.ptp(np.unwrap(np.arctan2(x[:, 1] + 0.125, x[:, 0] - 1.350))) == pytest.approx(4 * np.pi)
    assert x[1, 1] + 0.125 > 0  # clockwise from 180 degrees: over the far side first


def test_the_operator_sets_every_load_once(loaded):
    said = [
        i.message
        for i in session_program(loaded.cell, loaded.courses, loaded.plan_id, PathForm()).instructions
        if isinstance(i, Pause)
    ]
    assert said[1:3] == ["set the load to 125 N", "set the load to 250 N"]
    assert len(said) == 4  # attach and take off beside them


def test_a_simulated_run_carries_the_load(loaded):
    force = circle_samples(loaded, SAMPLE_RATE).force
    assert force is not None
    assert set(np.unique(force)) == {125.0, 250.0}
