"""What a cell file says of a camera and its board: ``[gauge.lens]``, ``[gauge.board]``, ``[gauge.place]``."""

from typing import Literal

import numpy as np
from pydantic import Field, PositiveFloat, PositiveInt

from planner.cell.file import PlacedFile
from planner.common.schema import StrictModel
from planner.common.units import read_only
from planner.gauges.vision.board import BoardFile
from planner.gauges.vision.lens import Lens


class LensFile(StrictModel):
    """``[gauge.lens]``: the camera's intrinsics as OpenCV has them."""

    fx_px: PositiveFloat
    fy_px: PositiveFloat
    cx_px: float
    cy_px: float
    distortion: tuple[float, ...] = Field(default=(), max_length=5)  # k1, k2, p1, p2, k3
    width_px: PositiveInt
    height_px: PositiveInt
    free: bool = False  # whether a run finds them; the file then says where to begin

    @property
    def lens(self) -> Lens:
        """Return the lens of these keys."""
        bent = np.array([*self.distortion, *[0.0] * 5][:5])
        return Lens(
            read_only([self.fx_px, self.fy_px]),
            read_only([self.cx_px, self.cy_px]),
            read_only(bent),
            (self.width_px, self.height_px),
        )


class CameraKeys(StrictModel):
    """The keys of ``[gauge]`` that only a camera has."""

    camera: Literal["flange", "stand"]
    board: BoardFile
    lens: LensFile
    noise_px: PositiveFloat = 0.3
    place: PlacedFile | None = None
    tool_rpy_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
