"""What more poses of a robot would bring, as ``identification.json`` foresees it."""

from planner.model.document_section import DocumentSection


class MorePoses(DocumentSection):
    """What a session more would leave, the gauge left standing.

    Attributes:
        poses: so many.
        minutes: that they take at the pace of the run; ``None`` where it has no clock.
        anywhere: error of the tool over the workspace [m] that is as likely exceeded as not.
        at_most: what it stays below with a probability of 95 % [m].
    """

    if_any = ("minutes",)
    poses: int
    minutes: float | None = None
    anywhere: float
    at_most: float

    @property
    def sentence(self) -> str:
        """What a person at the cell is told."""
        minutes = "" if self.minutes is None else f", about {self.minutes:.0f} min,"
        return (
            f"{self.poses} more poses{minutes} would bring it to {1e3 * self.anywhere:.3f} mm (95 % sure below "
            f"{1e3 * self.at_most:.3f} mm)"
        )
