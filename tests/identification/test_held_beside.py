"""Causes that the posterior holds and no stage has: named with their probabilities, and no gear twice."""

from planner.identification.held_beside import held_beside, held_text
from planner.model.identification_document import Finding, SizeOfFamily

FAMILIES = tuple(
    SizeOfFamily(name=name, factor=0.3, probability=p)
    for name, p in (
        ("lengths", 1.0),
        ("soft base, base", 0.97),
        ("gauge of any shape (background)", 1.0),
        ("backlash by load, joint 5 (background)", 0.75),
        ("gear ripple, joint 2 (background)", 0.998),
        ("gear harmonics, joint 4 (background)", 0.9),
        ("misfit, part 5 by gravity (background)", 0.8),
        ("joint 6 by joint 3 (background)", 0.7),
        ("link growth (background)", 0.2),
    )
)


def finding(effect, on):
    return Finding(effect=effect, on=on, value=1e-4, unit="rad")


def test_likely_causes_of_the_background_are_named_the_likeliest_first():
    assert [f.name for f in held_beside(FAMILIES, ())] == [
        "gear ripple, joint 2", "gear harmonics, joint 4", "backlash by load, joint 5",
    ]  # fmt: skip


def test_the_bands_of_a_gear_that_was_found_are_that_finding():
    found = (finding("gear error curve", "joint 4"), finding("joint compliance", "joint 2"))
    assert held_text(FAMILIES, found) == "gear ripple, joint 2 (99 %), backlash by load, joint 5 (75 %)"
    assert held_text(FAMILIES[:3], found) == ""
