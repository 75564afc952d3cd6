"""The robot's side: the KRL keeps the controller's rules and does what the planner's side relies on."""

import re
import time

import numpy as np
import pytest

from planner.centring.robot_link import centring_program
from planner.centring.settings import RobotSettings
from tests.centring.krl import Program, declared


@pytest.fixture(scope="module")
def files():
    return centring_program(RobotSettings(tool=3, speed_mm_s=8.0, silence_s=2.5))


def test_form(files):
    assert sorted(files) == ["EDBB_CENTRE.dat", "EDBB_CENTRE.src"]
    for text in files.values():
        assert text.encode("ascii").count(b"\n") == text.count("\r\n")
        assert max(map(len, text.splitlines())) <= 250
    src = files["EDBB_CENTRE.src"]
    code = [line for line in src.splitlines() if not line.startswith((";", "&"))]
    code = [line.removeprefix("GLOBAL ") for line in code]
    for opening, closing in (("DEF ", "END"), ("LOOP", "ENDLOOP"), ("IF ", "ENDIF"), ("SWITCH", "ENDSWITCH")):
        assert sum(line.startswith(opening) for line in code) == code.count(closing) > 0
    assert "$VEL.CP=0.0080" in code
    assert "$TIMER[10]=-2500" in code


def test_every_name_is_declared_and_short_enough(files):
    parts = re.findall(r"^(?:GLOBAL )?DEF (\w+)", files["EDBB_CENTRE.src"], re.MULTILINE)
    known = set(declared(files["EDBB_CENTRE.dat"])) | set(parts)
    code = "\n".join(line for line in files["EDBB_CENTRE.src"].splitlines() if not line.startswith(";"))
    used = set(re.findall(r"EDBB_\w+", code))
    assert used <= known
    assert max(map(len, known)) <= 24


class Arm:
    """Takes ten steps for a move and notes how many it was let."""

    def __init__(self):
        self.steps, self.at = 0, lambda step: None

    def ptp(self, axes):
        for step in range(10):
            self.at(step)
            self.steps += 1
            yield

    lin_rel = ptp


def carried(files, order, at=lambda program, step: None, **values):
    """The program after one order: how it ended, and how far the arm came."""
    arm = Arm()
    program = Program(files["EDBB_CENTRE.src"], files["EDBB_CENTRE.dat"], arm)
    program.values |= {"EDBB_KIND": order} | values
    arm.at = lambda step: at(program, step)
    sleep = iter(range(10**6))

    def assign(name, value, before=program._assign):
        before(name, value)
        if name == "EDBB_BEAT":
            beat = next(sleep)
            if beat == 1:
                program.values["EDBB_GO"] = 5
            program.alive = beat < 4

    program._assign = assign
    program.run()
    assert program.values["EDBB_DONE"] == 5
    assert program.on == {}
    assert program.local == [{}]
    return program.values["EDBB_STATE"], arm.steps


def test_orders_are_carried_out(files):
    assert carried(files, 1) == (0, 10)
    assert carried(files, 2, EDBB_BY={"X": 1.0, "Y": -5.0, "Z": 0.003}) == (0, 10)


def test_what_it_does_not_know_or_is_too_far_is_refused(files):
    assert carried(files, 4) == (3, 0)
    for far in ({"X": 5.1, "Y": 0.0, "Z": 0.0}, {"X": 0.0, "Y": -5.1, "Z": 0.0}, {"X": 0.0, "Y": 0.0, "Z": 9.0}):
        assert carried(files, 2, EDBB_BY=far) == (3, 0)


def test_a_stop_ends_the_move_it_falls_into(files):
    def stop(program, step):
        program.values["EDBB_STOP"] = step >= 4

    assert carried(files, 1, stop) == (2, 5)


def test_nothing_moves_while_a_stop_stands(files):
    assert carried(files, 1, EDBB_STOP=True) == (2, 0)


def test_silence_ends_the_move(files):
    def silent(program, step):
        if step == 6:
            program.timer = time.monotonic() - 1e-3

    state, steps = carried(files, 1, silent)
    assert (state, steps) == (4, 7)


def test_orders_from_before_are_not_done(files):
    arm = Arm()
    program = Program(files["EDBB_CENTRE.src"], files["EDBB_CENTRE.dat"], arm)
    program.values |= {"EDBB_GO": 9, "EDBB_KIND": 1}
    beats = []

    def assign(name, value, before=program._assign):
        before(name, value)
        beats.append(name)
        program.alive = beats.count("EDBB_BEAT") < 3

    program._assign = assign
    program.run()
    assert arm.steps == 0
    assert np.equal(program.values["EDBB_DONE"], 9)
