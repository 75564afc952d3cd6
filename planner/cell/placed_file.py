"""The sections of the cell file that gauges without a bar have: a head of indicators, its balls, a tracker."""

from typing import ClassVar

from pydantic import PositiveFloat

from planner.bodies import BodyFile, Vector
from planner.cell.grown import Grown
from planner.schema import Strict


class HeadFile(Strict):
    """``[gauge.head]``: three indicators whose axes meet at right angles in the MAP (TriCal paper, 2.1)."""

    indicators: tuple[Vector, Vector, Vector]  # from the MAP to each indicator, in the flange frame
    range_mm: PositiveFloat = 12.5
    usable_mm: PositiveFloat = 5.0
    tip_mm: PositiveFloat = 11.5
    approach_mm: PositiveFloat = 40.0
    master_mm: PositiveFloat = 38.1
    uncalibrated_mm: PositiveFloat = 4.0
    centre_s: PositiveFloat = 30.0


class BallFile(Grown):
    """``[[balls]]``: one ball or socket of an artifact, in the plate's own frame; its stem leads to ``stem_to_mm``."""

    name: str
    position_mm: Vector
    radius_mm: PositiveFloat = 12.7
    stem_to_mm: Vector | None = None
    stem_radius_mm: PositiveFloat = 5.0
    LATER: ClassVar[tuple[str, ...]] = ("radius_mm", "stem_to_mm", "stem_radius_mm")


class PlacedFile(Strict):
    """Where something stands in the base frame, and how well that is known before measuring (one sigma)."""

    position_mm: Vector
    rpy_deg: Vector = (0.0, 0.0, 0.0)
    prior_mm: PositiveFloat = 1.0
    prior_deg: PositiveFloat = 0.1


class ArtifactFile(PlacedFile):
    """``[artifact]``: the plate that carries the balls; bodies in its own frame."""

    bodies: tuple[BodyFile, ...] = ()


class NestFile(Strict):
    """``[[tracker.nests]]``: a nest in the artifact's frame (the base's without one), and as the tracker read it."""

    name: str
    position_mm: Vector
    read_mm: Vector | None = None


class TrackerFile(PlacedFile):
    """``[tracker]``: where the tracker stands, and the nests that tie its frame to the artifact's or the base's."""

    prior_mm: PositiveFloat = 2.0
    beam_radius_mm: PositiveFloat = 3.0
    nests: tuple[NestFile, ...] = ()
