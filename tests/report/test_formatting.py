"""Sentences of reports."""

from types import SimpleNamespace

from planner.report.formatting import nearest_pair_text


def test_an_arm_without_bodies_has_no_nearest_pair():
    assert nearest_pair_text(SimpleNamespace(clearance=float("inf"))) == "no pair of bodies to look at"
    assert nearest_pair_text(SimpleNamespace(clearance=0.0123)) == "nearest pair 12.3 mm apart"
