"""Where what no named cause explains moves the tool most, as the document says it."""

from planner.common.units import to_deg
from planner.model.document_section import SectionOfJoint


class MisfitRange(SectionOfJoint):
    """How far it moves the tool [m], rms, where a joint, from 1, is within a range [rad]."""

    if_any = ("slides",)
    there: float
    joint: int
    range: tuple[float, float]

    @property
    def text(self) -> str:
        """The joint and its range, in words."""
        low, high = (f"{to_deg(v):.0f}" for v in self.range)
        return f"joint {self.joint} at {low}…{high}{self.unit}"


class MisfitPlace(SectionOfJoint):
    """How far what no named cause explains moves the tool over the workspace [m], rms, and where most.

    Attributes:
        anywhere: over the workspace.
        there, joint, range: where a joint, from 1, is within a range [rad]; ``None`` where it is alike everywhere.
        within: where it is more still: another joint's range, the first one within its own; ``None`` where it is not.
    """

    if_any = ("there", "joint", "range", "slides", "within")
    anywhere: float
    there: float | None = None
    joint: int | None = None
    range: tuple[float, float] | None = None
    within: MisfitRange | None = None

    @property
    def ranges(self) -> tuple[MisfitRange, ...]:
        """The ranges of joints in which it is most, the widest first."""
        if self.there is None or self.joint is None or self.range is None:
            return ()
        first = MisfitRange(there=self.there, joint=self.joint, range=self.range, slides=self.slides)
        return (first,) if self.within is None else (first, self.within)
