"""The page says the sizes of many causes of one kind as the screen does."""

from planner.model.finding import Finding
from planner.model.finding_groups import list_causes
from planner.service.page_content import finding_size


def test_no_deviation_of_what_they_have_in_common_stands_behind_their_sizes():
    """Each is known to 0.5 %; the spread of three draws is known to 40 %, which is no deviation of any of them."""
    own = [
        Finding(effect="backlash", on=f"joint {k}", value=1e-6 * v, std=1e-6 * s, unit="rad", probability=0.99)
        for k, v, s in ((1, 150.2, 0.48), (2, 121.04, 0.65), (5, 297.7, 1.9))
    ]
    (cause,) = list_causes(own)
    said = finding_size(cause, "mm")
    assert "±" not in said
    assert said.startswith("0.00694 to 0.0171 deg (root mean square 0.0117)")
    assert "±" in finding_size(own[0], "mm")
