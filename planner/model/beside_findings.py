"""What the document says beside findings: which are one thing together, and what was tried and not kept."""

from planner.model.document_section import DocumentSection


class ManyOfOneKind(DocumentSection):
    """Findings of one kind that are one thing: a reflector that was seated anew, play in joint after joint.

    Attributes:
        effect, on: what they have in common; ``on`` is ``joints`` where it is one effect at several joints.
        value, std, unit: root mean square of their sizes, which are draws of one random effect, and its deviation.
        findings: their positions among the document's findings, from 0.
        probability: of the least certain of them.
        note: sentence about all of them.
    """

    in_unit = ("value", "std")
    if_any = ("probability",)
    effect: str
    on: str
    value: float
    std: float
    unit: str
    findings: tuple[int, ...]
    probability: float | None = None
    note: str = ""


class RejectedEffect(DocumentSection):
    """An effect that was tried in full and not kept."""

    name: str
    because: str
