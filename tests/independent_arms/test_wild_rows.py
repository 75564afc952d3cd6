"""Arms of foreign simulators, measured with wild rows and without: what is released and stated is the same."""

import pytest

from tests.benchmarks.wild_rows import compare


@pytest.mark.long
@pytest.mark.parametrize(
    ("world_name", "off"), [("kr6-tracker", (0.3, 1.0)), ("ur10-bar", (5.0, 5.0)), ("wire", (50.0, 50.0))]
)
def test_what_is_released_and_stated_is_that_of_the_run_without_its_wild_rows(world_name, off):
    """The whole command: causes sought, posterior, true error over the workspace; many arms in the benchmark."""
    pair = compare(world_name, 2, off)
    for key in ("true", "stated", "bound"):
        assert pair["with"][key] == pytest.approx(pair["without"][key], rel=0.25)
    assert set(pair["rows"]) <= set(pair["with"]["outliers"])
