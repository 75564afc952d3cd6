"""Fake targets: what to tell a controller that believes in the nominal robot, so that the real one stands right.

    done = compensate_file(Path("part.src"), nominal, calibrated)
    planner.files.write_text(folder / done.name, done.text, done.encoding)

``corrected_joints`` is the solver for any robots that answer as a :class:`Poser`; the readers under ``formats`` only
say where in a file the numbers of the targets stand.
"""

from planner.compensation.file import CompensatedFile, compensate_file
from planner.compensation.poser import NominalPoser, Poser
from planner.compensation.report import CompensationReport
from planner.compensation.solving import Correction, corrected_joints
from planner.compensation.targets import Frames

__all__ = [
    "CompensatedFile",
    "CompensationReport",
    "Correction",
    "Frames",
    "NominalPoser",
    "Poser",
    "compensate_file",
    "corrected_joints",
]
