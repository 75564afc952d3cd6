"""One sentence for a parameter that cannot be seen, in the robot's terms, made from its null vector."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

Direction = Sequence[tuple[str, float]]

_JOINT = re.compile(r"^(theta|alpha|a|d|beta|rx|ry|rz|x|y|z)_?(\d+)$")
_TURNING = {"theta", "alpha", "beta", "rx", "ry", "rz"}
_SHOWN = 4  # terms of a direction that are written out


@dataclass(frozen=True)
class _Term:
    """A name taken apart: what kind of parameter, of which joint (0: none), and its share in the direction."""

    name: str
    kind: str
    joint: int
    share: float


def _parse_name(name: str, share: float) -> _Term:
    match = _JOINT.match(name)
    if match:
        return _Term(name, match[1], int(match[2]), share)
    for prefix in ("fixture", "map", "tool", "base", "zero"):
        if name == prefix or name.startswith((prefix + "_", prefix + ".")):
            return _Term(name, prefix, 0, share)
    return _Term(name, "other", 0, share)


def explain_direction(direction: Direction, faint: bool = False) -> str:
    """Return why the first parameter of the unseen ``direction`` ((name, coefficient), ...) is held fixed.

    ``faint``: the direction does move the readings, but by less than noise and prior allow to see.
    """
    terms = [_parse_name(name, share) for name, share in direction]
    if faint:
        return (
            f"{_list_coupled(terms)}: over all these poses the readings hardly change along"
            f" {format_direction(direction)}"
        )
    if len(terms) == 1:
        return _explain_single(terms[0])
    reason = _reason(terms)
    if reason:
        return f"{_list_coupled(terms)}: {reason}{_format_mixture(direction)}"
    return f"{_list_coupled(terms)}: no reading changes along {format_direction(direction)}"


def join_names(names: Sequence[str]) -> str:
    """Return names as a list in words, such as ``a, b and c``."""
    return ", ".join(names[:-1]) + " and " + names[-1] if len(names) > 1 else names[0]


def format_direction(direction: Direction) -> str:
    """Return a direction as text, such as ``0.95 theta6 + 0.32 alpha6``."""
    text = ""
    for name, share in direction[:_SHOWN]:
        sign = ("- " if share < 0 else "+ ") if text else ("-" if share < 0 else "")
        text += f"{' ' if text else ''}{sign}{abs(share):.2g} {name}"
    more = len(direction) - _SHOWN
    return text + (f" + {more} smaller" if more > 0 else "")


def _list_coupled(terms: Sequence[_Term]) -> str:
    others = [t.name for t in terms[1:]]
    if not others:
        return f"{terms[0].name} is too faint"
    if len(others) > _SHOWN:
        others = [*others[: _SHOWN - 1], f"{len(others) - _SHOWN + 1} more"]
    return f"{terms[0].name} moves with {join_names(others)}"


def _format_mixture(direction: Direction) -> str:
    """Write the direction out unless it is a plain sum or difference of two."""
    shares = [abs(share) for _, share in direction]
    plain = len(shares) == 2 and abs(shares[0] - shares[1]) < 1e-3
    return "" if plain else f" (unseen: {format_direction(direction)})"


def _explain_single(term: _Term) -> str:
    if term.kind in ("theta", "rz") and term.joint:
        return f"{term.name} moves no reading: it only turns about axis {term.joint} what lies on that axis"
    if joint := re.fullmatch(r"compliance(\d+)", term.name):
        return f"{term.name} moves no reading: no weight turns joint {joint[1]}, at any of these poses"
    if term.kind == "zero":
        return f"{term.name} moves no reading: this gauge has no zero to find"
    return f"{term.name} moves no reading at any of these poses"


def _reason(terms: Sequence[_Term]) -> str:
    """Why no reading tells several parameters apart; empty where there is no simple reason."""
    kinds, joints, sizes = {t.kind for t in terms}, {t.joint for t in terms}, [abs(t.share) for t in terms]
    fixed, tool, first, last = kinds & {"fixture", "base"}, kinds & {"map", "tool"}, min(joints), max(joints)
    if kinds <= {"d", "z"} and 0 not in joints and max(sizes) - min(sizes) < 1e-3 * max(sizes):
        return f"axes {join_names([str(t.joint) for t in sorted(terms, key=lambda t: t.joint)])} are parallel"
    if kinds <= _TURNING and len(joints) == 1 and first:
        return f"with this tool offset both only turn the tool point about axis {first}"
    if fixed and not tool:
        return _fixture_reason(terms)
    if tool and not fixed and len(joints - {0}) == 1:
        return f"only where the tool point sits from axis {last} counts, not how the flange frame is drawn"
    if first and first == last:
        return f"within joint {first} they move the tool point the same way"
    if first and last - first == 1:
        return f"joints {first} and {last} share a motion that no reading can divide between them"
    return ""


def _fixture_reason(terms: Sequence[_Term]) -> str:
    """The arm as a whole and the fixture move together."""
    arm, kinds = {t.joint for t in terms if t.joint}, {t.kind for t in terms if t.joint}
    if any(t.kind == "base" for t in terms):
        return "only how the arm stands to the gauge's own frame counts, not what of that is the base's"
    if not arm:
        return "only the place of the fixture from the base counts"
    if len(arm) > 1:
        return "shifting these links together carries the tool point as moving the fixture does"
    joint = arm.pop()
    if kinds <= _TURNING:
        return f"turning the arm from joint {joint} on is the same as carrying the fixture round the other way"
    return f"shifting the arm at joint {joint} is the same as moving the fixture the other way"
