"""The KUKA of the TriCal paper as it was identified (its Table 8), and effects that its 31 parameters lack."""

from types import MappingProxyType

import numpy as np

from planner.reproduction.published import paper_numbers
from tests.simulation.generator.kinds import Effect
from tests.simulation.generator.truth import Noise, Truth

SEED = 7
TOOL_KG = 6.0  # of the end effector in all tests of the paper
TOOL_COM_MM = [20, 0, 65]
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
    angles = {name: float(np.radians(v)) for name, v in paper_numbers().table_8.deg.items()}
    return MappingProxyType({**angles, **{name: v / 1e3 for name, v in paper_numbers().table_8.mm.items()}})


def compliances():
    """The joints' compliances; the paper's coefficients stay signed, the sense of the axis included."""
    return tuple(Effect("joint-compliance", j, float(np.radians(c))) for j, c in signed_compliances().items())


def signed_compliances():
    """Compliance of each joint as the paper states it [deg/Nm]."""
    return {int(name.removeprefix("compliance")): value for name, value in paper_numbers().table_8.deg_Nm.items()}


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
