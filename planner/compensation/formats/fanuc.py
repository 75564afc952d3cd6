"""FANUC TP as ASCII (.LS): positions that are taught in joint angles."""

import re

from planner.compensation.targets import TargetReading
from planner.programs.dialect import Dialect
from planner.programs.languages.statements import placed_numbers
from planner.programs.languages.text import NUMBER, Lines

_POSITION = re.compile(r"^P\[(?P<number>\d+)(?::[^\]]*)?\]\s*\{(?P<body>[^}]*)\}", re.MULTILINE)
_ANGLE = re.compile(rf"\b[JE]\d\s*=\s*(?P<value>{NUMBER})\s*deg")


def read(text: str, _dialect: Dialect, reading: TargetReading) -> None:
    """Note the joint targets of one program; Cartesian positions are told and left."""
    lines = Lines.of(text)
    for position in _POSITION.finditer(text, max(text.find("/POS"), 0)):
        line, body = lines.number(position.start()), position["body"]
        angles = list(_ANGLE.finditer(body))
        if re.search(r"\bCONFIG\b", body):
            reading.leave(line, f"P[{position['number']}] is Cartesian; positions in joint angles are corrected")
        elif len(angles) != reading.robot.n_joints or body.count("GP") > 1:
            found = f"P[{position['number']}] has {len(angles)} joint angles in {body.count('GP')} group(s)"
            reading.leave(line, f"{found}, the robot has {reading.robot.n_joints} joints in one")
        else:
            starts = (position.start("body") + a.start("value") for a in angles)
            numbers = [placed_numbers(a["value"], s, NUMBER)[0] for a, s in zip(angles, starts, strict=True)]
            reading.add_joints(line, numbers)
