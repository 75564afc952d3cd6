"""Errors on held-out readings in the unit of what the gauge shows, where that is no length: pixels of a camera."""

from planner.common.units import Array
from planner.documents.calibration import Calibration


def own_errors_text(found: Calibration) -> str:
    """Say how far held-out readings are off in the gauge's own unit, before and after; empty where it is millimetres.

    Before is the robot as its data sheet has it, the gauge placed on it; after is the robot as it is written.
    """
    fit, run = found.fit, found.run
    gauge = fit.setup.gauge
    shown = gauge.reading_numbers(run.samples, run.readings)
    if shown is None:
        return ""
    fitted = shown - fit.model.full_reading(run.samples, fit.errors)

    def size(left: Array) -> float:
        """Return the rms error of a fit in the gauge's own numbers."""
        return gauge.own_errors(fit.setup, run.samples, fitted, left)

    before = found.placed_stage
    return gauge.own_errors_text(size(before.held_residual), size(found.written_stage.held_residual), fit.values)
