"""Smooth corrections without a name, for structure that no entry of the catalogue explains.

The turn of a joint as a smooth function of one joint's angle: waves of half a period over the joint's range and its
multiples, expected the smaller the shorter they are, as of a smoothing spline (Wahba 1990). How smooth it is the run
decides, as the sizes of all parameters of an effect share a factor that is fitted.
"""

from collections.abc import Iterator

import numpy as np

from planner.catalogue import Entry
from planner.effects.waves import Cosine, Sine
from planner.model import Model, Parameter
from planner.model.parameters import transform
from planner.units import Array

KIND = "unnamed"
WAVES = 6
SIZE = 3e-4  # [rad], one sigma of the longest wave
LARGEST = 1e-2  # [rad]


def unnamed(base: Model, q: Array) -> Iterator[Entry]:
    """Yield corrections of each joint over its own angle, then over another joint's; q (n, N) [rad]."""
    turns = {t.joint: k for k, t in enumerate(base.rig.chain.transforms) if t.joint is not None}
    spread = np.ptp(q, axis=0)
    moving = [int(i) for i in np.flatnonzero(spread > 1e-2)]
    for i, by in sorted(((i, k) for i in turns for k in moving), key=lambda pair: (pair[0] != pair[1], pair)):
        yield _correction(turns[i], i, by, float(spread[by]))


def _correction(where: int, i: int, by: int, spread: float) -> Entry:
    on = f"joint {i + 1}" + ("" if i == by else f" by joint {by + 1}")
    label = f"unnamed{i + 1}" + ("" if i == by else f"_by{by + 1}")
    parameters = tuple(
        Parameter(
            f"{label}_{wave}{k}", "rad", SIZE / k**2, f"smooth correction of {on}", transform(where, phi),
            f"{KIND}, {on}",
        )
        for k in range(1, WAVES + 1)
        for wave, phi in (("sin", Sine(by, k * np.pi / spread)), ("cos", Cosine(by, k * np.pi / spread)))
    )  # fmt: skip
    over = "its own angle" if i == by else f"joint {by + 1}'s angle"
    sentence = f"joint {i + 1}: moves smoothly with {over} by {{size}}, for a cause that has no name here"
    return Entry(KIND, on, lambda _: parameters, sentence, LARGEST, "none: a description, not a cause")
