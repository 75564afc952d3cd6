"""Is the file a program of another robot: by what its comments say, and by what the nominal robot reaches."""

import re
from collections.abc import Iterator, Sequence

import numpy as np

from planner.common.errors import InputError
from planner.common.units import DEG, Array
from planner.compensation.nominal_angles import UNREACHED
from planner.compensation.targets import Note, Target
from planner.kinematics.robot import Robot
from planner.programs.languages.text import Lines

HEAD = 60  # lines in which a program says what it is
BEYOND = 0.5 * DEG  # a taught angle may stand a little over a limit
_OWN = re.compile(r"\brobot:\s*(?P<name>[^\r\n)]*)")
_MODEL = re.compile(r"\b(?:KR[ _-]?\d{1,4}(?:[ _-]?R\d{3,4})?|IRB[ _-]?\d{3,5}|NJ[ _-]?\d{2,3}|UR\d{1,2}e?)(?!\w)")


def foreign_robot_notes(name: str, text: str, robot: Robot) -> Iterator[Note]:
    """Yield the lines of the head that name another robot.

    Raises:
        InputError: a program of this planner names another robot.
    """
    own = "plan_id:" in text
    for line, _, said in list(Lines.of(text))[:HEAD]:
        match = _OWN.search(said)
        if own and match and not _same(match["name"], robot):
            raise InputError(
                f"{name}:{line}: the program is for the robot '{match['name'].strip()}', the model is of "
                f"'{robot.title}' ({robot.name})"
            )
        for model in _MODEL.findall(said):
            if not _same(model, robot):
                yield line, f"{model} is named here, the model is of {robot.title}: is it a program of another robot?"


def _same(said: str, robot: Robot) -> bool:
    """Return whether ``said`` is the robot's name, or a part of it that ends where a number ends."""
    short = re.sub(r"[^A-Z0-9]", "", said.upper())
    names = (re.sub(r"[^A-Z0-9]", "", name.upper()) for name in (robot.name, robot.title))
    return bool(short) and any(re.search(rf"{short}(?!\d)", name) for name in names)


def check_reach(name: str, robot: Robot, targets: Sequence[Target], q: Array, problems: Sequence[Note]) -> str:
    """Return what is to be said of a file most of whose targets the nominal robot does not reach, or nothing."""
    lines = {line for line, why in problems if UNREACHED in why or "are allowed" in why}
    for target, angles in zip(targets, q, strict=True):
        if target.q is not None and (np.maximum(robot.q_lower - angles, angles - robot.q_upper) > BEYOND).any():
            lines.add(target.line)
    if len(lines) < 2 or 2 * len(lines) <= len({t.line for t in targets}):
        return ""
    return (
        f"{name}: {len(lines)} of {len({t.line for t in targets})} targets are out of reach of {robot.title}: is it a "
        "program of another robot, or are tool and base not the program's own (--tool, --base, --frames)?"
    )
