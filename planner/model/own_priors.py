"""Sizes of errors of one's own, one by one, in place of what the robot's and the cell's files say."""

from collections.abc import Mapping
from dataclasses import replace

from planner.cell.cell import Cell, setup_of
from planner.cell.placement import FREEABLE
from planner.common.errors import InputError, did_you_mean
from planner.effects.compliance import compliance_parameters
from planner.effects.effect import parameter_keys
from planner.model.model import Model


def with_priors(cell: Cell, priors: Mapping[str, float] | None) -> Cell:
    """Return a cell with other one-sigma sizes of some errors.

    Args:
        cell: as it is.
        priors: by parameter and unit, as keys of ``TRUTH.toml``: ``{"theta2_deg": 0.05, "a3_mm": 0.1}``.

    Raises:
        InputError: a key names no error of the cell, or a size is not above zero.

    Example:
        >>> with_priors(cell, {"theta2_deg": 0.05})  # doctest: +SKIP
    """
    if not priors:
        return cell
    setup = setup_of(cell)
    parameters = (*Model.of(setup, FREEABLE).parameters, *compliance_parameters(setup))
    keys = {key: (p.name, factor) for p in parameters for key, factor in parameter_keys(p)}
    sizes = dict(cell.robot.priors.sizes)
    for key, value in priors.items():
        if key not in keys:
            hint = did_you_mean(key, list(keys)) or f" (there are {', '.join(p.name for p in parameters)})"
            raise InputError(f"priors: '{key}' names no error with its unit{hint}")
        name, factor = keys[key]
        if not 0 < value * factor < float("inf"):
            raise InputError(f"priors: '{key}' = {value}: a one-sigma size is above zero")
        sizes[name] = float(value * factor)
    own = replace(cell.robot.priors, sizes=tuple(sizes.items()))
    return replace(cell, robot=replace(cell.robot, priors=own))
