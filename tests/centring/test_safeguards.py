"""What goes wrong at a cell: each stops the robot, says what it is, and loses nothing."""

import threading
import time

import numpy as np
import pytest

from planner.centring.stop import (
    ContactError,
    DivergingError,
    LinkError,
    RangeError,
    SilentError,
    StoppedError,
    StuckError,
    UnsettledError,
)
from planner.common.errors import InputError, NoSolutionError
from tests.centring.conftest import OFFSETS, settings
from tests.centring.test_session import angles, rows_of
from tests.centring.world import pose


def wait_for(condition, seconds=120.0):
    until = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.002)


def when(condition, act):
    threading.Thread(target=lambda: (wait_for(condition), act()), daemon=True).start()


def short(made):
    """How far the arm stands from where the last order sent it [deg]."""
    _, goal = made.controller.orders[-1]
    return np.abs(made.world.q_set - [goal[f"A{j}"] for j in range(1, 7)]).max()


@pytest.mark.slow
def test_dropped_bytes_do_no_harm(cell):
    made = cell(lose=0.02, tilt=2.0)
    made.run(settings(head={"timeout_s": 0.05, "tries": 12}))
    assert sum(t.lost for t in made.terminals) > 20
    assert all(made.world.miss(q) < 0.0055 for q in angles(rows_of(made.output)))


def test_a_silent_indicator(cell):
    made = cell()
    made.terminals[1].silent = True
    with pytest.raises(SilentError, match=f"{made.ports[1]}.*asked 4 times and said nothing within 0.2 s") as caught:
        made.run(settings(head={"timeout_s": 0.2}))
    assert isinstance(caught.value, NoSolutionError)
    assert made.controller.values["EDBB_STOP"] is True


def test_an_indicator_that_says_it_cannot_measure(cell):
    made = cell()
    made.terminals[2].reply = lambda request: b"ERR3\r"
    with pytest.raises(SilentError, match="out of its measuring range"):
        made.run()


def test_an_unplugged_indicator(cell):
    made = cell()
    when(lambda: len(made.controller.orders) >= 3, made.terminals[0].unplug)
    with pytest.raises(SilentError):
        made.run()
    assert made.controller.values["EDBB_STOP"] is True


def test_an_indicator_that_sticks_in_the_ball(cell):
    made = cell()
    made.world.jammed = {}
    shown = made.world.shown
    made.world.shown = lambda k: 0.8 if k == 1 and shown(0) > -5.0 else shown(k)
    with pytest.raises(StuckError, match=r"indicator y changed by \+0.000 mm where .* stuck"):
        made.run()


def test_an_indicator_that_sticks_at_zero_is_seen_before_the_ball_is_touched(cell):
    made = cell()
    made.world.jammed = {2: 0.0}
    with pytest.raises(ContactError, match=r"pose 1 on ball 1: indicator z shows \+0.000 mm off the ball.*stuck"):
        made.run()
    assert not [k for k, _ in made.controller.orders if k == "2"]


@pytest.mark.parametrize("k", [0, 1, 2])
def test_a_wrong_sign_is_found_within_half_a_millimetre(cell, k):
    made = cell()
    made.world.axes[k] *= -1.0
    name = "xyz"[k]
    with pytest.raises(DivergingError, match=f"indicator {name} .* the other way round") as caught:
        made.run(settings(head={"check_free": False}))
    assert "0 of 3 poses are kept" in str(caught.value)
    x, _ = pose(made.world.q)
    planned, _ = pose(made.content["poses"][1]["q_deg"])
    assert np.linalg.norm(x - planned) < 0.51


def test_a_small_wrong_sign_diverges(cell, monkeypatch):
    monkeypatch.setitem(OFFSETS, 1, (0.03, 0.0, 0.0))
    made = cell()
    made.world.axes[0] *= -1.0
    with pytest.raises(DivergingError):
        made.run(settings(head={"check_free": False}))


def test_two_indicators_changed_places(cell):
    made = cell()
    made.world.axes = made.world.axes[[1, 0, 2]]
    with pytest.raises((DivergingError, StuckError), match=r"indicator [xy] changed by"):
        made.run()


def test_an_indicator_in_inches(cell):
    made = cell()
    made.world.scale[0] = 1 / 25.4
    with pytest.raises(StuckError, match="inches"):
        made.run(settings(head={"check_free": False}))


def test_a_robot_that_says_it_moved_and_did_not(cell):
    made = cell()
    shift = made.world.land
    made.world.land = lambda q: shift(q) if made.controller.orders[-1][0] == "1" else made.world.place(*[before] * 2)
    before = np.array(made.content["poses"][1]["q_deg"], float)
    with pytest.raises(StuckError, match="no indicator followed"):
        made.run()


@pytest.mark.parametrize(
    ("offset", "error", "says"),
    [
        ((0.0, 5.5, 0.0), RangeError, r"indicator y shows \+5.500 mm; usable are"),
        ((-5.3, 0.0, 0.0), ContactError, "x shows -5.300"),
    ],
)
def test_out_of_range(cell, monkeypatch, offset, error, says):
    monkeypatch.setitem(OFFSETS, 1, offset)
    with pytest.raises(error, match=says):
        cell().run()


def test_a_ball_that_is_not_there(cell, monkeypatch):
    monkeypatch.setitem(OFFSETS, 1, (-20.0, 0.0, 0.0))
    with pytest.raises(ContactError, match=r"shows -6.150 mm .*does not touch the ball"):
        cell().run()


def test_contact_lost_on_the_way(cell):
    made = cell()
    shown = made.world.shown
    made.world.shown = lambda k: -6.15 if k == 2 and [o for o in made.controller.orders if o[0] == "2"] else shown(k)
    with pytest.raises(ContactError, match=r"indicator z .* contact was lost"):
        made.run()


def test_no_more_travel_than_allowed(cell):
    with pytest.raises(RangeError, match=r"2\.50 mm away from the planned pose; 2 mm are allowed"):
        cell().run(settings(moves={"travel_mm": 2.0}))


def test_no_more_moves_than_allowed(cell):
    made = cell(landing=0.03)
    with pytest.raises(DivergingError, match="after 6 moves the indicators still show"):
        made.run(settings(moves={"most_moves": 6}))
    assert sum(k == "2" for k, _ in made.controller.orders) == 6


def test_a_cell_that_shakes(cell):
    made = cell(noise=0.02)
    with pytest.raises(UnsettledError, match="after 10 readings"):
        made.run(settings(rest={"most_readings": 10}))


@pytest.mark.parametrize("order", [1, 3, 5])
def test_a_robot_that_is_cut_off_and_the_session_goes_on(cell, order):
    made = cell(count=2, faults={"cut": 6 + order})
    with pytest.raises(LinkError, match="does not answer any more"):
        made.run()
    wait_for(lambda: made.controller.values["EDBB_DONE"] == made.controller.values["EDBB_GO"])
    made.revive()
    made.run()
    assert rows_of(made.output)["pose"].to_list() == [1, 3]


def test_the_robot_stops_by_itself_when_the_planner_falls_silent(cell):
    # a planner on a busy machine may well say nothing for a tenth of a second, and that is no silence
    made = cell(faults={"cut": 3, "slow": 4.0, "silence": 1.0})
    with pytest.raises(LinkError):
        made.run(settings(robot={"silence_s": 1.0}))
    wait_for(lambda: made.controller.values["EDBB_STATE"] == 4)
    assert short(made) > 0.1


def test_a_robot_that_no_longer_answers(cell):
    made = cell(faults={"deaf": 4})
    with pytest.raises(LinkError, match=r"gave no answer for .* in 1 s"):
        made.run()


def test_a_move_that_never_ends(cell):
    made = cell(faults={"slow": 60.0})
    made.world.place(made.world.q_set + 1.0, made.world.q + 1.0)
    with pytest.raises(LinkError, match=r"did not finish a move within 0.2 s"):
        made.run(settings(robot={"move_s": 0.2}))
    wait_for(lambda: made.controller.values["EDBB_STATE"] == 2)
    assert short(made) > 0.1


def test_a_program_that_does_not_run(cell):
    with pytest.raises(LinkError, match="EDBB_CENTRE does not run"):
        cell(faults={"idle": True}).run()


def test_a_controller_without_the_program(cell):
    made = cell()
    made.controller.values.pop("EDBB_AX")
    with pytest.raises(LinkError, match="does not set 'EDBB_AX'"):
        made.run()


def test_a_robot_that_stands_off_the_planned_path(cell):
    made = cell()
    made.world.place(made.world.q_set + 10.0, made.world.q + 10.0)
    with pytest.raises(LinkError, match=r"stands 10.0 deg away from the planned path"):
        made.run()
    assert made.controller.orders == []


@pytest.mark.parametrize("by", ["file", "hand"])
def test_a_stop_on_demand_stops_the_arm_in_its_move(cell, tmp_path, by):
    made = cell(faults={"slow": 0.5})
    made.stop.file = tmp_path / "stop"
    ask = made.stop.file.touch if by == "file" else lambda: made.stop.ask("Ctrl-C")
    when(lambda: len(made.controller.orders) >= 2, ask)
    with pytest.raises(StoppedError, match=r"stopped by (the file|Ctrl-C)"):
        made.run()
    wait_for(lambda: made.controller.values["EDBB_STATE"] == 2)
    assert short(made) > 0.1


def test_nothing_is_opened_twice_or_wrongly(cell):
    made = cell()
    made.ports = made.ports[:1] * 3
    with pytest.raises(InputError, match="names a port twice"):
        made.run()
