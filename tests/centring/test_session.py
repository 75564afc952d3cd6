"""A whole session against the bytes of real devices: the balls are found, rows are true."""

import numpy as np
import polars as pl
import pytest

from planner.runs.loader import load_run
from tests.centring.conftest import OFFSETS, settings
from tests.centring.devices import multiplexer
from tests.centring.world import pose, turn
from tests.programs.test_controller_axes import as_the_pendant_shows, convention


def rows_of(path):
    return pl.read_csv(path, comment_prefix="#")


def angles(table, stem="q"):
    return table.select([f"{stem}{j}_deg" for j in range(1, 7)]).to_numpy()


@pytest.mark.slow
def test_every_ball_is_centred_to_3_micrometres(cell):
    made = cell(tilt=2.0, noise=0.0003, landing=0.0008, ringing=0.05, seed=3)
    made.run()
    table = rows_of(made.output)
    assert table["pose"].to_list() == [1, 3, 5]
    assert [str(b) for b in table["ball"]] == ["1", "2", "3"]
    for q in angles(table):
        assert made.world.miss(q) < 0.0055  # 3 µm on each of three axes, tilted by 2 degrees
    assert np.abs(table.select("dx_mm", "dy_mm", "dz_mm").to_numpy()).max() < 0.0055
    run = load_run(made.output, 6)
    assert run.plan_id == "0123456789ab"
    assert len(run) == 3
    assert run.warnings == ()
    assert not run.continuous
    assert np.allclose(made.world.q_set, made.content["poses"][0]["q_deg"], atol=1e-5)  # it is back at home


@pytest.mark.slow
def test_a_model_that_counts_its_joints_otherwise_finds_the_same_balls(cell):
    """The controller counts with sense, zero and coupling: rows are the joints of the model."""
    axes = convention("krl")
    made = cell(tilt=2.0, noise=0.0003, landing=0.0008, ringing=0.05, seed=3, axes=axes)
    made.run()
    table = rows_of(made.output)
    assert table["pose"].to_list() == [1, 3, 5]
    for q in angles(table):
        assert made.world.miss(as_the_pendant_shows(q)) < 0.0055
    assert np.allclose(made.world.q_set, made.content["poses"][0]["q_deg"], atol=1e-5)


@pytest.mark.slow
def test_the_larger_offset_takes_more_moves_and_none_is_larger_than_allowed(cell):
    made = cell()
    session = made.run()
    moves = {r.pose: r.moves for r in session.journal.rows}
    assert moves[3] > moves[1] > moves[5] > 0
    steps = [[by[axis] for axis in "XYZ"] for kind, by in made.controller.orders if kind == "2"]
    assert max(np.linalg.norm(s) for s in steps) <= 2.0 + 1e-4
    found = {r.pose: r.found_mm for r in session.journal.rows}
    for visit, offset in list(OFFSETS.items())[:3]:
        assert np.allclose(found[visit], offset, atol=2e-4)


def test_it_is_slow_only_where_tips_and_ball_touch(cell):
    made = cell(count=2)
    made.run()
    goals = [[axes[f"A{j}"] for j in range(1, 7)] for kind, axes in made.controller.orders if kind == "1"]
    balls = [p["q_deg"] for p in made.content["poses"][1:]]
    on_ball = [any(np.allclose(goal, ball, atol=1e-4) for ball in balls) for goal in goals]
    assert sum(on_ball) == 2
    slow = [k == 0 or on_ball[k] or on_ball[k - 1] for k in range(len(goals))]  # the first comes from near the way
    assert {axes["E1"] for kind, axes in made.controller.orders if kind == "1"} == {12.5}  # a linear unit stays there
    # every move but the first begins where the one before ended: a centring is undone, for the way begins there
    assert all(np.abs(a - b).max() < 1e-3 for a, b in zip(made.controller.starts[1:], goals[:-1], strict=True))
    assert made.controller.speeds == [1 if s else 10 for s in slow]


@pytest.mark.slow
def test_what_is_left_is_written_in_the_plates_axes(cell):
    made = cell(tilt=0.0, landing=0.02, seed=5)
    made.run(settings(moves={"tolerance_um": 60.0}, robot={"plate_rpy_deg": (10.0, -20.0, 30.0)}))
    R_BP = turn([0, 0, 1], 30.0) @ turn([0, 1, 0], -20.0) @ turn([1, 0, 0], 10.0)
    table = rows_of(made.output)
    for visit, q, left in zip(
        table["pose"], angles(table), table.select("dx_mm", "dy_mm", "dz_mm").to_numpy(), strict=True
    ):
        x, _ = pose(q)
        true = R_BP.T @ (x - made.world.balls[visit])
        assert np.linalg.norm(true) > 0.004
        assert np.allclose(left, true, atol=3e-4)


@pytest.mark.slow
def test_read_and_commanded_angles_are_both_kept(cell):
    made = cell(landing=0.001, seed=2)
    made.run()
    table = rows_of(made.output)
    off = np.abs(angles(table) - angles(table, "cmd"))
    assert 1e-6 < off.max() < 1e-2


def test_a_multiplexer_on_one_port(cell):
    made = cell(count=1, tilt=2.0)
    shared = multiplexer(made.world)
    made.stack.callback(shared.close)
    made.ports = [shared.port]
    made.run(settings(head={"protocol": "mitutoyo"}))
    assert made.world.miss(angles(rows_of(made.output))[0]) < 0.0055
