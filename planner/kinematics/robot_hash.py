"""The hash of a robot: of what its files say, whatever editors and version control do to their bytes."""

import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from planner.common.content_hashes import HASHES, HandEdit, canonical_hash, changed_parts, part_hashes
from planner.common.files import has_hash, read_bytes, read_utf8
from planner.common.schema import read_toml_content
from planner.common.xml_files import parse_xml
from planner.kinematics.robot import Robot
from planner.kinematics.urdf import parse_urdf

UNMOVING = ("title", "sources", "never_meet_reason", "simulated", "not_for_use")  # said of a robot; none moves it
BESIDE = ("controllers", "dialect")  # how controllers count: their angles are brought to the model's and back
NOT_COUNTED = (*UNMOVING, *BESIDE)
FREE = ("title", "sources", "never_meet_reason", "packages", *BESIDE)  # what a person may change in a calibrated robot


def robot_hash(robot: Robot) -> str:
    """Return the SHA-256, hexadecimal, of what the ``robot.toml`` of a robot says, and of the URDF that it names.

    The same robot has the same hash: comments, line ends, the order of keys, the spelling of numbers (1 and 1.0), what
    only names or explains (:data:`UNMOVING`) and how controllers count its axes (:data:`BESIDE`) do not count. One
    digit of a number makes another robot.

    Raises:
        InputError: the files can no longer be read.
    """
    content = read_toml_content(robot.path)
    said = _drop_keys(content)
    if robot.convention == "urdf":
        said["urdf"] = _element(parse_urdf(robot.path.parent / str(content["urdf"]), robot.packages))
    return canonical_hash(said)


def model_text_hash(robot_toml: str) -> str:
    """Return the SHA-256, hexadecimal, of what the text of a ``robot.toml`` says, without the files that it names.

    What counts is as in :func:`robot_hash`.
    """
    return canonical_hash(_drop_keys(tomllib.loads(robot_toml)))


def is_model_of(robot_file: Path, digest: str) -> bool:
    """Tell whether a ``robot.toml`` is the one with this :func:`model_text_hash`, or has these bytes (older files).

    Raises:
        InputError: it cannot be read.
    """
    said = _drop_keys(read_toml_content(robot_file))
    return digest == canonical_hash(said) or has_hash(read_bytes(robot_file), digest)


def _drop_keys(content: Mapping[str, object]) -> dict[str, object]:
    return {key: value for key, value in content.items() if key not in (*NOT_COUNTED, HASHES)}


def robot_hashes(content: Mapping[str, object], texts: Mapping[str, str]) -> dict[str, str]:
    """Return the hashes that a written ``robot.toml`` bears: of its keys, and of the files that it names.

    Args:
        content: of the file.
        texts: of ``robot.urdf`` and the like, by name.
    """
    beside = {name: _file_content(name, text.encode()) for name, text in texts.items() if name in _named_files(content)}
    return part_hashes({**content, **beside}, FREE)


def with_hand_edits(robot: Robot) -> Robot:
    """Return a robot with what a person changed in its ``robot.toml`` or URDF since edbb wrote them, if it did.

    Raises:
        InputError: a file that it names cannot be read.
    """
    path = robot.path
    content = read_toml_content(path) if path.suffix == ".toml" else {}
    written = content.get(HASHES)
    if not isinstance(written, Mapping):
        return robot
    beside = {
        name: _element(parse_urdf(path.parent / name, robot.packages))
        if name == content.get("urdf")
        else read_utf8(path.parent / name).split()
        for name in _named_files(content)
        if name in written
    }
    parts = changed_parts(written, part_hashes({**content, **beside}, FREE))
    return replace(robot, hand_edits=(HandEdit(path, parts),)) if parts else robot


def renew_hashes(
    content: Mapping[str, object], texts: Mapping[str, str], edits: Sequence[HandEdit]
) -> dict[str, object]:
    """Return a ``robot.toml`` that is copied with other names of files, and hashes that fit what was not edited.

    Args:
        content: of the copy, with the hashes of the original.
        texts: of the files that it names, by name.
        edits: of the original; what was changed there stays so in the copy.
    """
    written = content.get(HASHES)
    if not isinstance(written, Mapping):
        return dict(content)
    changed = {part for edit in edits for part in edit.parts}
    hashes = {part: h for part, h in robot_hashes(content, texts).items() if part not in changed}
    return {**content, HASHES: hashes | {part: h for part, h in written.items() if part in changed}}


def _named_files(content: Mapping[str, object]) -> list[str]:
    return [str(content[key]) for key in ("urdf", "srdf") if key in content]


def _file_content(name: str, data: bytes) -> object:
    return _element(parse_xml(data)) if Path(name).suffix == ".urdf" else data.decode().split()


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
