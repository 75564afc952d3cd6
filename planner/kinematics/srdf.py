"""Which links an SRDF allows to touch."""

from collections.abc import Iterable
from itertools import product
from pathlib import Path

from planner.common.errors import InputError
from planner.common.files import MOST_TOML, read_bytes
from planner.common.xml_files import XmlError, parse_xml
from planner.kinematics.robot_file import NEXT_BUT_ONE


def read_allowed_pairs(path: Path) -> tuple[tuple[str, str, str], ...]:
    """Return the pairs of links that the SRDF at ``path`` leaves out of every check: both names, and the reason.

    Raises:
        InputError: no XML, or a pair without names.
    """
    try:
        root = parse_xml(read_bytes(path, MOST_TOML))
    except (XmlError, ValueError, LookupError) as err:
        raise InputError(f"{path}: cannot be read as SRDF ({err})") from err
    allowed = dict[tuple[str, str], str]()
    for element in root.findall("disable_collisions"):
        one, other = element.get("link1"), element.get("link2")
        if one is None or other is None:
            raise InputError(f"{path}: <disable_collisions> needs link1 and link2")
        allowed[min(one, other), max(one, other)] = element.get("reason") or "no reason is stated"
    return tuple((one, other, f"{path.name}: {reason}") for (one, other), reason in sorted(allowed.items()))


def numbered_pairs(
    allowed: Iterable[tuple[str, str, str]], links: Iterable[tuple[str, int]]
) -> tuple[tuple[int, int], ...]:
    """Return the pairs of numbered links next but one to each other of which all named ``links`` are ``allowed``.

    Fixed joints make one link of several, and shapes that ``robot.toml`` gives to it stand for all of them.
    """
    pairs, of_number = {frozenset((a, b)) for a, b, _ in allowed}, dict[int, list[str]]()
    for name, k in links:
        of_number.setdefault(k, []).append(name)
    return tuple(
        (k, k + NEXT_BUT_ONE)
        for k in sorted(of_number)
        if k + NEXT_BUT_ONE in of_number
        and all(frozenset(p) in pairs for p in product(of_number[k], of_number[k + NEXT_BUT_ONE]))
    )
