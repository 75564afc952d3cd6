"""The tree of links and joints that a URDF describes, with what makes it none told by name."""

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from pathlib import Path

from planner.common.errors import InputError, did_you_mean
from planner.common.xml_files import line_of


class UrdfError(Exception):
    """What is wrong with an element, and the line on which that begins, 0 where it is not known."""

    def __init__(self, message: str, element: ET.Element | None = None) -> None:
        super().__init__(message)
        self.line = 0 if element is None else line_of(element)


def find_child(element: ET.Element, tag: str) -> ET.Element:
    """Return the element ``tag`` inside another.

    Raises:
        UrdfError: there is none.
    """
    found = element.find(tag)
    if found is None:
        raise UrdfError(f"<{element.tag} name='{element.get('name')}'> has no <{tag}>")
    return found


BODY = ("visual", "collision", "inertial")  # what makes a link more than the name of a frame


def find_bodily_links(root: ET.Element) -> frozenset[str]:
    """Return the links that can touch something: they have a shape or a mass, or a joint moves them.

    A link without any of these, fixed to another, is the name of a frame.
    """
    moved = {link_of(j, "child") for j in root.findall("joint") if j.get("type") != "fixed"}
    named = ((str(link.get("name")), link) for link in root.findall("link"))
    return frozenset(name for name, link in named if name in moved or any(link.find(tag) is not None for tag in BODY))


def read_tree(
    path: Path, root: ET.Element, tip: str | None, base: str | None = None
) -> tuple[dict[str, ET.Element], list[ET.Element], str]:
    """Return the links by name, the joints from ``base`` (default: the root) to ``tip`` (default: the only leaf).

    The last of the three is the name of the base's link.

    Raises:
        UrdfError: a name twice, a link below two joints, a ring of links, a joint to a link that is not there.
        InputError: no such link, several leaves, or a tip that does not hang on the base.
    """
    links = _by_name("two links are called", ((str(e.get("name")), e) for e in root.findall("link")))
    joints = _by_name("two joints are called", ((str(e.get("name")), e) for e in root.findall("joint")))
    _check_rings({link_of(j, "child"): link_of(j, "parent") for j in joints.values()})
    above = _by_name("two joints have the child", ((link_of(j, "child"), j) for j in joints.values()))
    tip = tip or _only_leaf(path, links, above)
    for end in (e for e in (tip, base) if e is not None and e not in links):
        raise InputError(
            f"{path}: no link is called '{end}'{did_you_mean(end, list(links))} (links: {', '.join(links)})"
        )
    chain: list[ET.Element] = []
    link = tip
    while link in above and link != base:
        chain.append(above[link])
        link = link_of(above[link], "parent")
    chain.reverse()
    if base not in (None, link):
        way = [link, *(link_of(joint, "child") for joint in chain)]
        raise InputError(
            f"{path}: the base is to be '{base}', but the link '{tip}' hangs on {' > '.join(way[:-1])}: give one "
            "of these as the base, and hold what does not move by [parked]"
        )
    names = [link, *(link_of(joint, "child") for joint in chain)]
    if gone := [name for name in names if name not in links]:
        raise UrdfError(f"a joint names the link '{gone[0]}', which is not there")
    return links, chain, link


def link_of(joint: ET.Element, end: str) -> str:
    """Return the name of the link at an end of a joint, ``parent`` or ``child``."""
    return str(find_child(joint, end).get("link"))


def rigid_groups(links: Iterable[str], joints: Iterable[ET.Element]) -> dict[str, str]:
    """Return for each link the first of those that fixed joints make one with it."""
    out = {name: name for name in links}
    for joint in joints:
        if joint.get("type") == "fixed":
            one, other = (out.get(link_of(joint, end)) for end in ("parent", "child"))
            if one is not None and other is not None:
                out = {name: one if group == other else group for name, group in out.items()}
    return out


def _by_name(fault: str, named: Iterable[tuple[str, ET.Element]]) -> dict[str, ET.Element]:
    out: dict[str, ET.Element] = {}
    for name, element in named:
        if name in out:
            raise UrdfError(f"{fault} '{name}'")
        out[name] = element
    return out


def _check_rings(parent: Mapping[str, str]) -> None:
    """Refuse links of which one hangs, by others, from itself."""
    sound: set[str] = set()
    for start in parent:
        way: dict[str, None] = {}
        link = start
        while link in parent and link not in sound:
            if link in way:
                ring = list(way)[list(way).index(link) :]
                raise UrdfError(f"the links {' < '.join([*ring, link])} form a ring: each is the child of the next")
            way[link] = None
            link = parent[link]
        sound.update(way)


def _only_leaf(path: Path, links: Mapping[str, ET.Element], above: Mapping[str, ET.Element]) -> str:
    parents = {link_of(j, "parent") for j in above.values()}
    leaves = [name for name in links if name not in parents]
    if len(leaves) != 1:
        raise InputError(f'{path}: the chain ends in several links ({", ".join(leaves)}): give tip = "link name"')
    return leaves[0]
