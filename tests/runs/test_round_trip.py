"""What is written is what is read: everything, in both formats, to the last nanometre."""

from dataclasses import fields, replace

import numpy as np
import pytest

from planner.common.errors import InputError
from planner.runs.loader import load_run
from planner.runs.run import Run
from planner.runs.writer import save_run
from tests.runs.made import full_run

KINDS = ("length", "position", "ball")


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
@pytest.mark.parametrize("kind", KINDS)
def test_everything_comes_back(tmp_path, kind, ending):
    run = full_run(kind)
    path = tmp_path / f"full{ending}"
    save_run(run, path)
    back = load_run(path, 7)
    for part in ("samples", "readings"):
        for f in fields(getattr(run, part)):
            if f.name in ("file", "line", "turns"):  # where it was read, and how rotations stood there
                continue
            before, after = getattr(getattr(run, part), f.name), getattr(getattr(back, part), f.name)
            assert (before is None) == (after is None), f.name
            if before is not None:
                np.testing.assert_allclose(after, before, rtol=0, atol=1e-9, err_msg=f.name)
                assert not after.flags.writeable, f.name
    for name in ("name", "places", "balls", "points", "continuous", "plan_id", "robot", "warnings"):
        assert getattr(back, name) == getattr(run, name), name


def test_the_only_fixture_keeps_its_name(tmp_path):
    run = full_run("length").take(slice(0, 10))
    save_run(replace(run, places=("A",)), tmp_path / "a.csv")
    assert load_run(tmp_path / "a.csv", 7).places == ("A",)


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_same_bytes_each_time(tmp_path, ending):
    for i in range(2):
        save_run(full_run("position"), tmp_path / f"{i}{ending}")
    assert (tmp_path / f"0{ending}").read_bytes() == (tmp_path / f"1{ending}").read_bytes()


def test_saved_again_is_the_same(tmp_path):
    save_run(full_run("ball"), tmp_path / "a.csv")
    save_run(load_run(tmp_path / "a.csv", 7), tmp_path / "b.csv")
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()


def test_angles_of_unknown_origin_are_written_as_read(tmp_path):
    run = full_run("length")
    bare = Run("bare", type(run.samples)(q=run.samples.q, place=np.zeros(40, dtype=int)), run.readings)
    save_run(bare, tmp_path / "bare.csv")
    back = load_run(tmp_path / "bare.csv", 7)
    np.testing.assert_allclose(back.samples.q, run.samples.q, rtol=0, atol=1e-9)
    assert back.places == ("",)
    assert back.samples.t is None


def test_other_endings_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"\.csv or \.parquet, not '\.xlsx'"):
        save_run(full_run("length"), tmp_path / "run.xlsx")
    with pytest.raises(InputError, match="cannot be written"):
        save_run(full_run("length"), tmp_path / "nowhere" / "run.csv")
    assert list(tmp_path.iterdir()) == []
