"""All files of one program corrected together, whichever of them is named: every one, or none."""

from pathlib import Path
from typing import TypedDict, Unpack

from planner.common.errors import InputError
from planner.compensation.compensated_file import CompensatedFile, compensate_file
from planner.compensation.correction import FlangeModel
from planner.compensation.correction_mark import CorrectionMark
from planner.compensation.few_axes import TurnWeights
from planner.compensation.targets import ToolAndBase, list_lines
from planner.kinematics.robot import Robot


class Options(TypedDict, total=False):
    """What :func:`compensate_file` may be told."""

    dialect: str | None
    frames: ToolAndBase
    strict: bool
    mark: CorrectionMark | None
    again: bool
    measuring: bool
    axes_of: str | None
    turn_weights: TurnWeights


def compensate_program(
    path: Path, nominal: Robot, calibrated: FlangeModel, **options: Unpack[Options]
) -> tuple[CompensatedFile, ...]:
    """Correct a file and all that belong to its program, as :func:`compensate_file` does each; the named one is first.

    Raises:
        InputError: as for each file, or none of them holds a target that is corrected.
        NoSolutionError: as for each file.
    """
    first = compensate_file(path, nominal, calibrated, **options)
    done = (first, *(compensate_file(other, nominal, calibrated, **options) for other in first.others))
    if not any(file.report.corrected for file in done):
        names = " and ".join(file.name for file in done)
        why = (line for file in done for line in list_lines(file.name, file.report.kept))
        raise InputError("\n".join([f"{path}: {names} hold no target that could be compensated", *why]))
    return done
