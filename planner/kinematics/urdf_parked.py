"""Joints of a URDF that stand still, and the links that hang on them: fingers, second arms, heads, columns.

Such a link moves with the link of the arm that it branches off, so its shapes are bodies of that link.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from planner.common.errors import did_you_mean
from planner.common.units import MM, Array, from_deg
from planner.kinematics.bodies import Body
from planner.kinematics.geometry import pose
from planner.kinematics.robot import ParkedJoint
from planner.kinematics.urdf_elements import (
    MeshFinder,
    number,
    pose_matrix,
    read_bodies,
    read_numbers,
    read_origin,
    read_stroke,
)
from planner.kinematics.urdf_tree import UrdfError, link_of

UNITS = {"revolute": "deg", "continuous": "deg", "prismatic": "mm"}  # of the joints that can be parked
UNIT_ROUNDING = 1e-9  # [rad, m] beyond a limit that comes of the conversion of units


@dataclass(frozen=True)
class Parking:
    """Where the joints stand that are not driven.

    Attributes:
        joints: with their values, those that another one moves (``<mimic>``) too.
        followers: joints that a driven joint moves, with the name of that one: they stand nowhere.
    """

    joints: tuple[ParkedJoint, ...] = ()
    followers: Mapping[str, str] = field(default_factory=dict)

    def motion(self, joint: ET.Element) -> Array:
        """Return the motion (4, 4) [m] of a joint from its origin to where it stands."""
        stands = {j.name: j.value for j in self.joints}
        value, kind = stands.get(str(joint.get("name")), 0.0), joint.get("type")
        if kind not in UNITS or value == 0.0:
            return np.eye(4)
        axis = np.array(read_numbers(joint.find("axis"), "xyz", (1, 0, 0)))
        if not np.linalg.norm(axis) > UNIT_ROUNDING:
            raise UrdfError(f"the axis of joint '{joint.get('name')}' has no length")
        axis = axis / np.linalg.norm(axis) * value
        if UNITS[str(kind)] == "mm":
            return pose(np.eye(3), axis)
        return pose(Rotation.from_rotvec(axis).as_matrix(), np.zeros(3))


def park_joints(joints: Sequence[ET.Element], chain: Sequence[ET.Element], said: Mapping[str, float]) -> Parking:
    """Return where all joints stand that the arm does not drive.

    Args:
        joints: all of the URDF; ``chain`` those from the base to the tip.
        said: the table ``[parked]``: values by the joint's name with its unit (``finger_mm``, ``head_deg``). A joint
            of the chain that stands there is not driven either.

    Raises:
        UrdfError: a key names no such joint, or one that another moves; a value beyond the joint's limits.
    """
    movable = {str(j.get("name")): j for j in joints if j.get("type") in UNITS}
    keys = {parked_key(j): name for name, j in movable.items()}
    for key in said:
        if key not in keys:
            stem = key.removesuffix("_deg").removesuffix("_mm")
            near = parked_key(movable[stem]) if stem in movable else key
            raise UrdfError(
                f"parked.{key} names no joint of the URDF with its unit{did_you_mean(near, list(keys))} "
                f"(there are: {', '.join(keys)})"
            )
        if (leader := movable[keys[key]].find("mimic")) is not None:
            raise UrdfError(f"parked.{key}: this joint is moved by '{leader.get('joint')}': say where that one stands")
    given = {keys[key]: _in_si(key, value) for key, value in said.items()}
    driven = {
        name for name in (str(j.get("name")) for j in chain)
        if name in movable and name not in given and movable[name].find("mimic") is None
    }  # fmt: skip
    parked, followers = list[ParkedJoint](), dict[str, str]()
    for name, joint in movable.items():
        if name in driven:
            continue
        found = _stand(movable, driven, given, name)
        if isinstance(found, str):
            followers[name] = found
        else:
            parked.append(replace(found, of_chain=any(joint is j for j in chain)))
    return Parking(tuple(parked), followers)


def parked_key(joint: ET.Element) -> str:
    """Return the key of a joint in the table ``[parked]``: its name with its unit."""
    return f"{joint.get('name')}_{UNITS[str(joint.get('type'))]}"


def _in_si(key: str, value: float) -> float:
    return value * MM if key.endswith("_mm") else float(from_deg(value))


def _stand(
    movable: Mapping[str, ET.Element], driven: set[str], given: Mapping[str, float], name: str
) -> ParkedJoint | str:
    """Return where a joint stands, or the driven joint that moves it."""
    factor, offset, leader = 1.0, 0.0, name
    passed = [name]
    while (mimic := movable[leader].find("mimic")) is not None:
        offset += factor * number(mimic, "offset")
        factor *= number(mimic, "multiplier") if mimic.get("multiplier") is not None else 1.0
        leader = str(mimic.get("joint"))
        if leader not in movable:
            raise UrdfError(f"joint '{passed[-1]}' is moved by '{leader}' (<mimic>), which is no joint that moves")
        if leader in passed:
            raise UrdfError(f"joints that move each other by <mimic>: {' < '.join([*passed, leader])}")
        passed.append(leader)
    if leader in driven:
        return leader
    value, why = _stand_of_leader(movable[leader], given.get(leader))
    unit = UNITS[str(movable[name].get("type"))]
    if leader != name:
        return ParkedJoint(name, factor * value + offset, unit, f"moved by {leader}", follows=True)
    return ParkedJoint(name, value, unit, why)


def _stand_of_leader(joint: ET.Element, given: float | None) -> tuple[float, str]:
    endless = 1e9  # [rad, m] limits of joints that have none, as files write them: 999999
    lower, upper = read_stroke(joint, endless)
    if not lower < upper:  # limits that bound nothing
        lower, upper = -np.inf, np.inf
    if given is None:
        return (0.0, "") if lower <= 0.0 <= upper else ((lower + upper) / 2, "the middle of its stroke")
    if not lower - UNIT_ROUNDING <= given <= upper + UNIT_ROUNDING:
        shown = ParkedJoint("", given, UNITS[str(joint.get("type"))])
        ends = [replace(shown, value=v).text for v in (lower, upper)]
        raise UrdfError(f"parked.{parked_key(joint)}: {shown.text} lies beyond its limits, {ends[0]} to {ends[1]}")
    return given, ""


@dataclass(frozen=True)
class Branches:
    """What hangs on the chain: ``bodies`` with the number of the link that carries each, and what nobody can check.

    ``links`` are the names of all its links with the number of the carrying one; ``unchecked``: the name, and why;
    ``lacking``: a sentence on each mesh that is not there.
    """

    bodies: tuple[tuple[int, Body], ...]
    links: tuple[tuple[str, int], ...]
    unchecked: tuple[tuple[str, str], ...]
    lacking: tuple[str, ...] = ()


def read_branches(
    meshes: MeshFinder,
    links: Mapping[str, ET.Element],
    joints: Sequence[ET.Element],
    chain: Mapping[str, tuple[int, Array]],
    parking: Parking,
) -> Branches:
    """Return the links beside the chain where their joints stand.

    Args:
        meshes: finds the files of meshes.
        links, joints: of the URDF, links by name.
        chain: the chain's links by name: the number of the link that each belongs to, and its pose (4, 4) [m] in that.
        parking: where the joints stand.
    """
    placed, bodies = dict(chain), list[tuple[int, Body]]()
    open_, following = list(chain), dict[str, str]()
    beside, lacking = list[tuple[str, int]](), list[str]()
    while open_:
        name = open_.pop(0)
        for joint, child, T_child in _joints_at(joints, name, parking):
            if child in placed or child in following:
                continue
            if child not in links:
                raise UrdfError(f"joint '{joint.get('name')}' names the link '{child}', which is not there")
            leader = following.get(name) or parking.followers.get(str(joint.get("name")))
            open_.append(child)
            if leader is not None:
                following[child] = leader
                continue
            link, T = placed[name]
            placed[child] = (link, T @ T_child)
            beside.append((child, link))
            bodies += [(link, b) for b in read_bodies(meshes, links[child], T @ T_child, lacking)]
    unchecked = [(name, f"moved by joint '{leader}'") for name, leader in following.items()]
    apart = [name for name in links if name not in placed and name not in following]
    unchecked += [(name, "joined to no link of the arm") for name in apart]
    return Branches(tuple(bodies), tuple(beside), tuple(unchecked), tuple(lacking))


def _joints_at(joints: Sequence[ET.Element], link: str, parking: Parking) -> Iterator[tuple[ET.Element, str, Array]]:
    """Yield the joints at a link, the link at the other end of each, and that one's pose (4, 4) [m] in this."""
    for joint in joints:
        parent, child = link_of(joint, "parent"), link_of(joint, "child")
        if link not in (parent, child):
            continue
        T = pose_matrix(*read_origin(joint)) @ parking.motion(joint)
        yield (joint, child, T) if link == parent else (joint, parent, np.asarray(np.linalg.inv(T), dtype=float))
