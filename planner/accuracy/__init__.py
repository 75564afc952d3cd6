"""Figures of accuracy and precision: a run of a tracker against a robot, and repeated centrings of one pose."""

from planner.accuracy.arms import Arm, calibrated_arm, nominal_arm
from planner.accuracy.figures import Figures, figures
from planner.accuracy.floor import Floor, floor_of
from planner.accuracy.mastering import Mastering, mastering
from planner.accuracy.precision import Precision, Repeats, groups_of, precision, repeats_of_run
from planner.accuracy.tracker import Registered, Stand, errors_of, registered, stand_of
from planner.accuracy.validation import Judged, Validation, validated

__all__ = [
    "Arm",
    "Figures",
    "Floor",
    "Judged",
    "Mastering",
    "Precision",
    "Registered",
    "Repeats",
    "Stand",
    "Validation",
    "calibrated_arm",
    "errors_of",
    "figures",
    "floor_of",
    "groups_of",
    "mastering",
    "nominal_arm",
    "precision",
    "registered",
    "repeats_of_run",
    "stand_of",
    "validated",
]
