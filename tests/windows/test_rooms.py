"""Rooms' own tests, run by Python for Windows without the packages of planning."""

import os
import re

import pytest

from tests.windows.wine import PATIENCE_S, ROOT

pytestmark = pytest.mark.long
CHOSEN = ("common", "runs")
ALL = (*CHOSEN, "programs", "compensation", "report", "identification", "cli")
"""With ``EDBB_ALL_TRIALS``: about an hour."""
SHARE = 0.5  # of the tests have to run at least: others need a package or a system that is not there


@pytest.mark.parametrize("room", ALL if os.environ.get("EDBB_ALL_TRIALS") else CHOSEN)
def test_a_room_passes_on_windows(wine, room):
    words = ("-m", "pytest", "-o", "addopts=", "-q", "-p", "no:cacheprovider", "-m", "not long", f"tests/{room}")
    code, said = wine.run(wine.testing_python(), *words, cwd=ROOT, timeout=4 * PATIENCE_S)
    assert code == 0, said[-6000:]
    count = {what: int(number) for number, what in re.findall(r"(\d+) (passed|skipped)", said)}
    assert count["passed"] >= SHARE * sum(count.values())
