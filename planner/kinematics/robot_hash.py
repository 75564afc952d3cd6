"""The hash of a robot: of what its files say, whatever editors and version control do to their bytes."""

import json
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path

from planner.common.files import has_hash, read_bytes
from planner.common.schema import read_toml_content
from planner.kinematics.robot import Robot
from planner.kinematics.urdf import parse_urdf

UNMOVING = ("title", "sources", "never_meet_reason", "simulated", "not_for_use")  # said of a robot; none moves it
BESIDE = ("controllers", "dialect")  # how controllers count: their angles are brought to the model's and back
NOT_COUNTED = (*UNMOVING, *BESIDE)


def robot_hash(robot: Robot) -> str:
    """Return the SHA-256, hexadecimal, of what the ``robot.toml`` of a robot says, and of the URDF that it names.

    The same robot has the same hash: comments, line ends, the order of keys, the spelling of numbers (1 and 1.0), what
    only names or explains (:data:`UNMOVING`) and how controllers count its axes (:data:`BESIDE`) do not count. One
    digit of a number makes another robot.

    Raises:
        InputError: the files can no longer be read.
    """
    return _hash_without(robot, NOT_COUNTED)


def former_robot_hash(robot: Robot) -> str:
    """Return the hash of earlier versions, for which the axes of controllers counted, as :func:`robot_hash`."""
    return _hash_without(robot, UNMOVING)


def model_text_hash(robot_toml: str) -> str:
    """Return the SHA-256, hexadecimal, of what the text of a ``robot.toml`` says, without the files that it names.

    What counts is as in :func:`robot_hash`.
    """
    return _hash_of(_drop_keys(tomllib.loads(robot_toml), NOT_COUNTED))


def is_model_of(robot_file: Path, digest: str) -> bool:
    """Tell whether a ``robot.toml`` is the one with this :func:`model_text_hash`, or has these bytes (older files).

    Raises:
        InputError: it cannot be read.
    """
    said = _drop_keys(read_toml_content(robot_file), NOT_COUNTED)
    return digest == _hash_of(said) or has_hash(read_bytes(robot_file), digest)


def _drop_keys(content: Mapping[str, object], keys: tuple[str, ...]) -> dict[str, object]:
    return {key: value for key, value in content.items() if key not in keys}


def _hash_of(said: Mapping[str, object]) -> str:
    return sha256(json.dumps(_with_floats(said), sort_keys=True).encode()).hexdigest()


def _hash_without(robot: Robot, keys: tuple[str, ...]) -> str:
    content = read_toml_content(robot.path)
    said = _drop_keys(content, keys)
    if robot.convention == "urdf":
        said["urdf"] = _element(parse_urdf(robot.path.parent / str(content["urdf"]), robot.packages))
    return _hash_of(said)


def _with_floats(value: object) -> object:
    """Return a value of TOML with all numbers as floats, which have one spelling."""
    match value:
        case Mapping():
            return {str(key): _with_floats(v) for key, v in value.items()}
        case list() | tuple():
            return [_with_floats(v) for v in value]
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
