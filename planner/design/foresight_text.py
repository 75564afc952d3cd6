"""What is said of chosen poses: the error that they leave, its bound, and what other numbers of poses would give."""

from planner.common.units import to_mm
from planner.design.assumptions import PLACE_LIMITED_SHARE
from planner.design.bayesian_design import BayesianDesign
from planner.design.expected_errors import ErrorForecast


def another_place_pays(expected: BayesianDesign) -> bool:
    """Tell whether a second fixture may show what all poses about the one there is cannot."""
    return _is_limited_by_place(expected) and len(expected.unknown.model.setup.p_BX) == 1


def _is_limited_by_place(expected: BayesianDesign) -> bool:
    return expected.floor >= PLACE_LIMITED_SHARE * expected.left


def describe_numbers_of_poses(expected: BayesianDesign) -> str:
    """Return in a sentence what other numbers of poses would give, and who says what another place would."""
    numbers = "; ".join(
        f"{f.poses} poses {float(to_mm(f.error)):.3f} mm{'' if f.minutes is None else f', about {f.minutes:.0f} min'}"
        for f in expected.by_number
    )
    if not _is_limited_by_place(expected):
        return numbers
    floor = f"{float(to_mm(expected.floor)):.3f} mm"
    more = another_place_pays(expected)
    cure = "what another fixture would leave, --fixtures 2 says" if more else "these fixtures show no more"
    return f"{numbers}; all candidates together would leave {floor}: {cure}"


def describe_forecast(expected: ErrorForecast) -> str:
    """Return the error to be expected, and how near to the least it is where that chose the poses; no stop ends it."""
    left, at_most = (f"{float(to_mm(v)):.3f}" for v in (expected.left, expected.at_most))
    proof = ""
    if isinstance(expected, BayesianDesign):
        on_grid, bound = (f"{float(to_mm(v)):.3f} mm" for v in (expected.on_grid, expected.bound))
        n = len(expected.chosen)
        if expected.unknown.doubt:
            proof = f". With sizes that are known they would leave {on_grid}, and no {n} candidates less than {bound}"
        else:
            moved = "" if on_grid == f"{left} mm" else f" (those chosen among them {on_grid}, before they were moved)"
            proof = f". No {n} candidates leave less than {bound}{moved}"
    return f"{expected.unknown.describe(expected.left, left, at_most)}{proof}{expected.unknown.condition}"


def describe_goal(expected: BayesianDesign) -> str:
    """Say how sure it is that a robot is below the goal after the poses; empty where nobody has asked for one."""
    if expected.until is None or expected.share_below is None:
        return ""
    below = min(int(100 * expected.share_below), 99)
    return f"{float(to_mm(expected.until)):.3g} mm: {below} % sure that a robot of this kind is below it then"
