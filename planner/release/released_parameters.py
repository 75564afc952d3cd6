"""The parameters of the robot that is released, as it is written, with what is not known of them."""

from collections.abc import Sequence

import numpy as np

from planner.common.units import Array
from planner.fit.least_squares import Fit
from planner.model.identification_document import Estimate
from planner.release.released_robot import ReleasedRobot


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


def std_beside_robot(fit: Fit) -> dict[str, float]:
    """Return the standard deviations of the gauge's parameters, by name, where the robot counts as known as it is.

    A tool point and the last link can often not be told apart: each alone is known to a millimetre, and the point as it
    belongs to one robot to a hundredth of it. By the block of the information that the gauge's parameters have.
    """
    gauge = [k for k, p in enumerate(fit.model.parameters) if p.group == "gauge"]
    if not gauge:
        return {}
    own = fit.solution.factor[:, gauge]
    std = fit.problem.prior[gauge] * np.sqrt(np.diag(np.linalg.pinv(own.T @ own)))
    return {fit.model.names[k]: float(s) for k, s in zip(gauge, std, strict=True)}
