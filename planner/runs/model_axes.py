"""Angles that a controller has logged in its own axes, turned into the joints of the robot's model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from planner.common.errors import InputError
from planner.common.lazy_modules import pl
from planner.common.units import Array
from planner.kinematics.axes import MODEL, AxisConvention
from planner.kinematics.axes_line import KEY
from planner.runs.table import RunTable

AxesOf = Callable[[str], AxisConvention]
"""Returns how the controller of a language counts; raises InputError where the robot's file does not say it."""


def in_model_axes(table: RunTable, axes_of: AxesOf | None) -> RunTable:
    """Return a table whose joint angles are the model's; the file says by ``# axes_of: LANGUAGE`` whose they are.

    Directions of the last movement are turned where no axis counts with others, and left out where one does.

    Raises:
        InputError: nobody says how that controller counts, or angles of some axes are missing.
    """
    language = table.notes.get(KEY, MODEL)
    if language == MODEL:
        return table
    if axes_of is None:
        raise InputError(
            f"{table.source.file}: says '{KEY}: {language}', but not of which robot: how that controller counts is "
            'said by the file of a robot; name it by the cell, or in the map by robot = "NAME"'
        )
    axes = axes_of(language)
    notes = {key: value for key, value in table.notes.items() if key != KEY}
    zero, inverse = axes.zero, axes.inverse
    frame, warnings = table.frame, list(table.warnings)
    for stem in ("q", "cmd"):
        if _is_there(table, stem, axes.n_axes):
            frame = frame.with_columns(_combine_columns(stem, inverse, -inverse @ zero))
    if _is_there(table, "torque", axes.n_axes):
        frame = frame.with_columns(_combine_columns("torque", axes.matrix.T, np.zeros(axes.n_axes)))
    if _is_there(table, "direction", axes.n_axes) and axes.is_coupled:
        frame = frame.drop([f"direction{j}" for j in range(1, axes.n_axes + 1)])
        warnings.append(
            f"{table.source.name}: the directions of the last movement are of axes that count with others; "
            "they were left out"
        )
    elif _is_there(table, "direction", axes.n_axes):
        frame = frame.with_columns(_combine_columns("direction", np.sign(inverse), np.zeros(axes.n_axes)))
    units = dict(table.units) | _model_units(table, inverse)
    return replace(table, frame=frame, units=units, notes=notes, warnings=tuple(warnings))


def _model_units(table: RunTable, inverse: Array) -> dict[str, str]:
    """Return the unit of each joint's columns: that of the axis which the joint follows, where it is a length."""
    axis = np.abs(inverse).argmax(axis=1)
    keys = [(f"{stem}{j + 1}", f"{stem}{k + 1}") for stem in ("q", "cmd") for j, k in enumerate(axis)]
    return {own: table.units[of] for own, of in keys if of in table.units}


def _is_there(table: RunTable, stem: str, n: int) -> bool:
    """Tell whether a quantity of all axes is there.

    Raises:
        InputError: it is there of some axes only, or of more.
    """
    names = [f"{stem}{j}" for j in range(1, n + 1)]
    there = [name for name in names if table.has(name)]
    if there and (len(there) < n or table.has(f"{stem}{n + 1}")):
        found = "more" if len(there) == n else f"only {', '.join(there)}"
        raise InputError(f"{table.source.file}: the axes of a robot of {n} joints are to be turned, found are {found}")
    return bool(there)


def _combine_columns(stem: str, matrix: Array, offset: Array) -> list[pl.Expr]:
    """Return each column of a quantity as a sum of all of them; a blank stays a blank."""
    out = []
    for j, (row, shift) in enumerate(zip(matrix, offset, strict=True), start=1):
        terms = [pl.col(f"{stem}{k + 1}") * float(row[k]) for k in np.flatnonzero(row)]
        out.append((sum(terms[1:], terms[0]) + float(shift)).alias(f"{stem}{j}"))
    return out
