"""What stays open because no pose has shown it, and which measurement would show it.

Of what every robot has in some size (:mod:`planner.effects.usual_errors`) the poses of a run may say nothing. Its prior
then stands in the stated error. How much that is follows from the limit that would be stated if it were known.
"""

from collections.abc import Iterator

import numpy as np

from planner.common.units import Array
from planner.effects.context import Context
from planner.effects.usual_errors import BASE_BY_PLACE, BEYOND_LOADS, LOST_MOTION_OF
from planner.inference.posterior_background import OF_BACKGROUND
from planner.model.identification_document import UnseenError
from planner.release.released_robot import ReleasedRobot
from planner.runs.run import Samples


def unseen_errors(released: ReleasedRobot) -> tuple[UnseenError, ...]:
    """Return what the run has not shown of base and joints, what leaves most open first."""
    samples = released.posterior.record.run.samples
    worth_saying = 0.05  # of the limit, that it would fall by
    found = []
    for family, which in _parameters_of(released).items():
        without = released.limit_without(which)
        if released.at_most - without > worth_saying * released.at_most:
            what, cure = _base_words(released) if family == "" else _load_words(released, samples, int(family) - 1)
            found.append(UnseenError(what=what, cure=cure, at_most=without))
    return tuple(sorted(found, key=lambda u: u.at_most))


def _parameters_of(released: ReleasedRobot) -> dict[str, list[str]]:
    """Return the names of the parameters that move the tool, by the number of their joint; of the base by ``""``."""
    record = released.posterior.record
    family = dict(zip(record.model.names, record.effects.family.tolist(), strict=True))
    out: dict[str, list[str]] = {}
    for name in released.tool.names:
        own = record.names[family[name]].removesuffix(OF_BACKGROUND) if family.get(name, -1) >= 0 else ""
        if own.startswith(BASE_BY_PLACE):
            out.setdefault("", []).append(name)
        elif own.startswith((LOST_MOTION_OF, BEYOND_LOADS)):
            out.setdefault(own.rpartition(" ")[2], []).append(name)
    return out


def _base_words(released: ReleasedRobot) -> tuple[str, str]:
    gauge = released.fit.setup.gauge
    side = "on another side of the base"
    if gauge.width == 1:  # a length to a fixture
        cure = f"poses about a second fixture {side}"
    elif gauge.at_balls:
        cure = f"the balls once more {side}"
    else:
        cure = "poses near and far on all sides of the base"
    return "how the base turns with the place of the arm", cure


def _load_words(released: ReleasedRobot, samples: Samples, joint: int) -> tuple[str, str]:
    """Say under which loads a joint was not measured, and that poses with these show it."""
    anywhere, run = (_loads(released, s, joint) for s in (Samples.at(released.tool.q), samples))
    sides = " or ".join(_sides(anywhere, float(run.min()), float(run.max()))) or "to the other side"
    return f"how joint {joint + 1} turns under loads {sides}", "poses with such loads"


def _loads(released: ReleasedRobot, samples: Samples, joint: int) -> Array:
    return np.asarray(Context(released.fit.setup, samples).load_torque[:, joint])


def _sides(loads: Array, low: float, high: float) -> Iterator[str]:
    """Yield ``below 3 Nm`` and ``above 5 Nm`` where more than a hundredth of the workspace's loads lies there."""
    for side, end, share in (("below", low, (loads < low).mean()), ("above", high, (loads > high).mean())):
        if share > 0.01:
            yield f"{side} {end:.3g} Nm"
