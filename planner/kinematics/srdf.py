"""Which links an SRDF allows to touch."""

from itertools import product
from pathlib import Path

from planner.common.errors import InputError
from planner.common.files import MOST_TOML, read_bytes
from planner.common.xml_files import XmlError, parse_xml
from planner.kinematics.urdf import UrdfChain

NEXT_BUT_ONE = 2  # links apart


def read_allowed_pairs(path: Path, chain: UrdfChain) -> tuple[tuple[int, int], ...]:
    """Return the pairs of links next but one to each other whose bodies the SRDF at ``path`` allows to touch.

    Fixed joints make one link of several: all their pairs with bodies must be allowed. Pairs further apart stay
    checked, since what keeps them from touching are samples of whoever wrote the file, and a check costs little.

    Raises:
        InputError: no XML, or a pair without names.
    """
    try:
        root = parse_xml(read_bytes(path, MOST_TOML))
    except (XmlError, ValueError, LookupError) as err:
        raise InputError(f"{path}: cannot be read as SRDF ({err})") from err
    allowed = set[frozenset[str | None]]()
    for element in root.findall("disable_collisions"):
        names = element.get("link1"), element.get("link2")
        if None in names:
            raise InputError(f"{path}: <disable_collisions> needs link1 and link2")
        allowed.add(frozenset(names))
    embodied = {name for name, _ in chain.links if any(_is_of(body.name, name) for _, body in chain.bodies)}
    parts = [
        [name for name, k in chain.links if k == link and name in embodied] for link in range(len(chain.joints) + 1)
    ]
    return tuple(
        (k, k + NEXT_BUT_ONE)
        for k in range(len(parts) - NEXT_BUT_ONE)
        if parts[k]
        and parts[k + NEXT_BUT_ONE]
        and all(frozenset(pair) in allowed for pair in product(parts[k], parts[k + NEXT_BUT_ONE]))
    )


def _is_of(body: str, link: str) -> bool:
    """Tell whether a body belongs to a link: it has its name, counted on where there are several."""
    return body == link or body.removeprefix(f"{link}_").isdigit()
