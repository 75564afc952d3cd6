"""The hash of a robot: of what its files say, whatever editors and version control do to their bytes."""

import json
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from hashlib import sha256

from planner.common.schema import read_toml_content
from planner.kinematics.robot import Robot
from planner.kinematics.urdf import parse_urdf

UNMOVING = ("title", "sources", "never_meet_reason", "simulated")  # said of a robot; none moves it


def robot_hash(robot: Robot) -> str:
    """Return the SHA-256, hexadecimal, of what the ``robot.toml`` of a robot says, and of the URDF that it names.

    The same robot has the same hash: comments, line ends, the order of keys, the spelling of numbers (1 and 1.0) and
    what only names or explains (:data:`UNMOVING`) do not count. One digit of a number makes another robot.

    Raises:
        InputError: the files can no longer be read.
    """
    content = read_toml_content(robot.path)
    said: dict[str, object] = {key: value for key, value in content.items() if key not in UNMOVING}
    if robot.convention == "urdf":
        said["urdf"] = _element(parse_urdf(robot.path.parent / str(content["urdf"]), robot.packages))
    return sha256(json.dumps(_plain(said), sort_keys=True).encode()).hexdigest()


def _plain(value: object) -> object:
    """Return a value of TOML with all numbers as floats, which have one spelling."""
    match value:
        case Mapping():
            return {str(key): _plain(v) for key, v in value.items()}
        case list() | tuple():
            return [_plain(v) for v in value]
        case bool() | str():
            return value
        case int() | float():
            return float(value) + 0.0  # -0.0 becomes 0.0
        case _:
            return str(value)


def _element(element: ET.Element) -> list[object]:
    """Return an element of XML: name, attributes, text and elements in it; blanks between them say nothing."""
    attributes = {key: _words(value) for key, value in element.attrib.items()}
    return [element.tag, attributes, _words(element.text or ""), [_element(e) for e in element]]


def _words(text: str) -> list[object]:
    """Return the words of a text, numbers as numbers."""
    return [_number(word) for word in text.split()]


def _number(word: str) -> object:
    try:
        return float(word) + 0.0
    except ValueError:
        return word
