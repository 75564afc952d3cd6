"""A gauge of a package outside the planner goes through the chain as the page on gauges says."""

import json
import os
import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from tests.wings.installation import ROOT, edbb_in, run_in

PAGE = (ROOT / "docs" / "extend" / "gauge.md").read_text()
HERE = Path(__file__).parent


@pytest.fixture
def installed(tmp_path):
    """A folder as pip leaves it: the module, the entry point that the page shows, and the cell."""
    for name in ("inclinometer.py", "inclinometer.toml"):
        shutil.copy(HERE / name, tmp_path)
    facts = tmp_path / "inclinometer-1.0.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: inclinometer\nVersion: 1.0\n")
    (line,) = re.findall(r'^inclinometer = "(\w+)"$', PAGE, re.MULTILINE)
    (facts / "entry_points.txt").write_text(f"[edbb.extensions]\ninclinometer = {line}\n")
    return tmp_path, {**os.environ, "PYTHONPATH": os.pathsep.join((str(tmp_path), str(ROOT))), "COLUMNS": "120"}


@pytest.mark.slow
def test_its_cell_is_read_where_the_package_is_installed_and_there_alone(installed, tmp_path_factory):
    folder, environment = installed
    read = "from planner.cell.reading import load_cell; import sys; print(load_cell(sys.argv[1]).gauge.kind)"
    there = run_in(folder, environment, "-c", read, "inclinometer.toml")
    assert there.stdout == "inclinometer\n", there.stderr
    elsewhere, bare = tmp_path_factory.mktemp("bare"), {**environment, "PYTHONPATH": str(ROOT)}
    done = run_in(elsewhere, bare, "-c", read, folder / "inclinometer.toml")
    assert done.returncode != 0
    assert "comes with an installed package whose entry point 'edbb.extensions' names its module" in done.stderr


@pytest.mark.long
def test_the_commands_of_the_page_run(installed):
    folder, environment = installed
    commands = [shlex.split(line) for line in re.findall(r"^\$ edbb (.*)$", PAGE, re.MULTILINE)]
    assert [words[0] for words in commands] == ["plan", "simulate", "identify"]
    for words in commands:
        done = edbb_in(folder, environment, *words)
        assert done.returncode == 0, (words, done.stderr[-2000:])
    assert re.search(r"(held out|validation) +[0-9.]+ → [0-9.]+ mrad", done.stdout + done.stderr)
    before, *_, after = json.loads((folder / "calibrated" / "identification.json").read_text())["stages"]
    assert after["held_out"]["rms_mm"] < 0.1 * before["held_out"]["rms_mm"]
    table = pl.read_csv(folder / "calibrated" / "residuals.csv")
    assert np.isfinite(table["held_out_mrad"].to_numpy()).any()
