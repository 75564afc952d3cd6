"""Work grows with the size of a file and not by its square: what is looked at is counted, no time is taken."""

import numpy as np
import pytest

import planner.compensation.points as pt
from planner.common.errors import InputError
from planner.compensation.formats.gcode_calls import CallsElsewhere
from planner.compensation.formats.krl_calls import FrameChanges
from planner.compensation.targets import Target, TargetReading, ToolAndBase
from planner.programs.dialect import load_dialect
from planner.programs.languages import gcode, krl

N = 200
BODY = "I=1\n"


class Looked(list):
    """A list that counts how often it is looked through."""

    times = 0

    def __iter__(self):
        self.times += 1
        return super().__iter__()


def reading():
    return TargetReading("file", None, ToolAndBase())


def test_what_follows_a_lost_target_is_found_in_one_pass():
    read = reading()
    read.reserve()
    for k in range(N):
        read.add(Target(k + 1, (), q=np.zeros(6), follows=(k,)))
    read._found = Looked(read._found)
    assert read.take_targets() == []
    assert len(read.left) == N
    assert read._found.times < 10


def test_sources_at_the_end_of_a_chain_are_found_in_one_pass():
    made = Looked((f"a{k + 1}", {f"a{k}"}, k + 1) for k in range(N))
    found = pt.trace_sources(made, {f"a{N}"})
    assert found == {f"a{k}": k + 1 for k in range(N)}
    assert made.times < 10


def test_a_row_that_is_handed_on_again_and_again_gets_one_use_a_point():
    table = pt.PointTable(reading(), "file")
    poses = [pt.DeclaredPose(f"p[{k}]", k, {}) for k in range(1, N + 1)]
    for pose in poses:
        table.declare(pose)
    for k in range(N):
        table.use("p", 0, pt.Use((f"line {k}", f"line {k}"), None, linear=False))
        table.use(f"p[{k + 1}]", k, pt.Use((np.eye(4), np.eye(4)), k, linear=False))
    assert [len(pose.uses) for pose in poses] == [2] * N
    assert [pose.uses[0].frames[0] for pose in poses] == ["line 0"] * N


def test_loops_within_loops_look_at_each_move_once(monkeypatch):
    dialect = load_dialect("sinumerik")
    text = "LOOP\nCALLED\nG1 A1=1\n" * N + "ENDLOOP\n" * N
    blocks = list(gcode.parse(text, dialect))
    calls, looked = CallsElsewhere(blocks, jumps=False), []
    check = CallsElsewhere._check
    monkeypatch.setattr(CallsElsewhere, "_check", lambda self, *given: (looked.append(1), check(self, *given)))
    for block in blocks:
        calls.branch(block)
        if block.text == "CALLED":
            calls.call(block)
        elif block.words:
            calls.move(block)
    calls.end_program()
    assert len(looked) <= 2 * N
    assert [line for line, _ in calls.uncertain_moves()] == list(range(3, 3 * N + 1, 3))


def test_a_routine_of_many_triggers_is_looked_at_once(monkeypatch):
    trigger = "TRIGGER WHEN DISTANCE=0 DELAY=0 DO A() PRIO=-1\n"
    statements = list(krl.parse(f"DEF R()\n{trigger * N}END\nDEF A()\n{BODY * N}END\n"))
    looked, changes = [], FrameChanges._changes
    monkeypatch.setattr(FrameChanges, "_changes", lambda self, s: looked.append(1) or changes(self, s))
    found = FrameChanges(statements)
    assert all(found.is_harmless("A") for _ in range(N))
    assert len(looked) <= 3 * len(statements)


def test_a_routine_whose_interrupt_runs_itself_is_read():
    text = "DEF R()\nINTERRUPT DECL 3 WHEN $IN[1] DO R()\nPTP {A1 1,A2 -90,A3 90,A4 0,A5 10,A6 0}\nEND\n"
    statements = list(krl.parse(text))
    assert FrameChanges(statements).doubt_interrupt(statements[1]) == ""


def test_more_targets_than_are_kept_at_once_are_refused_with_the_cure():
    read = reading()
    read._found = [None] * 50_000
    with pytest.raises(InputError, match=r"more than 50000 targets.*split the file"):
        read.add(Target(1, (), q=np.zeros(6)))
