"""A flat board of corners that a camera finds: ChArUco, AprilTags, or one marker; where its corners lie."""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, PositiveFloat, model_validator

from planner.common.schema import StrictModel
from planner.common.units import MM, Array, IntArray, read_only

BoardKind = Literal["charuco", "tags", "marker"]
Count = Annotated[int, Field(ge=1, le=100)]


class BoardFile(StrictModel):
    """``[gauge.board]``, and the file ``board.toml`` of ``edbb import --images``.

    ``charuco`` is a chessboard of ``columns`` × ``rows`` squares with markers in the white ones, ``tags`` a grid of
    markers ``gap_mm`` apart, ``marker`` one of them. Markers are numbered from ``first`` on, as OpenCV draws them.
    ``legacy``: a ChArUco board as OpenCV drew it before 4.6: with an even number of rows its top left square is white.
    """

    kind: BoardKind
    columns: Count = 1
    rows: Count = 1
    square_mm: PositiveFloat | None = None
    marker_mm: PositiveFloat
    gap_mm: PositiveFloat | None = None
    dictionary: str = "DICT_4X4_50"
    first: Annotated[int, Field(ge=0)] = 0
    legacy: bool = False
    scale_ppm: Annotated[float, Field(gt=0, le=20_000)] = (
        300.0  # one sigma of its size: a calliper, 0.05 mm over 170 mm
    )

    @model_validator(mode="after")
    def _check_whole(self) -> "BoardFile":
        if self.kind == "charuco" and (self.square_mm is None or self.square_mm <= self.marker_mm):
            raise ValueError("a charuco board needs square_mm, larger than marker_mm")
        if self.kind == "charuco" and min(self.columns, self.rows) < 3:
            raise ValueError("a charuco board has at least 3 columns and 3 rows of squares")
        if self.legacy and self.kind != "charuco":
            raise ValueError("legacy is for a charuco board: tags and markers are drawn as they always were")
        if self.kind == "tags" and self.gap_mm is None:
            raise ValueError("a board of tags needs gap_mm, from the edge of one to the next")
        if self.kind == "marker" and (self.columns, self.rows) != (1, 1):
            raise ValueError("one marker has no columns and rows")
        return self

    @property
    def board(self) -> "Board":
        """The board in SI units."""
        return Board(self)


@dataclass(frozen=True)
class Board:
    """A board: its corners lie in the plane z = 0 of its frame, origin in their middle, x right, y up, z to whom looks.

    Attributes:
        file: what it is.
    """

    file: BoardFile

    @cached_property
    def corners(self) -> Array:
        """Corners in the order of their numbers, (K, 3) [m]: row by row from the top left one.

        Of markers each has four, from its top left one clockwise as it is read.
        """
        tag_corners = np.array(
            [[-0.5, 0.5], [0.5, 0.5], [0.5, -0.5], [-0.5, -0.5]]
        )  # of a marker, in its sides, as it is read
        f = self.file
        pitch = (f.square_mm or f.marker_mm + (f.gap_mm or 0.0)) * MM
        columns, rows = (f.columns - 1, f.rows - 1) if f.kind == "charuco" else (f.columns, f.rows)
        right, down = (np.arange(n) - (n - 1) / 2 for n in (columns, rows))
        middles = np.stack(np.meshgrid(right, -down), axis=-1).reshape(-1, 2) * pitch
        if f.kind != "charuco":
            middles = (middles[:, None] + tag_corners * f.marker_mm * MM).reshape(-1, 2)
        return read_only(np.column_stack([middles, np.zeros(len(middles))]))

    @cached_property
    def markers(self) -> IntArray:
        """Numbers of its markers: of a chessboard every second square, the first one black, has one."""
        f = self.file
        count = f.columns * f.rows // 2 if f.kind == "charuco" else f.columns * f.rows
        return read_only(np.arange(f.first, f.first + count), np.int64)

    @cached_property
    def radius(self) -> float:
        """Radius of the circle about the board's middle that holds all corners [m]."""
        return float(np.linalg.norm(self.corners, axis=1).max())

    def __len__(self) -> int:
        """Return the number of its corners K."""
        return len(self.corners)

    def __str__(self) -> str:
        f = self.file
        if f.kind == "marker":
            return f"marker of {f.marker_mm:g} mm"
        of = f"squares of {f.square_mm:g} mm" if f.kind == "charuco" else f"markers of {f.marker_mm:g} mm"
        name = "ChArUco board" if f.kind == "charuco" else "board of tags"
        return f"{name}, {f.columns} × {f.rows} {of}"
