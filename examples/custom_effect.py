"""An effect that the planner does not ship: a hose that pulls at a joint once another one has wound it up.

Defined and registered here, it can be simulated by its name and is sought by tracing like any other.
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from planner import identify, simulate
from planner.effects.basis import BasisFunction
from planner.effects.catalogue import register
from planner.effects.effect import Effect, Parameter, joint_place, transform_move

SLACK = 0.2  # [rad] of the winding joint, before the hose is taut
TRUTH = """schema = "edbb-truth/1"
[[effects]]
kind = "hose pull"
on = "joint 2 by joint 4"
value = 400
unit = "urad/rad"
[noise]
gauge_um = 2.0
repeatability_mm = 0.002
"""


class HoseWinding(BasisFunction, key="hose:JOINT"):
    """φ = how far a joint has wound up the hose beyond its slack [rad]."""

    joint: int
    plot_label = "joint JOINT: hose wound up (rad)"

    def __call__(self, c: Any) -> Any:
        return np.maximum(0.0, np.abs(c.samples.q[:, self.joint]) - SLACK)


@register("hose pull", needs="poses with the wrist wound up")
def hose_pull(run: Any) -> Iterator[Effect]:
    """Yield the hose's pull at the second joint, wound up by the fourth."""
    phi = HoseWinding(3)
    if run.largest(phi) > 0:
        place = joint_place(1, 3)
        what = f"pull of the hose at {place}"
        parameter = Parameter("hose_pull2", "rad/rad", 2e-4, what, transform_move(run.rotation(1), phi))
        sentence = "joint 2: the hose pulls once joint 4 has wound it up, {size}"
        yield Effect("hose pull", place, (parameter,), sentence, 1e-2, "estimated")


def main(plan: str = "session/plan.json", folder: str = "custom_effect") -> None:
    out = Path(folder)
    out.mkdir(exist_ok=True)
    (out / "truth.toml").write_text(TRUTH)
    run = simulate(plan, truth=out / "truth.toml", seed=1)
    found = identify(run, cell=Path(plan).parent / "cell.toml")
    print(found.summary())
    found.write(out)


if __name__ == "__main__":
    main(*sys.argv[1:])
