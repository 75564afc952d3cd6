"""What may be wrong with an arm beside its geometry, before anybody has looked: sizes as the catalogue expects them."""

from dataclasses import dataclass

import numpy as np

from planner.cell.cell import Cell
from planner.common.units import Array
from planner.design.free_parameters import planned_model
from planner.effects.compliance import compliance_parameters
from planner.effects.nonparametric import CURVE_SIZE, gear_curve
from planner.model.model import Model
from planner.model.tool_error import ToolError
from planner.runs.run import Samples

HIGHEST_WAVE = 15.0  # waves a turn within which most of a gear's error is expected
ASSUMED = (
    f"every gear errs by {CURVE_SIZE * 1e6:.0f} µrad in waves of up to {HIGHEST_WAVE:.0f} a turn, and every joint"
    " gives way"
)
UNKNOWN_PRIOR = 1.0  # [m, rad] prior size of what is not known at all


@dataclass(frozen=True)
class UndeclaredErrors:
    """The model of everything that may have to be found, and what it does to the tool.

    Attributes:
        model: with the geometry that is freed, and the effects that nobody declared.
        prior: one-sigma sizes, (P,), finite.
        weight: mean square error of the tool per squared errors, (P, P).
        untraced: error of the tool [m] that the gears' errors leave even where all else is fitted as well as can be.
    """

    model: Model
    prior: Array
    weight: Array
    untraced: float

    @property
    def weight_per_prior(self) -> Array:
        """The weight for errors in prior sizes, (P, P) [m²]."""
        return np.asarray(self.weight * np.outer(self.prior, self.prior))

    def white(self, samples: Samples) -> Array:
        """Return the rows of readings in standard deviations per prior size, (n, P)."""
        return np.asarray(self.model.rows(samples)[:, 0] / self.model.noise(samples)[:, None] * self.prior)


def undeclared_errors(cell: Cell, samples: Samples) -> UndeclaredErrors:
    """Return what may have to be found in a cell, seen from the poses ``samples``.

    Raises:
        InputError: the cell declares an effect that these poses do not show.
    """
    base = planned_model(cell, samples)
    ends = np.array(cell.joint_range)
    gears = [p for j in range(cell.robot.n_joints) for p in gear_curve(base.setup, ends, j, HIGHEST_WAVE).make(None)]
    declared = set(base.names)
    soft = compliance_parameters(base.setup) if base.setup.weighs else []
    model = base.plus([*gears, *(p for p in soft if p.name not in declared)])
    prior = np.where(np.isfinite(model.prior), model.prior, UNKNOWN_PRIOR)
    effects = [p for p in model.parameters if p.group not in ("gauge", "geometry")]
    weight = ToolError.of(cell, effects).weight(model.names)
    return UndeclaredErrors(model, prior, weight, _untraced_error(weight, prior, [p.name for p in gears], model))


def _untraced_error(weight: Array, prior: Array, hidden: list[str], model: Model) -> float:
    """Square of the hidden effects' prior sizes through what is left of the weight when all else fits them best."""
    unseen = [k for k, name in enumerate(model.names) if name in set(hidden)]
    fitted = [k for k in range(len(prior)) if k not in set(unseen)]
    W = weight * np.outer(prior, prior)
    uu, uf, ff = (W[np.ix_(a, b)] for a, b in ((unseen, unseen), (unseen, fitted), (fitted, fitted)))
    left = np.trace(uu) - np.trace(uf @ np.linalg.pinv(ff, rcond=1e-10, hermitian=True) @ uf.T)
    return float(np.sqrt(max(left, 0.0)))
