"""From a measured run to a calibrated robot: fit, covariance, held-out errors."""

from planner.identification.bench import Bench, Tracer
from planner.identification.fit import Fit, fit
from planner.identification.identify import Settings, identify
from planner.identification.problem import Problem
from planner.identification.splits import Split, split
from planner.identification.types import Calibration, Estimate, Finding, Limit, Metrics, Stage, Traced, error_size

__all__ = [
    "Bench",
    "Calibration",
    "Estimate",
    "Finding",
    "Fit",
    "Limit",
    "Metrics",
    "Problem",
    "Settings",
    "Split",
    "Stage",
    "Traced",
    "Tracer",
    "error_size",
    "fit",
    "identify",
    "split",
]
