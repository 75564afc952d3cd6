"""Cells for a head or a tracker that are wrong: one clear sentence each; old cells are written as before."""

import pytest
import tomli_w

from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.common.progress import Stages
from planner.session.options import PlanOptions
from planner.workflow.planning import plan_cell


def changed(tmp_path, name, *changes):
    text = load_cell(f"kuka-kr6-r700/{name}").path.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "cell.toml"
    path.write_text(text)
    return str(path)


@pytest.mark.parametrize(
    ("name", "old", "new", "told"),
    [
        ("trical", "[artifact]\n", "[artefact]\n", "artefact"),
        ("trical", "    [0.169102, 0.0, -0.985599],", "    [0.5, 0.0, -0.8],", "stand at .* to each other"),
        ("trical", "map_axis = [0.707107, 0.0, 0.707107]", "map_axis = [-0.7, 0.0, -0.7]", "must lead out of the head"),
        (
            "trical",
            'name = "2"\nposition_mm = [-79.193',
            'name = "1"\nposition_mm = [-79.193',
            "two balls share a name",
        ),
        ("trical", "position_mm = [536.32, 21.901, 58.349]", "position_mm = [0.536, 0.022, 0.058]", "look like metres"),
        ("tracker", "position_mm = [2500, 0, 400]", "position_mm = [2.5, 0, 0.4]", "look like metres"),
        ("trical", "master_mm = 38.1", "master_mm = 1.5", "between 25.4 and 50.4"),
        ("trical", "usable_mm = 5.0", "usable_mm = 50.0", "at most 5.75, half of either"),
        ("trical", "range_mm = 12.5", "range_mm = 1.25", "range_mm = 1.25 it lies between"),
        ("trical", "position_mm = [-79.193, 287.805, 18.740]", "position_mm = [-0.079, 0.288, 0.019]", "metres"),
        ("trical", "position_mm = [-79.193, 287.805, 18.740]", "position_mm = [-79.5, -330.1, 17.5]", "at one place"),
        ("tracker", "position_mm = [300, 120, 0]", "position_mm = [0, 10, 0]", "lie nearly on one line"),
        ("trical", "mass_kg = 6.0", "mass_kg = 7.0", "exceeds the rated payload"),
        ("tracker", "[tracker]\nposition_mm", "[tracker]\nplace_mm", "place_mm"),
        ("tracker", "length_mm = [1000, 5000]\n", "", "length_mm"),
        ("tracker", '[[tracker.nests]]\nname = "N3"\nposition_mm = [300, 120, 0]\n', "", "has 2 nests"),
    ],
)
def test_wrong_keys_are_told(tmp_path, name, old, new, told):
    with pytest.raises(InputError, match=told):
        load_cell(changed(tmp_path, name, (old, new)))


def test_missing_sections_are_told(tmp_path):
    base = 'schema = "edbb-cell/1"\nrobot = "kuka-kr6-r700"\nhome_deg = [0, -90, 90, 0, 45, 0]\n'
    base += "[tool]\nmap_mm = [0, 0, 100]\n"
    ball = '[[balls]]\nname = "1"\nposition_mm = [0, 0, 0]\n'
    place = "[artifact]\nposition_mm = [500, 0, 100]\n"
    for text, told in (
        ('[gauge]\nkind = "trical"\n' + ball, r"\[artifact\] with position_mm is missing"),
        ('[gauge]\nkind = "trical"\n' + place, r"at least one \[\[balls\]\]"),
        ('[gauge]\nkind = "trical"\n' + ball + place, r"\[gauge.head\] with indicators is missing"),
        ('[gauge]\nkind = "tracker"\nlength_mm = [1000, 4000]\n', r"\[tracker\] with position_mm is missing"),
        ('[gauge]\nkind = "trical"\n' + ball + place + "[[fixtures]]\nposition_mm = [500, 0, 100]\n", "are for a bar"),
    ):
        path = tmp_path / "cell.toml"
        path.write_text(base + text)
        with pytest.raises(InputError, match=told):
            load_cell(str(path))


def test_cells_without_the_new_keys_are_written_without_them():
    """Plan ids are hashes over the cell as written: a key that came later must not change them."""
    file = load_cell("kuka-kr6-r700/edbb").file
    text = tomli_w.dumps(file.model_dump(mode="json", by_alias=True, exclude_none=True))
    whole = str(file.model_dump(mode="json", by_alias=True))
    for key in ("head", "map_sigma_um", "effects", "artifact", "tracker", "circles"):
        assert key not in text
        assert f"'{key}'" not in whole
    trical = str(load_cell("kuka-kr6-r700/trical").file.model_dump(mode="json", by_alias=True))
    assert all(f"'{key}'" in trical for key in ("head", "map_sigma_um", "effects", "artifact"))


def test_the_balls_stand_where_table_1_and_table_8_put_them():
    """TriCal paper: balls in the world frame, and the base in it at [-536.320, -21.901, -58.349] mm."""
    cell = load_cell("kuka-kr6-r700/trical")
    assert cell.p_BS[0] * 1e3 == pytest.approx([456.781, -308.240, 75.880])
    assert cell.p_BS[3] * 1e3 == pytest.approx([562.699, 0.225, 228.838])
    assert cell.tool.prior == pytest.approx(1.9e-6)
    assert cell.gauge.noise == pytest.approx(3e-6)


def test_an_effect_without_a_name_is_told_before_candidates_are_drawn(tmp_path, monkeypatch):
    monkeypatch.setattr("planner.session.point_poses.draw_ball_candidates", lambda *_: pytest.fail("drawn"))
    path = changed(tmp_path, "trical", ('effects = ["joint compliance"]', 'effects = ["joint complience"]'))
    with pytest.raises(InputError, match=r"did you mean .joint compliance"):
        plan_cell(load_cell(path), PlanOptions(), Stages(lambda *_: None))
