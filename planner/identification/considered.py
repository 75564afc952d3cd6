"""What parameters that are held, since something else measured them well, add to the uncertainty of the fitted ones.

A tool point that a CMM knows to 2 µm is no parameter of the fit, but the fit takes its error for the robot's: the last
offset and angle are known no better than the point that hangs from them (Schmidt's consider covariance; Jazwinski 1970,
section 8.4).
"""

from collections.abc import Sequence

import numpy as np

from planner.identification.fit import Fit
from planner.model import Parameter
from planner.units import Array


def considered(fit: Fit, held: Sequence[Parameter]) -> Array:
    """Return what the held parameters, each off by its prior size, add to the covariance of the fitted ones, (P, P)."""
    count = len(fit.errors)
    if not held or not count:
        return np.zeros((count, count))
    wider = fit.problem.with_model(fit.model.plus(list(held)))
    errors = np.append(fit.errors, np.zeros(len(held)))
    gram = np.asarray(sum(wider.over_pieces(lambda part: wider.piece(part, errors).gram)))
    information = fit.solution.factor.T @ fit.solution.factor  # in prior sizes, the prior's own with it
    moved = fit.problem.prior[:, None] * np.linalg.solve(information, gram[:count, count:-1])
    return np.asarray(moved @ moved.T)
