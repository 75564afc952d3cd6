"""What a person is told of a run: outliers by file and line, a tool point that the cell does not name."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planner.cell.cell import setup_of
from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.fit.noise import Noise
from planner.fit.run_setup import check_pull, locate_gauge, setup_for_run
from planner.identification.assessment import few_readings_note
from planner.identification.run_warnings import collect_warnings
from planner.runs.run import Readings, Run, Samples

QUIET = SimpleNamespace(whitener=SimpleNamespace(noise=Noise()))
COUNTED_ALL = np.ones(5), np.zeros(5)
CELL = 'schema = "edbb-cell/1"\nrobot = "ur10"\n[gauge]\nkind = "tracker"\n'


def test_outliers_are_named_by_file_and_line(tmp_path):
    (tmp_path / "cell.toml").write_text(CELL)
    cell = load_cell(str(tmp_path / "cell.toml"), planning=False)
    n = 40
    samples = Samples(np.zeros((n, 6)), np.zeros(n, dtype=int), file=np.arange(n) // 20, line=2 + np.arange(n) % 20)
    run = Run("a+b", samples, Readings(position=np.zeros((n, 3))), files=("a.csv", "b.parquet"))
    weight, off = np.ones(n), np.full(n, 1e-5)
    weight[[3, 19, 20, 25, 30, 31, 39]] = 0.02, 1e-4, 1e-5, 0.02, 0.03, 0.02, 0.3
    off[[3, 19, 20, 31]] = 4.1e-4, 5e-2, 4e-2, 3e-4
    found = SimpleNamespace(setup=setup_of(cell), problem=QUIET)
    (said,) = [w for w in collect_warnings(run, cell, found, weight, off) if "noise" in w]
    assert said == (
        "7 rows stand far outside the noise of the others (a.csv, line 5: 0.41 mm off, counts for 2 % of a reading; "
        "a.csv, line 21 to b.parquet, row 2: 50 mm off, each counts for less than 0.1 % of a reading; "
        "b.parquet, row 7: 0.01 mm off, counts for 2 % of a reading; "
        "b.parquet, row 12 to b.parquet, row 13: 0.3 mm off, each counts for 3 % of a reading; "
        "b.parquet, row 21: 0.01 mm off, counts for 30 % of a reading)"
    )
    one = np.where(np.arange(n) == 3, 0.02, 1.0)
    (said,) = [w for w in collect_warnings(run, cell, found, one, off) if "noise" in w]
    assert said.startswith("1 row stands far outside the noise of the others (a.csv, line 5: 0.41 mm off")
    bare = replace(run, samples=replace(samples, file=None, line=None))
    assert "(number 4: " in "".join(collect_warnings(bare, cell, found, weight, off))


def test_left_handed_axes_of_a_tracker_are_told(tmp_path):
    (tmp_path / "cell.toml").write_text(CELL)
    cell, rng = load_cell(str(tmp_path / "cell.toml"), planning=False), np.random.default_rng(0)
    q = rng.uniform(-1.5, 1.5, (40, 6))
    R = Rotation.random(rng=rng).as_matrix()
    seen = 1e-3 * rng.normal(size=(40, 3)) + cell.map_position(q) @ R
    for turned, told in ((np.eye(3), False), (np.diag([1.0, -1.0, 1.0]), True)):
        run = Run("run.csv", Samples(q, np.zeros(40, dtype=int)), Readings(position=seen @ turned))
        if told:
            with pytest.raises(InputError, match="the tracker's axes are left-handed"):
                locate_gauge(setup_for_run(cell, run), run)
        else:
            locate_gauge(setup_for_run(cell, run), run)


def test_who_fits_a_loaded_bar_is_told_what_fits_it_in_balance():
    cell = load_cell("kuka-kr6-r700/edbb")
    found = SimpleNamespace(setup=setup_of(cell), problem=QUIET)
    for pull, told in ((10.0, False), (625.0, True)):
        samples = Samples(np.zeros((5, 6)), np.zeros(5, dtype=int), force=np.full(5, pull))
        run = Run("run.csv", samples, Readings(length=np.full(5, 0.4)))
        assert any("up to 625 N" in w for w in collect_warnings(run, cell, found, *COUNTED_ALL)) == told


def test_a_loaded_bars_run_needs_its_force():
    cell = load_cell("abb-irb6700/edbb")
    name = cell.fixtures[0].name
    setup = replace(setup_of(cell), loaded={name: "pulls.load_N"})
    samples = Samples(np.zeros((5, 6)), np.zeros(5, dtype=int))
    run = Run("run.csv", samples, Readings(length=np.full(5, 0.13)), places=(name,))
    with pytest.raises(InputError, match=r"force_N is missing.* \(pulls.load_N\)"):
        check_pull(cell, setup, run)
    check_pull(cell, setup_of(cell), run)
    check_pull(cell, setup, replace(run, samples=replace(samples, force=np.full(5, 125.0))))


def test_a_tool_point_that_a_cell_with_one_point_does_not_name_is_told():
    cell = load_cell("kuka-kr6-r700/edbb")
    run = Run("run.csv", Samples(np.zeros((5, 6)), np.zeros(5, dtype=int)), Readings(length=np.full(5, 0.4)))
    found = SimpleNamespace(setup=setup_of(cell), problem=QUIET)
    for names, told in ((("low",), True), (("1",), False), (("",), False), (("a", "b"), False)):
        said = collect_warnings(replace(run, points=names), cell, found, *COUNTED_ALL)
        assert any("measured at tool point 'low'" in w for w in said) == told


@pytest.mark.parametrize(
    ("rows", "time", "said"),
    [
        (148, 1.0, "145 parameters were fitted to 148 independent readings: "),
        (8140, 55.0, "148 independent readings (8140 rows along a drive, of which 55.0 are worth one): "),
        (400, 1.0, None),
        (22000, 55.0, None),
    ],
)
def test_a_fit_of_nearly_as_many_parameters_as_readings_says_so_and_what_helps(rows, time, said):
    notes = few_readings_note(145, 1, rows, time)
    assert len(notes) == (said is not None)
    assert all(said in note for note in notes)
    assert all(("drive through further poses" if time > 1 else "measure further poses") in note for note in notes)
