"""Figures of accuracy and precision: a run of a tracker against a robot, and repeated centrings of one pose."""

from planner.accuracy.figures import Figures, figures
from planner.accuracy.precision import Precision, groups_of, precision, precision_of_run
from planner.accuracy.tracker import Registered, Stand, errors_of, registered, stand_of

__all__ = [
    "Figures",
    "Precision",
    "Registered",
    "Stand",
    "errors_of",
    "figures",
    "groups_of",
    "precision",
    "precision_of_run",
    "registered",
    "stand_of",
]
