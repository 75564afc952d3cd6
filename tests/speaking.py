"""Robots for tests of every language: their files say of all controllers that they count as the joints do."""

from dataclasses import replace

import tests.programs.sessions as sessions
from planner.kinematics.axes import AxisConvention
from planner.kinematics.robot import Robot
from planner.programs.dialect import dialects

CONTROLLERS = [d.name for d in dialects() if d.angles == "controller"]


def speaking_all(robot):
    """The robot with a convention for every language, that of the joints where its own file states none."""
    own = {c.controller for c in robot.conventions}
    plain = AxisConvention.model_convention("", robot.q_lower, robot.q_upper, robot.speed, "drawn for a test")
    drawn = replace(plain, pulses_per_deg=sessions.PULSES[: robot.n_joints])
    added = (replace(drawn, controller=name) for name in CONTROLLERS if name not in own)
    return replace(robot, conventions=(*robot.conventions, *added))


def let_speak_all(monkeypatch):
    """Let every robot that is loaded in this process speak every language."""
    own = Robot.axes_of

    def axes_of(robot, controller):
        return own(robot if controller not in CONTROLLERS else speaking_all(robot), controller)

    monkeypatch.setattr(Robot, "axes_of", axes_of)
