"""What a corrected program leaves as it is, in the words of the person at the robot."""

import re
from collections.abc import Iterable

from planner.effects.keys import forms_of
from planner.robot import RobotEffect

CAUSES = {  # by the first word of the basis function
    "drive": "giving way under measured drive torques",
    "speed-sign": "what depends on the sense of motion",
    "behind": "lag behind the command",
    "approach": "play",
    "hysteresis": "hysteresis",
    "unsettled": "standing elsewhere than commanded",
    "warmth": "growth with temperature",
    "elapsed": "drift with time",
    "warm-up": "warming up",
    "session": "steps between sessions",
}
OTHERWISE = "what belongs to the gauge"


def uncorrected(effects: Iterable[RobotEffect]) -> str | None:
    """Say which effects targets are not corrected for, each cause once with where it acts; ``None`` without any.

    Args:
        effects: those that hang on more than joint angles and loads.
    """
    where = dict[str, dict[str, list[int]]]()
    for e in effects:
        cause = next((CAUSES[f.word] for f in forms_of(e.phi) if f.word in CAUSES), OTHERWISE)
        part, number = _part(e.on)
        numbers = where.setdefault(cause, {}).setdefault(part, [])
        if number is not None and number not in numbers:
            numbers.append(number)
    if not where:
        return None
    causes = (f"{cause} ({'; '.join(_several(p, n) for p, n in parts.items())})" for cause, parts in where.items())
    return f"not corrected: {', '.join(causes)}: it depends on more than joint angles and loads"


def _part(transform: str) -> tuple[str, int | None]:
    """Return the part of the arm that a transform belongs to, and its number."""
    if transform.startswith("base"):
        return "base", None
    number = re.search(r"\d+", transform)
    if number is None:
        return "flange", None
    return "joint" if transform.startswith("theta") else "link", int(number[0])


def _several(part: str, numbers: list[int]) -> str:
    if not numbers:
        return part
    return f"{part}{'s' * (len(numbers) > 1)} {', '.join(str(n) for n in sorted(numbers))}"
