"""The elements and attributes of a URDF that are read, and those that mean no motion: anything else is refused."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass

from planner.common.errors import did_you_mean
from planner.kinematics.urdf_tree import UrdfError

JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
# elements of simulators, controllers and drawings, which leave the chain and its limits alone
EXTENSIONS = frozenset({
    "gazebo", "transmission", "ros2_control", "hardwareInterface", "actuator", "sensor", "mujoco", "material",
    "physics", "plugin", "group", "author", "verbose", "contact", "contact_coefficients", "self_collision_checking",
    "disable_collisions", "joint_properties", "simulation", "visual", "texture", "description", "comment",
})  # fmt: skip
# what an element has in it that places, moves or limits something
MOVES = frozenset({
    "origin", "pose", "axis", "limit", "limits", "parent", "child", "mimic", "joint", "link", "geometry", "inertial",
    "mass", "inertia", "safety_controller", "box", "sphere", "cylinder", "capsule", "mesh",
})  # fmt: skip


@dataclass(frozen=True)
class ElementRule:
    """What may stand in an element.

    Attributes:
        attributes: that are read, or mean no motion; ``None``: all, as none moves or limits anything.
        children: rules of the elements in it; those of simulators (:data:`EXTENSIONS`) may stand there too.
        once: elements of which only one may stand there.
        open: whether other elements may stand there that hold nothing that moves (:data:`MOVES`).
    """

    attributes: tuple[str, ...] | None = ()
    children: dict[str, ElementRule] | None = None
    once: tuple[str, ...] = ()
    open: bool = False


ORIGIN = ElementRule(("xyz", "rpy", "quat_xyzw"))
GEOMETRY = ElementRule(
    children={
        "box": ElementRule(("size",)),
        "sphere": ElementRule(("radius",)),
        "cylinder": ElementRule(("radius", "length")),
        "capsule": ElementRule(("radius", "length")),
        "mesh": ElementRule(("filename", "scale")),
    }
)
INERTIAL = ElementRule(
    children={
        "origin": ORIGIN,
        "mass": ElementRule(("value",)),
        "inertia": ElementRule(("ixx", "ixy", "ixz", "iyy", "iyz", "izz")),
    },
    once=("origin", "mass", "inertia"),
)
COLLISION = ElementRule(
    ("name", "group"), {"origin": ORIGIN, "geometry": GEOMETRY}, once=("origin", "geometry"), open=True
)
LINK = ElementRule(("name", "type"), {"inertial": INERTIAL, "collision": COLLISION}, once=("inertial",), open=True)
JOINT = ElementRule(
    ("name", "type"),
    {
        "origin": ORIGIN,
        "parent": ElementRule(("link",)),
        "child": ElementRule(("link",)),
        "axis": ElementRule(("xyz",)),
        "limit": ElementRule(
            ("lower", "upper", "effort", "velocity", "acceleration", "deceleration", "jerk", "drake:acceleration")
        ),
        "mimic": ElementRule(("joint", "multiplier", "offset")),
        "safety_controller": ElementRule(("soft_lower_limit", "soft_upper_limit", "k_position", "k_velocity")),
        "calibration": ElementRule(("rising", "falling", "reference_position")),
        "dynamics": ElementRule(None),
    },
    once=("origin", "parent", "child", "axis", "limit", "mimic", "safety_controller"),
)
ROBOT = ElementRule(("name", "version"), {"link": LINK, "joint": JOINT}, open=True)
PREFIXED_MOTION = ("drake:joint", "drake:mimic", "drake:limit")  # Drake's own elements that move or limit


def check_vocabulary(root: ET.Element) -> None:
    """Refuse what a URDF says that is not read here and may move or limit something.

    Raises:
        UrdfError: naming the element, its line, what was found and what is allowed.
    """
    if root.tag != "robot":
        raise UrdfError(f"the file begins with <{root.tag}>, not with <robot>: {_other_format(root.tag)}", root)
    _check(root, ROBOT, "<robot>")
    for joint in root.findall("joint"):
        if joint.get("type") not in JOINT_TYPES:
            kinds = ", ".join(JOINT_TYPES)
            raise UrdfError(f"joint '{joint.get('name')}' is of type '{joint.get('type')}': URDF has {kinds}", joint)


def _other_format(tag: str) -> str:
    known = {"sdf": "an SDF", "mujoco": "a model of MuJoCo (MJCF)", "COLLADA": "a COLLADA file"}
    found = f"this is {known[tag]}; " if tag in known else ""
    return f"{found}URDF and xacro are read, and DH rows"


def _check(element: ET.Element, rule: ElementRule, where: str) -> None:
    if rule.attributes is not None:
        for key in element.attrib:
            if key in rule.attributes or key.partition(":")[0] in ("xml", "xmlns"):
                continue
            if ":" in key:  # of a simulator's name space; none but Drake's acceleration limits anything
                continue
            raise UrdfError(
                f"{where} has the attribute '{key}', which is not read{did_you_mean(key, list(rule.attributes))} "
                f"(allowed: {', '.join(rule.attributes) or 'none'}): take it out, if it moves and limits nothing",
                element,
            )
    children = rule.children or {}
    for child in (c for c in element if isinstance(c.tag, str)):
        inside = f"<{child.tag}> of {_name_of(element, where)}" if element.tag != "robot" else _name_of(child, "")
        if child.tag in children:
            if child.tag in rule.once and element.find(child.tag) is not child:
                raise UrdfError(f"{_name_of(element, where)} has a second <{child.tag}>", child)
            _check(child, children[child.tag], inside)
        elif not _is_harmless(child, rule):
            allowed = ", ".join(f"<{tag}>" for tag in children) or "none"
            raise UrdfError(
                f"{_name_of(element, where)} has the element <{child.tag}>, which is not read"
                f"{did_you_mean(child.tag, list(children))} (allowed: {allowed}, and those of simulators and "
                "controllers such as <gazebo>): take it out, if it moves and limits nothing",
                child,
            )


def _is_harmless(element: ET.Element, rule: ElementRule) -> bool:
    """Tell whether an element of no rule places, moves and limits nothing."""
    if ":" in element.tag:
        return element.tag not in PREFIXED_MOTION
    if element.tag in EXTENSIONS:
        return True
    near = {tag.lower() for tag in rule.children or ()}
    spelt = element.tag.lower().rstrip("s")  # Joint, links
    return rule.open and spelt not in near and not any(tag in MOVES for tag in _tags_of(element))


def _tags_of(element: ET.Element) -> Iterator[str]:
    return (e.tag for e in element.iter() if isinstance(e.tag, str))


def _name_of(element: ET.Element, where: str) -> str:
    """Return how messages call an element: ``joint 'j3'``, else where it stands."""
    name = element.get("name")
    return f"{element.tag} '{name}'" if element.tag in ("joint", "link") else where or f"<{element.tag}>"
