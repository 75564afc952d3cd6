"""How far off a robot is before any run: as its file says, or as robots of its class are."""

import numpy as np
import pytest

from planner.cell.file import CellFile
from planner.cell.reading import cell_of, load_cell
from planner.common.errors import InputError
from planner.common.schema import read_toml
from planner.model.model import Model

TEXT = load_cell("ur5e/edbb").path.read_text()


def read(folder, text):
    (folder / "cell.toml").write_text(text)
    return cell_of(read_toml(folder / "cell.toml", CellFile), folder / "cell.toml", "cell")


def test_a_hobby_arm_is_off_by_degrees_and_millimetres(tmp_path):
    cell = read(tmp_path, TEXT.replace('robot = "ur5e"', 'robot = "ur5e"\nclass = "hobby"'))
    prior = {p.name: p.prior for p in Model.from_cell(cell).parameters}
    assert prior["theta2"] == pytest.approx(np.deg2rad(2.0))
    assert prior["a2"] == pytest.approx(2e-3)
    plain = load_cell("ur5e/edbb").robot
    assert cell.robot.usual_error(cell.home, cell.tool.p_FM) > 10 * plain.usual_error(cell.home, cell.tool.p_FM)


def test_a_cell_that_names_no_class_is_written_as_before(tmp_path):
    plain = read(tmp_path, TEXT)
    assert "class" not in plain.file.model_dump(mode="json", by_alias=True)
    classed = read(tmp_path, TEXT.replace('robot = "ur5e"', 'robot = "ur5e"\nclass = "industrial"'))
    assert classed.file.model_dump(mode="json", by_alias=True)["class"] == "industrial"
    for size in ("length", "angle", "compliance"):
        assert getattr(classed.robot.priors, size) == pytest.approx(getattr(plain.robot.priors, size), rel=1e-3)


def test_another_class_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"class.*industrial.*hobby"):
        read(tmp_path, TEXT.replace('robot = "ur5e"', 'robot = "ur5e"\nclass = "toy"'))
