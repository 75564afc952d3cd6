"""Rows of a validation that were mistyped are named, for its mean tells of nothing else."""

import pytest

from planner.cell.reading import load_cell
from planner.identification.pipeline import FitSettings, identify
from planner.runs.loader import load_runs
from tests.identification.worlds import arm_of
from tests.simulation.generator import runs
from tests.simulation.generator.truth import Noise, Truth

NAME = "kuka-kr6-r700"


@pytest.mark.long
def test_a_mistyped_row_of_the_validation_is_named(tmp_path) -> None:
    truth = Truth(0, {"theta2": 1e-3}, (), Noise(5e-6, 1e-5), (1.0,) * 6)
    run, cell = runs.tracker(arm_of(NAME), n_poses=90, seed=0, truth=truth, logs=()).write(tmp_path)
    lines = run.read_text().splitlines()
    first = next(k for k, line in enumerate(lines) if not line.startswith("#"))
    head, rows, names = lines[: first + 1], lines[first + 1 :], lines[first].split(",")
    fields = rows[67].split(",")
    fields[names.index("y_mm")] = f"{float(fields[names.index('y_mm')]) + 50.0:.4f}"
    parts = {"fit": rows[:60], "fine": rows[60:], "wrong": [*rows[60:67], ",".join(fields), *rows[68:]]}
    files = {name: tmp_path / f"{name}.csv" for name in parts}
    for name, part in parts.items():
        files[name].write_text("\n".join([*head, *part]) + "\n")

    where = load_cell(str(cell), planning=False)
    said = {
        name: [
            w
            for w in identify(
                load_runs([files["fit"]], 6), where, validation=load_runs([files[name]], 6), settings=FitSettings()
            ).warnings
            if "validation's rows" in w
        ]
        for name in ("fine", "wrong")
    }
    assert said["fine"] == []
    (warning,) = said["wrong"]
    assert f"line {first + 1 + 8} by 50 mm" in warning
    assert warning.count("line ") == 1
    assert "1 row may be wrong" in warning
