"""The parameters of the robot that is released, as it is written, with what is not known of them."""

from collections.abc import Sequence

import numpy as np

from planner.common.units import Array
from planner.identification.released_robot import ReleasedRobot
from planner.model.identification_document import Estimate


def released_estimates(fitted: Sequence[Estimate], released: ReleasedRobot) -> tuple[Estimate, ...]:
    """Return the parameters of the released robot: geometry, gauge, and those effects that its file holds.

    The value is the one that is written. Its standard deviation is the root of its expected squared error by the
    posterior: of the posterior's variance and, where the value is not the posterior mean, of its square distance.

    Args:
        fitted: every parameter as the last stage has it.
        released: the robot that is written.
    """
    values = released.fit.values | released.effects
    kept = [e for e in fitted if e.group in ("gauge", "geometry") or e.name in released.effects]
    std = released_std(released, [e.name for e in kept])
    return tuple(
        e.model_copy(update={"value": e.nominal + values.get(e.name, 0.0), "std": float(s) if s > 0 else None})
        for e, s in zip(kept, std, strict=True)
    )


def released_std(released: ReleasedRobot, names: Sequence[str]) -> Array:
    """Return the standard deviation of parameters of the released robot, (K,); 0 where the posterior lacks one."""
    spread, off = released.spread(names), released.offset(names, released.fit)
    return np.asarray(np.sqrt((spread**2).sum(axis=1) + off**2))
