"""Why poses cannot tell two effects apart, and what would: one sentence for a pair."""

from collections.abc import Sequence

NEEDS = {
    "thermal drift": "a run with temperature_degC logged while the arm warms up or cools down",
    "link growth": "a run with temperature_degC logged while the arm warms up or cools down",
    "gauge growth": "a run with temperature_degC logged while the gauge warms up or cools down and the arm does not",
    "payload compliance": "the same poses with another payload (payload_kg in the run)",
    "compliance under drive torque": "the drives' torques in the run (torque1_Nm ...)",
    "session step": "poses measured in several sessions, the bar taken off in between",
    "remounting": "poses measured in several sessions, the fixture mounted anew in between",
    "unsettled angle": "both read and commanded angles in the run (q1_deg ... and cmd1_deg ...)",
    "hysteresis": 'a run measured while moving (motion.measure = "continuous")',
    "servo lag": 'a run measured while moving (motion.measure = "continuous")',
    "gauge lag": 'a run measured while moving (motion.measure = "continuous")',
    "backlash": "poses come to from both sides of the joint",
    "warm-up": "a longer run that starts with a cold arm",
    "drift": "a longer run",
    "unnamed": "nothing that can be planned: the correction has no cause that could be compared",
    "gear error curve": "nothing that can be planned: a whole curve takes the shape of whatever the readings hold",
}


def not_shown(finding: str, rival: str, missing: Sequence[str]) -> str:
    """Say that a plan's readings do not show an effect at all."""
    kinds = list(dict.fromkeys(_kind(name) for name in missing))
    needed = " and ".join(dict.fromkeys(NEEDS.get(kind, "another kind of run") for kind in kinds))
    what = " and ".join(missing)
    return f"{finding} and {rival}: a run of this plan does not show {what}; that needs {needed}"


def exact(finding: str, rival: str, help_: Sequence[str]) -> str:
    """Say that two effects look alike in every pose, and what would help."""
    return f"{finding} and {rival}: the same in every pose that this cell can measure; {_would(finding, rival, help_)}"


def faint(finding: str, rival: str, poses: int, most: float, needed: int, help_: Sequence[str]) -> str:
    """Say that the difference of two effects is lost in the noise of so few poses, and what would help."""
    return (
        f"{finding} and {rival}: no {poses} poses differ by more than {most:.2g} noise variances; "
        f"about {needed} would be needed (--poses); {_would(finding, rival, help_)}"
    )


def _would(finding: str, rival: str, help_: Sequence[str]) -> str:
    if help_:
        return f"what would tell them apart: {'; or '.join(help_)}"
    if {_kind(finding), _kind(rival)} <= {"gauge lag", "servo lag"}:
        return "no other way of measuring would help but a gauge that the controller itself triggers or logs"
    return "another payload or speed, a second fixture or a longer bar would not help either"


def _kind(name: str) -> str:
    return name.split(", ")[0]
