"""Every sample knows the file and the line that it was read from, whatever was joined or left out since."""

import numpy as np
import pytest

from planner.runs.loader import load_run, load_runs
from planner.runs.writer import save_run
from tests.runs.made import full_run, rows, write

TEXTS = {
    "plain": rows(6),
    "comments above": "# a\n# robot: x\n" + rows(6),
    "comments and blanks between": rows(6).replace("\n2,", "\n\n# b\n2,").replace("\n4,", "\n  \n4,"),
    "no last newline": rows(6).rstrip("\n"),
    "windows": rows(6).replace("\n", "\r\n"),
}


@pytest.mark.parametrize("case", TEXTS, ids=str)
def test_lines_are_those_of_the_file(case, tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes(TEXTS[case].encode())
    run = load_run(path, 2)
    lines = TEXTS[case].splitlines()
    for k in range(6):
        name, line = run.where(k).split(", line ")
        assert name == "a.csv"
        assert lines[int(line) - 1].startswith(f"{k},")


def test_files_that_are_joined_and_thinned_keep_theirs(tmp_path):
    write(tmp_path / "a.csv", "# above\n" + rows(5))
    write(tmp_path / "b.csv", rows(4))
    run = load_runs([tmp_path / "a.csv", tmp_path / "b.csv"], 2)
    assert [run.where(k) for k in (0, 4, 5, 8)] == ["a.csv, line 3", "a.csv, line 7", "b.csv, line 2", "b.csv, line 5"]
    part = run.take(np.array([7, 1]))
    assert [part.where(k) for k in (0, 1)] == ["b.csv, line 4", "a.csv, line 4"]


def test_files_of_one_name_are_told_by_their_folders(tmp_path):
    paths = [tmp_path / folder / "run.csv" for folder in ("one", "two")]
    for path in paths:
        path.parent.mkdir()
        write(path, rows(4))
    assert load_runs(paths, 2).where(5) == "two/run.csv, line 3"


def test_a_rest_stands_where_it_begins(tmp_path):
    t = np.arange(0, 6.0, 0.05)
    moving = np.clip((t - 2.5) / 1.0, 0, 1) * 40 + 10
    text = "t_s,q1_deg,q2_deg,length_mm\n" + "".join(
        f"{a:.2f},{b:.4f},20,400\n" for a, b in zip(t, moving, strict=True)
    )
    run = load_run(write(tmp_path / "r.csv", "# measure: static\n" + text), 2)
    assert len(run) == 2
    assert moving[int(run.where(0).split(", line ")[1]) - 3] == pytest.approx(10.0, abs=0.2)
    _, line = run.where(1).split(", line ")
    assert moving[int(line) - 3] == pytest.approx(50.0, abs=0.2)


def test_a_parquet_file_has_rows(tmp_path):
    save_run(full_run("length"), tmp_path / "p.parquet")
    assert load_run(tmp_path / "p.parquet", 7).where(3) == "p.parquet, row 4"


def test_samples_without_a_file_have_their_number():
    assert full_run("length").where(3) == "number 4"
