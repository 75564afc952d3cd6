"""What a calibration comes to, as screen, page and document say it: a verdict, a figure, causes, what to do next."""

from planner.model.document_section import DocumentSection
from planner.model.use_statement import ToolName, UseAnswer
from planner.model.use_text import TOOLS, bound_text, targets_text


class CauseLine(DocumentSection):
    """A cause of the robot's errors in a line: what, how large, and how sure that is."""

    what: str
    size: str
    how_sure: str


class NextStep(DocumentSection):
    """Something to do, and what it brings: from how many millimetres to how many, and how long it takes."""

    what: str
    brings: str


class CalibrationSummary(DocumentSection):
    """The five things that a person asks for first.

    Attributes:
        answer: whether 95 of 100 targets are within the tolerance; "not known" too where none was stated.
        headline: the same as a title.
        because: what the answer rests on, in a sentence.
        as_planned: whether it is what the plan expected; ``None`` without a plan.
        planned: what the plan expected, and why it is not so.
        tolerance: that was stated [m]; ``None`` where none was.
        tool: with which tool; the figure and the next steps are of this one.
        targets_within, targets_within_before: what 95 of 100 targets stay within [m]; ``None`` where nothing is known.
        other_tool_within: the same with any other tool.
        causes: three at most, the likeliest first.
        next_steps: two at most, what brings most first.
    """

    if_any = ("as_planned", "planned", "tolerance_mm", "within_mm", "within_before_mm", "other_tool_within_mm")
    answer: UseAnswer
    headline: str
    because: str
    as_planned: bool | None = None
    planned: str | None = None
    tolerance: float | None = None
    tool: ToolName
    targets_within: float | None = None
    targets_within_before: float | None = None
    other_tool_within: float | None = None
    causes: tuple[CauseLine, ...] = ()
    next_steps: tuple[NextStep, ...] = ()

    @property
    def figure(self) -> str:
        """The one figure, with its unit; empty where nothing is known."""
        return "" if self.targets_within is None else bound_text(self.targets_within)

    @property
    def meaning(self) -> str:
        """What the figure means, as far as the headline does not say it, and what another tool makes of it."""
        if self.targets_within is None or self.targets_within_before is None:
            return ""
        said = "" if self.tolerance is None else f"{self._targets}, "
        return f"{said}with {TOOLS[self.tool]}, 95 % sure{self._other_tool}"

    @property
    def line(self) -> str:
        """The same in a line of the screen: with the measured tool point, or which tool it is."""
        with_tool = "" if self.tool == "measured" else f", with {TOOLS[self.tool]}"
        return f"{self._targets}{with_tool}, 95 % sure{self._other_tool if self.tool == 'measured' else ''}"

    @property
    def _targets(self) -> str:
        return targets_text(self.targets_within or 0.0, self.targets_within_before or 0.0, "this robot")

    @property
    def _other_tool(self) -> str:
        return "" if (o := self.other_tool_within) is None else f"; with {TOOLS['another']} {bound_text(o)}"
