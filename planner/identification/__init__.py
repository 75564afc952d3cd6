"""From a measured run to a calibrated robot: fit, covariance, held-out errors."""

from planner.identification.fit import Fit, fit
from planner.identification.identify import Settings, identify
from planner.identification.problem import Problem
from planner.identification.splits import Split, split
from planner.identification.types import Calibration, Estimate, Metrics, Stage, error_size

__all__ = [
    "Calibration",
    "Estimate",
    "Fit",
    "Metrics",
    "Problem",
    "Settings",
    "Split",
    "Stage",
    "error_size",
    "fit",
    "identify",
    "split",
]
