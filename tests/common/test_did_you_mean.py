"""The nearest of what there is, for a word that is not there."""

import pytest

from planner.common.errors import did_you_mean
from planner.effects.catalogue import effect_kinds


@pytest.mark.parametrize(
    ("word", "meant"),
    [
        ("gear riple", "gear ripple"),  # a slip of the pen
        ("wobble", "axis wobble"),  # one word of four
        ("growth of a link", "link growth"),  # its words in another order
        ("play of the base plate", "soft base"),  # at least its place
        ("something quite different", ""),
        ("xqz", ""),
    ],
)
def test_an_effect_that_is_called_otherwise(word, meant):
    said = did_you_mean(word, list(effect_kinds()))
    assert said.startswith(f'; did you mean "{meant}') if meant else not said
