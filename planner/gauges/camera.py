"""A camera that sees a flat board: on the flange with the board standing, or standing with the board on the flange."""

from dataclasses import dataclass
from pathlib import Path
from typing import Self, cast

from planner.cell.file import CellFile
from planner.cell.gauge_registry import register_gauge
from planner.common.errors import InputError
from planner.gauges.vision.board_camera import BoardCamera
from planner.gauges.vision.free_lens import FreeLensCamera
from planner.kinematics.robot import Robot


@register_gauge
@dataclass(frozen=True)
class Camera(BoardCamera):
    """A camera as a cell file has it."""

    @classmethod
    def read(cls, path: Path, robot: Robot, file: CellFile, planning: bool) -> Self:
        """Return the camera; where the run is to find its lens, one that keeps more of each image.

        Raises:
            InputError: the board has too few corners for that.
        """
        made = super().read(path, robot, file, planning)
        if not made.lens_free:
            return made
        if len(made.board) < FreeLensCamera.width:
            raise InputError(
                f"{path}: 'gauge.lens.free' needs a board of {FreeLensCamera.width} corners or more, and the "
                f"{made.board} has {len(made.board)}: calibrate the lens beforehand"
            )
        return cast(Self, FreeLensCamera(**made.fields_by_name))
