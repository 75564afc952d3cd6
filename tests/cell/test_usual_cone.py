"""A tracker turns to wherever its reflector is: without a cone of its own it sees all around; a bar's cup does not."""

import numpy as np
import pytest

from planner.cell.reading import load_cell


@pytest.mark.parametrize(
    ("cone", "tilt"), [("cone_deg = { map = 40 }", np.pi), ("cone_deg = { fixture = 50 }", np.radians(50))]
)
def test_a_cell_without_the_cone_of_its_tracker_leaves_it_open(cone, tilt, tmp_path):
    text = load_cell("panda/tracker").path.read_text()
    (tmp_path / "cell.toml").write_text(text.replace("cone_deg = { fixture = 180, map = 30 }", cone))
    assert load_cell(str(tmp_path / "cell.toml")).gauge.cone_fixture == pytest.approx(tilt)
