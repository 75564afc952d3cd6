"""The names of effects, as far as they can be wrong: an unknown kind, or a joint that the robot does not have."""

import re

from planner.errors import InputError, nearest

JOINTS = (
    "joint compliance",
    "compliance under drive torque",
    "payload compliance",
    "encoder once a turn",
    "encoder twice a turn",
    "gear ripple",
    "gear error curve",
    "strain-wave error",
    "motor-side error",
    "reduction ratio",
    "coupling",
    "axis wobble once a turn",
    "axis wobble twice a turn",
    "axis wobble three times a turn",
    "backlash",
    "backlash by load",
    "hysteresis",
    "unsettled angle",
    "servo lag",
)
ARM = ("link bending", "soft base", "tool compliance", "link mass", "payload mass", "link growth")
TIME = ("thermal drift", "drift", "warm-up", "session step", "remounting")
GAUGE = (
    "gauge scale",
    "gauge nonlinearity",
    "gauge cubic nonlinearity",
    "gauge sag",
    "gauge growth",
    "gauge lag",
    "ball centre",
    "scale interpolation",
    "refraction",
)
KINDS = (*JOINTS, *ARM, *TIME, *GAUGE, "unnamed")


def once(name: str) -> str:
    """Return the name of an effect without its number, where it came again: ``gear ripple (2), joint 1``."""
    return re.sub(r" \(\d+\)(?=, |$)", "", name)


def check_name(name: str, n_joints: int, where: str) -> None:
    """Check that an effect is one that there is, on a joint that an arm of ``n_joints`` has.

    Args:
        name: ``encoder once a turn, joint 2``.
        n_joints: joints of the robot.
        where: file and place of the name, for the message.

    Raises:
        InputError: with the nearest kind, or the joints that there are.
    """
    kind, comma, on = once(name).partition(", ")
    if kind not in KINDS or not comma:
        allowed = "" if comma else "; it is called KIND, PLACE, like 'backlash, joint 2'"
        raise InputError(
            f"{where}: '{name}' is no effect{nearest(kind, list(KINDS))}{allowed} (known kinds: {', '.join(KINDS)})"
        )
    for part, most in (("joint", n_joints), ("link", n_joints + 1)):
        for number in re.findall(rf"\b{part} (\d+)", on):
            if not 1 <= int(number) <= most:
                raise InputError(f"{where}: '{name}': the robot has {part}s 1 to {most}")
