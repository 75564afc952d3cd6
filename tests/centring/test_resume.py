"""A session that was interrupted goes on where it stopped; nothing measured is lost."""

import json
import socket
import threading

import pytest

from planner.centring.journal import journal_path
from planner.centring.session import open_session
from planner.centring.stop import LinkError, StoppedError
from planner.common.errors import InputError
from planner.runs.loader import load_run
from tests.centring.test_session import rows_of


def interrupted(cell, **how):
    """A cell in which two of four poses were measured before a stop."""
    made = cell(count=4, **how)
    made.said = Said(made, 2)
    with pytest.raises(StoppedError, match="2 of 4 poses are kept"):
        made.run()
    return made


class Said(list):
    """Asks for a stop after so many poses."""

    def __init__(self, made, count):
        self.made, self.count = made, count

    def append(self, line):
        super().append(line)
        if len(self) == self.count:
            self.made.stop.ask("Ctrl-C")


def test_it_goes_on_where_it_stopped(cell):
    made = interrupted(cell)
    first = rows_of(made.output)
    made.revive()
    made.said = []
    made.run()
    table = rows_of(made.output)
    assert table["pose"].to_list() == [1, 3, 5, 7]
    assert table["session"].to_list() == [0, 0, 1, 1]
    assert len(made.said) == 2
    assert (table["t_s"].diff().drop_nulls() > 0).all()
    assert table[:2].select(first.columns).equals(first)
    assert load_run(made.output, 6).warnings == ()


def test_what_a_person_noted_above_the_run_stays(cell):
    made = interrupted(cell)
    made.output.write_text("# master_mm: 0.012 0.003 -0.004\n" + made.output.read_text())
    made.revive()
    made.said = []
    made.run()
    text = made.output.read_text()
    assert text.startswith("# master_mm: 0.012 0.003 -0.004\n# measure: static\n")
    assert text.count("master_mm") == text.count("# plan_id") == 1


def test_a_ball_that_is_measured_is_not_touched_again(cell):
    made = interrupted(cell)
    home = made.content["poses"][0]["q_deg"]
    made.world.place(home, home)  # the operator took the arm home
    made.revive()
    made.run()
    ptp = [t for k, t in made.controller.orders if k == "1"]
    measured = [made.content["poses"][k]["q_deg"] for k in (1, 2)]
    assert len(ptp) > 6
    assert not any(abs(axes[f"A{j + 1}"] - q[j]) < 1e-3 for axes in ptp for q in measured for j in [1])


SPOILT_ROWS = {
    "twice": (lambda row, other: other, "measured twice"),
    "negative": (lambda row, other: row | {"pose": -3}, "no journal"),
    "of no pose": (lambda row, other: row | {"pose": 400}, "none of the plan's"),
    "of another ball": (lambda row, other: row | {"ball": "elsewhere"}, "none of the plan's"),
    "short": (lambda row, other: row | {"q_deg": row["q_deg"][:5]}, "6 joint angles"),
}


def test_rows_of_a_journal_that_no_session_wrote_are_told(cell):
    made = interrupted(cell)
    path = journal_path(made.output)
    head, first, second = path.read_text().splitlines()
    for spoil, said in SPOILT_ROWS.values():
        row = spoil(json.loads(second), json.loads(first))
        path.write_text("\n".join([head, first, json.dumps(row)]) + "\n")
        made.revive()
        with pytest.raises(InputError, match=said):
            made.run()


def test_a_finished_session_does_nothing(cell):
    made = cell(count=1)
    made.run()
    before = made.output.read_bytes()
    made.revive()
    made.run()
    assert made.output.read_bytes() == before
    assert not [k for k, _ in made.controller.orders if k == "2"]


def test_a_half_written_line_is_dropped_and_measured_again(cell):
    made = interrupted(cell)
    journal = made.output.with_name("run.csv.journal")
    whole = journal.read_bytes()
    journal.write_bytes(whole[:-20])  # the power failed while the second row was written
    made.output.unlink()
    assert [v.id for v in open_session(made.plan, made.output).pending_visits] == [3, 5, 7]
    assert rows_of(made.output)["pose"].to_list() == [1]
    made.revive()
    made.run()
    assert sorted(rows_of(made.output)["pose"].to_list()) == [1, 3, 5, 7]
    assert open_session(made.plan, made.output).pending_visits == []


def test_another_plans_session_is_refused(cell):
    made = interrupted(cell)
    made.plan.write_text(json.dumps(made.content | {"plan_id": "ba9876543210"}))
    with pytest.raises(InputError, match="belongs to plan 0123456789ab, but this is plan ba9876543210"):
        made.run()


def test_a_file_that_is_no_session_is_refused(cell):
    made = cell()
    made.output.write_text("precious\n")
    with pytest.raises(InputError, match=r"run.csv is there, but not its journal"):
        made.run()
    assert made.output.read_text() == "precious\n"
    made.output.with_name("run.csv.journal").write_text("precious\n")
    with pytest.raises(InputError, match="is no journal"):
        made.run()


def test_rows_are_on_the_disk_before_the_arm_leaves_the_ball(cell):
    made = cell(count=1, faults={})
    left = threading.Event()
    land = made.world.land

    def leaving(q):
        rows = made.output.exists() and len(rows_of(made.output))
        if made.said and not left.is_set():
            left.set()
            assert rows == 1
        land(q)

    made.world.land = leaving
    made.run()
    assert left.is_set()


def test_a_way_between_balls_is_needed(cell):
    made = cell(count=2)
    content = {k: v for k, v in made.content.items() if k != "drives"}
    made.plan.write_text(json.dumps(content))
    with pytest.raises(InputError, match="pose 3 follows pose 1 with no path between"):
        made.run()
    off = [p["q_deg"] for p in made.content["drives"][0]["waypoints"] if p["visit"] == -1]
    after = zip((0, 1, 1, 3), off, strict=True)
    content["supports"] = [{"after": a, "q_deg": list(q)} for a, q in after]
    made.plan.write_text(json.dumps(content))
    made.run()
    assert rows_of(made.output)["pose"].to_list() == [1, 3]


def test_a_plan_without_balls_is_refused(cell):
    made = cell()
    poses = [{k: v for k, v in p.items() if k != "ball"} for p in made.content["poses"]]
    made.plan.write_text(json.dumps(made.content | {"poses": poses}))
    with pytest.raises(InputError, match="no pose names a ball"):
        made.run()


def test_nobody_answers_at_the_address(cell):
    made = cell()
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))
        made.controller.address = f"tcp://127.0.0.1:{nobody.getsockname()[1]}"
        with pytest.raises(LinkError, match="is KUKAVARPROXY running"):
            made.run()
