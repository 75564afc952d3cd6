"""Cell files: every shipped one loads; every wrong key is refused in one clear sentence."""

import numpy as np
import pytest

from planner.cell.reading import load_cell, shipped_cells
from planner.common.errors import InputError

TEXT = load_cell("comau-nj130/edbb").path.read_text()


def loaded(tmp_path, old, new):
    assert old in TEXT, old
    path = tmp_path / "cell.toml"
    path.write_text(TEXT.replace(old, new, 1))
    return load_cell(str(path))


def test_the_four_cells_are_shipped():
    assert set(shipped_cells()) >= {"comau-nj130/paper", "comau-nj130/edbb", "kuka-kr6-r700/edbb", "ur10/edbb"}


def test_angles_and_lengths_are_si_inside():
    cell = load_cell("comau-nj130/edbb")
    np.testing.assert_allclose(cell.home, [0, 0, 0, 0, -np.pi / 2, 0])
    np.testing.assert_allclose(cell.fixtures[0].p_BX, [0.258, 1.468, 0.708])
    assert cell.gauge.length_max == pytest.approx(0.52)
    assert cell.motion.tool_speed == pytest.approx(1.0 / 60)


@pytest.mark.slow
def test_thousands_of_obstacles_are_refused_in_a_sentence(tmp_path):
    """Every one of them would be judged by itself; what is wrong with thousands of keys is found in linear time."""
    one = '\n[[obstacles]]\nname = "b"\n{} = "box"\nsize_mm = [5, 5, 5]\nat_mm = [900, 0, 500]\n'
    for key, words in (("kind", "entries: at most 500 entries are allowed"), ("shape", "number 2: the key 'kind'")):
        (tmp_path / "cell.toml").write_text(TEXT + 3000 * one.format(key))
        with pytest.raises(InputError, match=words) as refused:
            load_cell(str(tmp_path / "cell.toml"))
        assert len(str(refused.value)) < 2000


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "clearance_mm = 10",
            "clearence_mm = 10",
            ["unknown key 'motion.clearence_mm'", 'did you mean "clearance_mm"'],
        ),
        ("clearance_mm = 10", "clearance_mm = 0", ["motion.clearance_mm", "greater than 0"]),
        ("length_mm = [300, 520]", "length_mm = [0.3, 0.52]", ["metres", "millimetres"]),
        ("length_mm = [300, 520]", "length_mm = [520, 300]", ["shortest length must come first"]),
        ("length_mm = [300, 520]", "", ["gauge.length_mm", "missing"]),
        ("length_mm = [300, 520]", "length_mm = [280, 520]", ["housing_mm = 255", "shortest length 280 mm"]),
        ("home_deg = [0, 0, 0, 0, -90, 0]", "home_deg = [0, 0, 0]", ["'home_deg' has 3 angles", "6 joints"]),
        ("home_deg = [0, 0, 0, 0, -90, 0]", "home_deg = [0, 0, 99, 0, -90, 0]", ["joint 3", "99", "75"]),
        ("noise_um = 1.0", "noise_um = nan", ["gauge.noise_um", "finite"]),
        ('kind = "edbb"', 'kind = "edb"', ["gauge.kind", "'edb'"]),
        ('kind = "edbb"', 'kind = "tracker"', ["tracker", "edbb"]),
        ('robot = "comau-nj130"', 'robot = "comau"', ["robot 'comau'", "comau-nj130"]),
        ('robot = "comau-nj130"', "", ["'robot' is missing"]),
        ("mass_kg = 5", "mass_kg = 500", ["500", "130 kg"]),
        ("axis = [0, 0, 1]\n\n[[obst", "axis = [0, 0, 0]\n\n[[obst", ["no direction"]),
        ("axes = [4, 6]", "axes = [4, 9]", ["axis 9", "6 joints"]),
        ("[258, 1468, 708]", "[0.258, 1.468, 0.708]", ["fixtures.A.position_mm", "metres", "[258.0, 1468.0, 708.0]"]),
        ("map_mm = [50, 0, 150]", "map_mm = [0.05, 0, 0.15]", ["tool.map_mm", "metres", "[50.0, 0.0, 150.0]"]),
        ("[0, 0, 0, 0, -90, 0]", "[0, 0, 0, 0, -1.571, 0]", ["home_deg", "radians", "-90.01"]),
        ("[0, 0, 0, 0, -90, 0]", "[0.3, 1.5708, 0, -0.785, -3.1416, 0]", ["home_deg", "radians", "-180.0"]),
        ('zero = "free"', 'zero = "free"\nmount_deg = [0, 0, 0, 0, 0.7854, 0]', ["gauge.mount_deg", "radians", "45.0"]),
        ("{ fixture = 80, map = 80 }", "{ fixture = 80, map = 1.2 }", ["cone_deg.map", "radians", "68.75"]),
        ("schema = ", "schema = 3 # ", ["schema"]),
        ("schema = ", "schema ", ["not valid TOML"]),
    ],
)
def test_a_wrong_cell_is_refused(tmp_path, old, new, words):
    with pytest.raises(InputError) as err:
        loaded(tmp_path, old, new)
    assert all(w in str(err.value) for w in words), str(err.value)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("map_mm = [50, 0, 150]", "map_mm = [0, 0, 0]"),
        ("map_mm = [50, 0, 150]", "map_mm = [0, 0, 4.5]"),
        ("[258, 1468, 708]", "[5, 0, 12]"),
        ("[258, 1468, 708]", "[0, 0, 0]"),
        ("[0, 0, 0, 0, -90, 0]", "[0, 0, 0, 0, 0, 0]"),
        ("[0, 0, 0, 0, -90, 0]", "[0, -1.5, 2, 0, -5, 0]"),
        ("[0, 0, 0, 0, -90, 0]", "[0, -1.571, 20, 0, -90, 0]"),
        ("{ fixture = 80, map = 80 }", "{ fixture = 5, map = 12 }"),
    ],
)
def test_zeros_and_small_values_that_make_sense_are_taken_as_written(tmp_path, old, new):
    assert loaded(tmp_path, old, new).robot.name == "comau-nj130"


def test_an_unknown_cell_names_the_nearest():
    with pytest.raises(InputError, match='did you mean "comau-nj130/edbb"'):
        load_cell("comau-nj130/ebdd")


def test_a_missing_file_is_named():
    with pytest.raises(InputError, match=r"nowhere\.toml"):
        load_cell("nowhere.toml")


def test_a_cell_without_fixture(tmp_path):
    start, end = TEXT.index("[[fixtures]]"), TEXT.index("[[obstacles]]")
    with pytest.raises(InputError, match="fixtures"):
        loaded(tmp_path, TEXT[start:end], "")


def test_all_that_a_cell_lacks_is_said_at_once(tmp_path):
    path = tmp_path / "bare.toml"
    path.write_text('schema = "edbb-cell/1"\nrobot = "abb-irb120"\n[gauge]\nkind = "tracker"\n')
    with pytest.raises(InputError) as refused:
        load_cell(str(path))
    for key in ("'home_deg'", "[tool] with map_mm", "'gauge.length_mm'", "[tracker] with position_mm"):
        assert key in str(refused.value)


def test_the_arm_rests_at_every_pose_of_a_gauge_that_reads_at_rest(tmp_path):
    """``motion.measure`` has the default of the bar, which a tracker's cell need not know."""
    text = load_cell("kuka-kr6-r700/tracker").path.read_text()
    assert 'measure = "static"\n' in text
    path = tmp_path / "cell.toml"
    path.write_text(text.replace('measure = "static"\n', ""))
    cell = load_cell(str(path))
    assert cell.motion.measure == cell.file.motion.measure == "static"
    assert load_cell("comau-nj130/edbb").motion.measure == "continuous"
