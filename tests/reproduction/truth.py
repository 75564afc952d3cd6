"""The KUKA of the TriCal paper as it was identified (its Table 8), and effects that its 31 parameters lack."""

from types import MappingProxyType

import numpy as np

from tests.simulation.generator.kinds import Effect
from tests.simulation.generator.truth import Noise, Truth

SEED = 7
TOOL_KG = 6.0  # of the end effector in all tests of the paper
TOOL_COM_MM = [20, 0, 65]
# Table 8, identified less nominal: degrees and millimetres
ANGLES_DEG = {
    "alpha1": 0.005, "alpha2": -0.015, "alpha3": -0.001, "alpha4": 0.105, "alpha5": -0.017,
    "theta2": 0.026, "theta3": 0.044, "theta4": 0.007, "theta5": 0.015, "theta6": 0.012, "beta2": -0.005,
}  # fmt: skip
LENGTHS_MM = {
    "a1": 0.243, "a2": 0.160, "a3": 0.106, "a4": 0.075, "a5": 0.032, "d3": 0.067, "d4": -0.340, "d5": 0.001,
    "d6": -0.279,
}  # fmt: skip
COMPLIANCES = {2: 2.987e-3, 3: -3.238e-3, 4: -8.723e-3, 5: -25.489e-3, 6: -28.161e-3}  # [deg/Nm]
# what is there besides: uneven gears, a link that bends, play; one size for all of them, see ``table9.SIZE``
UNEVEN = {1: 17.0, 2: 15.0, 3: 19.0, 4: 14.0, 5: 16.0}  # joint: knots a turn
UNEVEN_RAD = 2.2e-4
BACKLASH_RAD = 2.5e-4
DEVICE_M = 2.5e-6  # TriCal: 2 to 3 µm
TRACKER_M = 15e-6
BAR_M = 1e-6
JOINT_RAD = 1.3e-5  # 0.03 mm (three sigma) at the tool


def errors():
    """Geometric errors [m, rad] by the names of the rows."""
    angles = {name: float(np.radians(v)) for name, v in ANGLES_DEG.items()}
    return MappingProxyType({**angles, **{name: v / 1e3 for name, v in LENGTHS_MM.items()}})


def compliances():
    """The joints' compliances; the paper's coefficients stay signed, the sense of the axis included."""
    return tuple(Effect("joint-compliance", j, float(np.radians(c))) for j, c in COMPLIANCES.items())


def hidden(size=1.0, seed=0):
    """What the 31 parameters do not know, at ``size`` times its usual size; another ``seed``, other gears."""
    uneven = [
        Effect("gear-uneven", j, size * UNEVEN_RAD, (("knots", knots), ("seed", float(j + 10 * seed))))
        for j, knots in UNEVEN.items()
    ]
    return (*uneven, Effect("backlash-approach", 4, size * BACKLASH_RAD), Effect("link-bending", 3, size * 2e-5))


def truth(gauge_m, more=(), seed=0):
    """The arm, measured by a gauge with a noise of ``gauge_m``."""
    return Truth(SEED + seed, errors(), (*compliances(), *more), Noise(gauge_m, JOINT_RAD), (1.0,) * 6)
