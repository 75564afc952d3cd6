"""The whole error of a joint's gear over its angle, as a smooth curve.

Its waves are expected the smaller the quicker they run (a Gaussian process with a squared exponential kernel, in its
Fourier series; Rasmussen & Williams 2006, ch. 4).
"""

import numpy as np

from planner.catalogue.types import Entry
from planner.effects.waves import Cosine, Sine
from planner.model import Model, Parameter
from planner.model.parameters import transform
from planner.units import Array

CURVE = "gear error curve"
LAST = 2.0  # times the quickness: the quickest waves that are modelled
SIZE = 2e-4  # [rad], root mean square
LARGEST = 5e-3  # [rad]
ROOM = 1.3  # length over which the function repeats itself, over the joint's range
TURN = 2 * np.pi


def gear_curve(base: Model, q: Array, joint: int, quickest: float) -> Entry:
    """Return the curve of a joint as an entry.

    Args:
        base: any model of the rig.
        q: controller angles whose range it covers, (n, N) [rad].
        joint: from 0.
        quickest: waves a turn within which most of the error lies.
    """
    spread = min(TURN, ROOM * float(np.ptp(q[:, joint])))
    step = TURN / spread
    waves = step * np.arange(1, max(2, int(LAST * quickest / step) + 1))
    size = np.exp(-0.5 * (waves / quickest) ** 2)
    size *= SIZE / np.sqrt((size**2).sum())
    where = next(k for k, t in enumerate(base.rig.chain.transforms) if t.joint == joint)
    on = f"joint {joint + 1}"
    parameters = tuple(
        Parameter(
            f"gear_curve{joint + 1}_{name}{k}", "rad", float(s), f"gear error of {on}, {w:.4g} waves a turn",
            transform(where, phi), f"{CURVE}, {on}",
        )
        for k, (w, s) in enumerate(zip(waves, size, strict=True), 1)
        for name, phi in (("sin", Sine(joint, float(w))), ("cos", Cosine(joint, float(w))))
    )  # fmt: skip
    sentence = f"{on}: gear or encoder runs unevenly over the joint's own angle, {{size}}"
    return Entry(CURVE, on, lambda _: parameters, sentence, LARGEST, "measured curve: no model of a gear behind it")
