"""Readings that belong to no pose are not searched for causes; a gauge that was moved as far is."""

from pathlib import Path

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.identification.pipeline import identify
from planner.runs.loader import load_runs
from planner.tracing.search_context import SearchContext
from planner.tracing.trace import trace

CELL = 'schema = "edbb-cell/1"\nrobot = "ur10"\n[gauge]\nkind = "tracker"\nnoise_um = 5\n'
RUN = Path(__file__).resolve().parents[1] / "golden" / "inputs" / "tracker.csv"


class SearchedError(Exception):
    """A cause is refitted."""


class TracedError(Exception):
    """Tracing came to its end, with a result."""


@pytest.fixture
def measured(tmp_path, monkeypatch):
    """Trace a run whose readings (n, 3) [mm] are changed by a function, until a cause is refitted or to its end."""

    def refit(*_):
        raise SearchedError

    def tracer(*asked):
        raise TracedError(*trace(*asked))

    monkeypatch.setattr(SearchContext, "try_refit", refit)
    (tmp_path / "cell.toml").write_text(CELL)
    cell = load_cell(str(tmp_path / "cell.toml"), planning=False)
    head, names, *rows = RUN.read_text().splitlines()
    table = np.array([[float(v) for v in row.split(",")] for row in rows])
    at = [names.split(",").index(f"{axis}_mm") for axis in "xyz"]

    def changed(change):
        table[:, at] = change(table[:, at])
        np.savetxt(tmp_path / "run.csv", table, "%.9g", ",", header=f"{head}\n{names}", comments="")
        identify(load_runs([tmp_path / "run.csv"], 6), cell, tracer=tracer)

    return changed


@pytest.mark.slow
def test_readings_of_no_pose_are_not_searched_for_causes(measured):
    with pytest.raises(TracedError) as ended:
        measured(lambda read: read + np.random.default_rng(1).normal(scale=50.0, size=read.shape))
    stages, result = ended.value.args
    assert stages == []
    assert result.findings == result.limits == ()
    assert result.tried > 1000


@pytest.mark.slow
def test_a_gauge_that_was_moved_as_far_is_searched_for(measured):
    with pytest.raises(SearchedError):
        measured(lambda read: read + np.outer(np.arange(len(read)) > len(read) // 2, [60.0, 0.0, 0.0]))
