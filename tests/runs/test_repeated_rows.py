"""Samples that stand twice: a copied file, pasted rows; honest repeats of a gauge are neither."""

import shutil

import numpy as np
import pytest

from planner.common.errors import InputError
from planner.runs.loader import load_runs

HEAD = "q1_deg,q2_deg,length_mm"


def written(path, rows):
    path.write_text("\n".join(["# measure: static", HEAD, *rows]) + "\n")
    return path


def rows_of(rng, n, decimals=4):
    return [f"{a:.3f},{b:.3f},{length:.{decimals}f}" for a, b, length in rng.uniform(100, 500, (n, 3))]


def repeated_notes(path):
    return [w for w in load_runs([path], 2).warnings if "pasted twice" in w]


def test_pasted_rows_are_named(tmp_path):
    rows = rows_of(np.random.default_rng(1), 40)
    (said,) = repeated_notes(written(tmp_path / "run.csv", [*rows, *rows[10:20]]))
    assert said.startswith("10 rows repeat earlier ones")
    assert "run.csv, line 43 that of run.csv, line 13" in said
    assert not repeated_notes(written(tmp_path / "clean.csv", rows))


@pytest.mark.parametrize("noise_mm", [0.002, 0.02])
def test_a_gauge_that_is_read_again_is_not_taken_for_a_copy(tmp_path, noise_mm):
    """Three readings a pose, to a thousandth of a millimetre."""
    rng = np.random.default_rng(2)
    for seed in range(10):
        rows = []
        for a, b, length in np.random.default_rng(seed).uniform(100, 500, (30, 3)):
            rows += [f"{a:.3f},{b:.3f},{length + noise_mm * rng.standard_normal():.3f}" for _ in range(3)]
        assert not repeated_notes(written(tmp_path / "run.csv", rows))


def test_a_copy_of_a_file_is_refused(tmp_path):
    one = written(tmp_path / "monday.csv", rows_of(np.random.default_rng(3), 8))
    two = tmp_path / "friday.csv"
    shutil.copy(one, two)
    with pytest.raises(InputError, match=r"friday\.csv is a copy of .*monday\.csv, byte for byte"):
        load_runs([one, two], 2)
    two.write_text(one.read_text().replace("# measure: static\n", "# measure: static\n# another day\n"))
    assert len(load_runs([one, two], 2)) == 16
