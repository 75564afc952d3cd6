"""Lines above the columns of a run: what is written is read again, and what is wrong is named with its line."""

import numpy as np
import pytest

from planner.accuracy.precision import check_mastering
from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.runs.run import ReferenceReadings, read_reference_readings

COLUMNS = "q1_deg,x_mm,y_mm,z_mm\n1,2,3,4\n"


def test_lines_come_back(tmp_path):
    rng = np.random.default_rng(0)
    said = ReferenceReadings(tuple((n, rng.normal(0, 1, 3)) for n in ("N1", "left one")), (rng.normal(6e-3, 1e-6, 3),))
    path = tmp_path / "run.csv"
    path.write_text("# robot: x\n" + "".join(f"# {line}\n" for line in said.lines()) + COLUMNS)
    found = read_reference_readings(path)
    assert [n for n, _ in found.nests] == ["N1", "left one"]
    assert np.allclose([p for _, p in found.nests], [p for _, p in said.nests], atol=1e-9)
    assert np.allclose(found.masters, said.masters, atol=1e-9)
    path.write_text(COLUMNS)
    assert read_reference_readings(path) == ReferenceReadings()


@pytest.mark.parametrize(
    "line", ["# nest_mm: N1, 1, 2", "# nest_mm: N1, 1, 2, x", "# master_mm: 6.35", "# nest_mm: N1, 1, 2, nan"]
)
def test_a_wrong_line_is_named(tmp_path, line):
    path = tmp_path / "run.csv"
    path.write_text(f"# robot: x\n{line}\n{COLUMNS}")
    with pytest.raises(InputError, match=rf"run.csv, line 2: '{line}' should be '# nest_mm: NAME, x, y, z'"):
        read_reference_readings(path)


def test_the_master_ball_shows_6_350_mm_on_each_indicator():
    """TriCal paper, 2.1: half of 1.5 in less half of 1 in."""
    cell = load_cell("kuka-kr6-r700/trical")
    first, last = np.array([6.3505, 6.350, 6.349]) / 1e3, np.array([6.354, 6.350, 6.351]) / 1e3
    good = check_mastering(cell, ReferenceReadings(masters=(first,)))
    assert good.wanted == pytest.approx(6.350e-3)
    assert np.allclose(good.off, [[0.5e-6, 0, -1e-6]], atol=1e-12)
    assert good.good
    assert "1 check of the master ball: at most 1.0 µm from 6.350 mm" in good.text()
    drifted = check_mastering(cell, ReferenceReadings(masters=(first, last)))
    assert np.allclose(drifted.drift, [3.5e-6, 0, 2e-6], atol=1e-12)
    assert not drifted.good
    assert "master the indicators again" in drifted.text()
    assert check_mastering(cell, ReferenceReadings()) is None
