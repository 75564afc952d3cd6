"""Centrings that no real head could have made: the drawn robot is too far off for it."""

from dataclasses import replace

import numpy as np

from planner.cell import Cell
from planner.run import Samples
from planner.simulation.measuring import SimulatedRun
from planner.units import MM


def told_impossible(cell: Cell, run: SimulatedRun, planned: Samples) -> SimulatedRun:
    """Return the run, warned of balls that were met too far off centre; ``planned`` is where the arm was sent."""
    head = cell.gauge.head
    if run.readings.ball is None or head is None:
        return run
    apart = np.linalg.norm(cell.map_position(run.samples.q) - cell.map_position(planned.q), axis=1)
    far = int((apart > head.usable).sum())
    if not far:
        return run
    said = (
        f"{far} of {len(run)} balls were met more than {head.usable / MM:g} mm off centre (largest "
        f"{apart.max() / MM:.1f}), where the head does not measure: this robot is further off than "
        f"gauge.head.uncalibrated_mm = {head.uncalibrated / MM:g} says; give smaller errors with --truth"
    )
    return replace(run, warnings=(*run.warnings, said))
