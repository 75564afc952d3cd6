"""One cell for a test: the world, its devices, a plan file, short time-outs."""

import json
from contextlib import ExitStack

import pytest

from planner.centring.indicators import open_indicators
from planner.centring.robot_link import open_link
from planner.centring.session import CentringBench, NoCentringAdvice, open_session, run_session
from planner.centring.settings import (
    CentringSettings,
    HeadSettings,
    MoveSettings,
    RestSettings,
    RobotSettings,
    find_protocol,
)
from planner.centring.stop import StopRequest
from planner.kinematics.robot_reader import load_robot
from tests.centring.devices import Controller, indicator
from tests.centring.world import World
from tests.centring.world import plan as plan_of

OFFSETS = {1: (3.0, -2.0, 1.5), 3: (-2.8, 2.9, -2.9), 5: (0.4, 0.02, -0.7), 7: (2.0, 2.0, 2.0)}


def settings(head=None, rest=None, moves=None, robot=None):
    return CentringSettings(
        # 2 s: an indicator of a busy machine still answers; who tests that one says nothing asks for less
        head=HeadSettings(**({"timeout_s": 2.0} | (head or {}))),
        rest=RestSettings(**({"settle_s": 0.0} | (rest or {}))),
        moves=MoveSettings(**(moves or {})),
        robot=RobotSettings(**({"answer_s": 1.0, "poll_s": 0.002, "move_s": 5.0} | (robot or {}))),
    )


KUKA = load_robot("kuka-kr6-r700").axes_of("krl")


def _as_joints(content, axes):
    """A plan of KUKA's angles as one of a model that counts its joints otherwise."""
    if isinstance(content, list):
        return [_as_joints(each, axes) for each in content]
    if not isinstance(content, dict):
        return content
    return {
        key: list(axes.degrees_to_model(value)) if key == "q_deg" else _as_joints(value, axes)
        for key, value in content.items()
    }


class Cell:
    """A world with its devices; ``run()`` is one session."""

    def __init__(self, folder, stack, count=3, lose=0.0, faults=None, plan_id="0123456789ab", axes=None, **world):
        self.axes = axes or KUKA
        self.content = plan_of(count, plan_id)
        self.plan, self.output = folder / "plan.json", folder / "run.csv"
        self.plan.write_text(json.dumps(_as_joints(self.content, self.axes)))
        self.world = World(self.content, OFFSETS, **world)
        self.stack = stack
        self.terminals = [indicator(self.world, k, lose=lose, seed=k) for k in range(3)]
        self.ports = [t.port for t in self.terminals]
        self.controller = Controller(self.world, **(faults or {}))
        self.stop, self.said, self.adviser = StopRequest(), [], NoCentringAdvice()
        for device in (*self.terminals, self.controller):
            stack.callback(device.close)

    def revive(self, **faults):
        """A new controller for the same arm."""
        self.controller.close()
        self.controller = Controller(self.world, **faults)
        self.stack.callback(self.controller.close)
        self.stop = StopRequest()

    def run(self, how=None, follow=False):
        how = how or settings()
        with ExitStack() as opened:
            session = open_session(self.plan, self.output)
            head = open_indicators(self.ports, find_protocol(how.head.protocol), how.head, self.stop)
            opened.callback(head.close)
            link = open_link(self.controller.address, self.axes, how.robot, self.stop, follow)
            opened.callback(link.close)
            bench = CentringBench(head, link, how, self.stop, self.said.append, adviser=self.adviser)
            run_session(session, bench, follow)
        return session


@pytest.fixture
def cell(tmp_path):
    with ExitStack() as stack:
        yield lambda **how: Cell(tmp_path, stack, **how)
