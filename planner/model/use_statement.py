"""What a calibrated robot is good enough for, as ``identification.json`` states it."""

from typing import Literal

from planner.model.document_section import DocumentSection

UseAnswer = Literal["yes", "no", "not known"]
ToolName = Literal["measured", "own", "another"]


class ToolUse(DocumentSection):
    """How good programs are that were made without the robot (offline), with one tool.

    Attributes:
        tool: the one whose point was measured, the robot's own, or any that was not measured.
        targets_within, targets_within_before: what 95 of 100 targets of the workspace stay within [m], with a
            probability of 95 %, of the robot as it is written and of the nominal one.
        share, share_before: of the targets within the tolerance that is asked for, as likely more as less.
        answer: whether 95 of 100 targets are within it; yes or no with a probability of 95 %.
    """

    if_any = ("share", "share_before", "answer")
    tool: ToolName
    targets_within: float
    targets_within_before: float
    share: float | None = None
    share_before: float | None = None
    answer: UseAnswer | None = None


class Use(DocumentSection):
    """What a robot is good enough for.

    Attributes:
        tolerance: that was asked for [m]; the file holds the section only where one was.
        repeatability: of the arm, by its file [m]: so well do poses come back that are led to by hand.
        repeatability_assumed: true where its file does not say it; else left out.
        tools: the measured one first.
    """

    if_any = ("tolerance_mm", "repeatability_assumed")
    tolerance: float | None = None
    repeatability: float
    repeatability_assumed: bool | None = None
    tools: tuple[ToolUse, ...]
