"""Sentences of reports."""

from types import SimpleNamespace

import pytest

from planner.report.chart import linear_ticks
from planner.report.formatting import nearest_pair_text


def test_an_arm_without_bodies_has_no_nearest_pair():
    assert nearest_pair_text(SimpleNamespace(clearance=float("inf"))) == "no pair of bodies to look at"
    assert nearest_pair_text(SimpleNamespace(clearance=0.0123)) == "nearest pair 12.3 mm apart"


@pytest.mark.parametrize("span", [(-8000.0, 8000.0), (0.0, 9.9), (-0.4, 4.9), (127.0, 131.0), (-1e-5, 3e-5)])
def test_an_axis_has_two_numbers_at_least(span):
    for most in range(2, 8):
        values, texts = linear_ticks(span, most)
        assert 2 <= len(values) <= max(most + 1, 5)
        assert [float(t) for t in texts] == pytest.approx(values, abs=1e-12)
        assert span[0] - 1e-9 <= min(values) < max(values) <= span[1] + 1e-9
