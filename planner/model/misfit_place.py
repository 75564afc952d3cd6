"""Where what no named cause explains is largest, and what it acts like, as the document says it."""

from planner.common.units import to_deg, to_mm
from planner.model.document_section import SectionOfJoint


def _mm(value: float) -> str:
    return f"{float(to_mm(value)):.3f}"


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
    """How much of the tool's motion, or of its error, no named cause explains over the workspace [m], rms.

    Attributes:
        anywhere: over the workspace.
        there, joint, range: where a joint, from 1, is within a range [rad]; ``None`` where it is nearly even.
        within: where it is more still: another joint's range, the first one within its own; ``None`` where it is not.
        elsewhere: outside these ranges.
        least, most: where it is nearly even, over the quarters of every joint's range.
        like: what acts like it, in words; ``None`` where no one law makes up most of it, or it was not asked for.
    """

    if_any = ("there", "joint", "range", "slides", "within", "elsewhere", "least", "most", "like")
    anywhere: float
    there: float | None = None
    joint: int | None = None
    range: tuple[float, float] | None = None
    within: MisfitRange | None = None
    elsewhere: float | None = None
    least: float | None = None
    most: float | None = None
    like: str | None = None

    def text(self, joints: int = 2, unit: str = "") -> str:
        """Say where it is most, by so many ``joints`` at most, how much there and elsewhere, or that it is even."""
        if not (ranges := self.ranges[:joints]):
            ends = "" if self.least is None or self.most is None else f" ({_mm(self.least)} to {_mm(self.most)} mm)"
            return f"nearly even{ends}"
        elsewhere = "" if self.elsewhere is None else f", else {_mm(self.elsewhere)}"
        return f"most with {', '.join(r.text for r in ranges)} ({_mm(ranges[-1].there)}{elsewhere}{unit})"

    @property
    def ranges(self) -> tuple[MisfitRange, ...]:
        """The ranges of joints in which it is most, the widest first."""
        if self.there is None or self.joint is None or self.range is None:
            return ()
        first = MisfitRange(there=self.there, joint=self.joint, range=self.range, slides=self.slides)
        return (first,) if self.within is None else (first, self.within)
