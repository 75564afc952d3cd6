"""An effect that is not shipped, in one file: a hose that pulls at a joint once another one has wound it up."""

import numpy as np

from planner.effects.basis import BasisFunction
from planner.effects.catalogue import register
from planner.effects.effect import Effect, Parameter, joint_place, transform_move

SLACK = 0.2  # [rad] of the winding joint, before the hose is taut


class HoseWinding(BasisFunction, key="hose:JOINT"):
    """φ = how far a joint has wound up the hose beyond its slack [rad]."""

    joint: int
    plot_label = "joint JOINT: hose wound up (rad)"

    def __call__(self, c):
        return np.maximum(0.0, np.abs(c.samples.q[:, self.joint]) - SLACK)


@register("hose pull", needs="poses with the wrist wound up")
def hose_pull(run):
    for i, driver in ((1, 3), (2, 3)):
        phi = HoseWinding(driver)
        if run.largest(phi) > 0:
            place = joint_place(i, driver)
            name, what = f"hose_pull{i + 1}", f"pull of the hose at {place}"
            parameter = Parameter(name, "rad/rad", 2e-4, what, transform_move(run.rotation(i), phi))
            sentence = f"joint {i + 1}: the hose pulls once joint {driver + 1} has wound it up, {{size}}"
            yield Effect("hose pull", place, (parameter,), sentence, 1e-2, "estimated")
