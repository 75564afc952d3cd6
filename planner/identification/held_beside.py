"""Causes of the catalogue that the posterior holds and no stage has: likely ones, each too faint for one of its own."""

from collections.abc import Iterator, Sequence

from planner.identification.assumptions import STANDING_PROBABILITY
from planner.identification.posterior_background import GAUGE_SHAPE, OF_BACKGROUND, UNNAMED
from planner.model.finding_groups import percent
from planner.model.identification_document import Finding, SizeOfFamily

OF_GEARS = ("gear ", "encoder ")  # first words of families, and of findings, that are the unevenness of one gear


def held_beside(families: Sequence[SizeOfFamily], findings: Sequence[Finding]) -> tuple[SizeOfFamily, ...]:
    """Return the causes of the background that are likelier to act than not, the likeliest first.

    The bands in which the background has a gear that was found by name are that finding.
    """
    found = {f.on for f in findings if f.effect.startswith(OF_GEARS)}
    return tuple(sorted(_likely(families, found), key=lambda f: -f.probability))


def _likely(families: Sequence[SizeOfFamily], gears: set[str]) -> Iterator[SizeOfFamily]:
    for f in families:
        name = f.name.removesuffix(OF_BACKGROUND)
        nameless = name.startswith((UNNAMED, "joint ")) or name == GAUGE_SHAPE
        known = name.startswith(OF_GEARS) and name.partition(", ")[2] in gears
        if name != f.name and f.probability >= STANDING_PROBABILITY and not nameless and not known:
            yield f.model_copy(update={"name": name})


def held_text(families: Sequence[SizeOfFamily], findings: Sequence[Finding]) -> str:
    """Name these causes with their probabilities; empty where there are none."""
    return ", ".join(f"{f.name} ({percent(f.probability)})" for f in held_beside(families, findings))
