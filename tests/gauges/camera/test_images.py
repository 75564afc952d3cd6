"""From images to a run: corners against the truth, and one sentence for each image that does not show the board."""

import os
import re
import subprocess
import sys

import cv2
import numpy as np
import pytest

from planner.fit.run_setup import drop_unreadable
from planner.gauges.vision.board import BoardFile
from planner.gauges.vision.images import CornerSeeker, edge_width
from planner.identification.pipeline import FitSettings, identify
from planner.runs.loader import load_run
from tests.command import edbb
from tests.gauges.camera.pictures import SMALL_BENT, SMALL_LENS, SMALL_SIZE, picture, printed, sight_lines
from tests.gauges.camera.scene import BOARD_TO_CORNER, Scene, charuco, pose
from tests.gauges.camera.test_camera import SHIPPED, read

BOARD = """schema = "edbb-board/1"
kind = "charuco"
columns = 7
rows = 5
square_mm = 30
marker_mm = 22
dictionary = "DICT_4X4_50"
width_px = 960
height_px = 600
"""
SMALL = (
    SHIPPED.replace("fx_px = 1400", "fx_px = 700").replace("fy_px = 1400", "fy_px = 700")
    .replace("cx_px = 959.5", "cx_px = 479.5").replace("cy_px = 599.5", "cy_px = 299.5")
    .replace("width_px = 1920", "width_px = 960").replace("height_px = 1200", "height_px = 600")
)  # fmt: skip


@pytest.fixture(scope="module")
def lines():
    return sight_lines()


@pytest.fixture(scope="module")
def pattern():
    return printed()


def stands(seed, near=0.3, far=0.55):
    """The board before the camera, tilted at random."""
    rng = np.random.default_rng(seed)
    T = pose(rng.normal(0, 0.3, 3), [0, 0, rng.uniform(near, far)])
    T[:3, 3] -= T[:3, :3] @ [7 * 0.015, 5 * 0.015, 0] + [*rng.normal(0, 0.01, 2), 0]
    return T


def true_corners(T):
    return cv2.projectPoints(
        charuco().getChessboardCorners(), cv2.Rodrigues(T[:3, :3])[0], T[:3, 3], SMALL_LENS, SMALL_BENT
    )[0][:, 0]


def seeker(**keys):
    usual = {"kind": "charuco", "columns": 7, "rows": 5, "square_mm": 30, "marker_mm": 22}
    return CornerSeeker.of(BoardFile(**usual | keys).board)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_corners_are_found_where_they_are(lines, pattern, seed):
    T = stands(seed)
    found = seeker().corners(picture(T, lines, pattern, seed=seed))
    off = found - true_corners(T)
    assert (~np.isnan(off[:, 0])).sum() >= 20
    assert np.sqrt(np.nanmean((off**2).sum(axis=1))) < 0.25
    assert np.abs(np.nanmean(off, axis=0)).max() < 0.12  # half a pixel would be another way of counting


@pytest.mark.slow
def test_tags_and_a_single_marker_are_found(lines):
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    theirs = cv2.aruco.GridBoard((4, 3), 0.03, 0.01, dictionary)
    paper = theirs.generateImage((1500, 1100), marginSize=0)
    T = stands(1)
    shown = picture(T, lines, paper, square=0.15 * 100 / 1500)
    seen = seeker(
        kind="tags", columns=4, rows=3, marker_mm=30, gap_mm=10, square_mm=None, dictionary="DICT_APRILTAG_36h11"
    ).corners(shown)
    flat = np.concatenate(theirs.getObjPoints())
    true = cv2.projectPoints(flat, cv2.Rodrigues(T[:3, :3])[0], T[:3, 3], SMALL_LENS, SMALL_BENT)[0][:, 0]
    assert np.isfinite(seen).all()
    assert np.sqrt(((seen - true) ** 2).sum(axis=1).mean()) < 0.9  # corners of tags are coarser than of a chessboard
    one = seeker(
        kind="marker", columns=1, rows=1, marker_mm=30, square_mm=None, first=5, dictionary="DICT_APRILTAG_36h11"
    ).corners(shown)
    np.testing.assert_allclose(one, seen[20:24], atol=0.01)


@pytest.mark.slow
def test_blur_is_measured_in_pixels(lines, pattern):
    T = stands(2)
    widths = [edge_width(picture(T, lines, pattern, blur=b), true_corners(T)) for b in (0.7, 1.2, 2.0, 3.0)]
    assert widths == sorted(widths)
    assert widths[0] < 3 < 4.5 < widths[2]


@pytest.fixture(scope="module")
def folder(lines, pattern, tmp_path_factory):
    """A folder with images of all kinds, and a table of angles."""
    place = tmp_path_factory.mktemp("images")
    images = place / "images"
    images.mkdir()

    def write(name, image):
        assert cv2.imwrite(str(images / name), image)

    for k in range(1, 4):
        write(f"pose_{k:03d}.png", picture(stands(k), lines, pattern, seed=k))
    write("pose_004.png", np.full(SMALL_SIZE[::-1], 120, np.uint8))
    write("pose_005.png", picture(stands(5), lines, pattern, blur=3.0))
    other = cv2.aruco.CharucoBoard((7, 5), 0.03, 0.022, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_6X6_50))
    write("pose_006.png", picture(stands(1), lines, printed(other)))
    write("pose_007.png", cv2.resize(picture(stands(1), lines, pattern), (640, 400)))
    (images / "pose_008.png").write_bytes(b"no image at all")
    wide = cv2.aruco.CharucoBoard((9, 5), 0.03, 0.022, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50))
    write("pose_009.png", picture(stands(3, 0.45, 0.5), lines, printed(wide)))
    write("pose_010.png", picture(stands(1), lines, pattern))
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    other = cv2.aruco.CharucoBoard((7, 5), 0.03, 0.022, dictionary, np.arange(30, 47))
    write("pose_011.png", picture(stands(1), lines, printed(other)))
    (place / "board.toml").write_text(BOARD)
    rows = "".join(f"{k},{k},-80,70,-80,-90,{3 * k}\n" for k in range(1, 10)) + "11,1,-80,70,-80,-90,3\n"
    (place / "angles.csv").write_text("# robot: ur5e\npose,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n" + rows)
    return place


@pytest.fixture(scope="module")
def imported(folder):
    words = (folder / "angles.csv", "--images", folder / "images", "--board", folder / "board.toml")
    done = edbb("import", *words, "-o", folder / "run.csv", "-v")
    assert done.returncode == 0, done.stderr
    return " ".join(done.screen.split())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("pose_004.png", "no board is seen: is it in the picture, in focus and lit?"),
        ("pose_005.png", "is blurred: edges at the corners are"),
        ("pose_006.png", "shows markers of DICT_6X6_50, not of DICT_4X4_50: another board"),
        ("pose_007.png", "has 640 × 400 px, but the lens was calibrated at 960 × 600 px"),
        ("pose_008.png", "is no image that can be read"),
        ("pose_009.png", "another board"),
        ("pose_011.png", "shows markers 30, 31, 32, 33 …, and none of the board's (0 to 16): another board"),
        ("angles.csv", "has no pose 10; its image was left out"),
    ],
)
def test_an_image_that_cannot_be_used_has_one_sentence(imported, name, said):
    assert imported.count(f"{name}: ") == 1
    assert said in imported.split(f"{name}: ")[1].split("left out")[0] + "left out"


@pytest.mark.slow
def test_the_others_are_the_run(imported, folder):
    run = load_run(folder / "run.csv")
    assert run.samples.pose.tolist() == [1, 2, 3]
    assert run.robot == "ur5e"
    np.testing.assert_allclose(np.rad2deg(run.samples.q[:, 5]), [3, 6, 9])
    off = run.readings.pixels - np.stack([true_corners(stands(k)) for k in (1, 2, 3)])
    assert np.sqrt(np.nanmean((off**2).sum(axis=2))) < 0.25


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda w: w[:3], "--images DIR and --board board.toml together"),
        (lambda w: [*w, "--map", "m.toml"], "without --map"),
        (lambda w: [w[0], w[1], w[0].parent, *w[3:]], "there is no image"),
        (lambda w: [w[0], w[1], w[0].parent / "none", *w[3:]], "there is no such folder"),
    ],
)
def test_what_does_not_go_together_is_refused(folder, change, said):
    words = [folder / "angles.csv", "--images", folder / "images", "--board", folder / "board.toml"]
    done = edbb("import", *change(words), "-o", folder / "no.csv")
    assert done.returncode == 2
    assert said in " ".join(done.screen.split())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("DICT_4X4_50", "DICT_4X4_5O", "is none of OpenCV's.*DICT_4X4_50"),
        ("columns = 7", "columns = 30", "markers 0 to 74, but DICT_4X4_50 has only 50"),
        ("square_mm", "sqare_mm", "sqare_mm"),
    ],
)
def test_a_board_that_cannot_be_is_refused(folder, tmp_path, old, new, said):
    (tmp_path / "board.toml").write_text(BOARD.replace(old, new))
    done = edbb(
        "import", folder / "angles.csv", "--images", folder / "images", "--board", tmp_path / "board.toml",
        "-o", tmp_path / "no.csv",
    )  # fmt: skip
    assert done.returncode == 2
    assert re.search(said, " ".join(done.screen.split()))


@pytest.mark.slow
def test_without_opencv_the_remedy_is_named(tmp_path):
    (tmp_path / "cv2.py").write_text("raise ImportError('none here')")
    code = (
        "from planner.gauges.vision.board import BoardFile; from planner.gauges.vision.images import CornerSeeker\n"
        "CornerSeeker.of(BoardFile(kind='marker', marker_mm=30).board)"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), os.getcwd()])}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment)
    assert "pip install 'edbb-planner[camera]'" in done.stderr


@pytest.mark.long
def test_images_of_an_arm_lead_to_its_errors(lines, pattern, tmp_path):
    """Sixty images through the lens: imported by the command with the cell as board, identified, errors found."""
    from planner.design.candidates.pool import draw_candidates

    cell = read(tmp_path, SMALL)
    q = draw_candidates(cell, 60, seed=2).q[:60]
    standing = np.eye(4)
    standing[:3, 3] = cell.fixtures[0].p_BX
    scene = Scene.drawn(3, True, standing, pose([0, 0, 0], cell.tool.p_FM))
    (tmp_path / "images").mkdir()
    for k, state in enumerate(q, start=1):
        shown = picture(scene.board_in_camera(state) @ BOARD_TO_CORNER, lines, pattern, seed=k)
        cv2.imwrite(str(tmp_path / "images" / f"{k}.png"), shown)
    rows = "".join(f"{k}," + ",".join(f"{v:.7f}" for v in np.rad2deg(s)) + "\n" for k, s in enumerate(q, start=1))
    (tmp_path / "angles.csv").write_text("pose," + ",".join(f"q{j}_deg" for j in range(1, 7)) + "\n" + rows)
    words = (tmp_path / "angles.csv", "--images", tmp_path / "images", "--board", tmp_path / "camera.toml")
    done = edbb("import", *words, "-o", tmp_path / "run.csv")
    assert done.returncode == 0, done.stderr
    found = identify(drop_unreadable(cell, load_run(tmp_path / "run.csv")), cell, settings=FitSettings(release=False))
    zeros = {e.name: e for e in found.estimates}
    for joint in (2, 3, 4):
        e = zeros[f"theta{joint}"]
        assert abs(e.value - e.nominal - scene.zeros[joint - 1]) < max(4 * e.std, 2e-4)
    assert found.stages[-1].held_out.rms < 3e-4


def old_board():
    """A ChArUco board of 7 by 6 squares as OpenCV drew it before 4.6."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    board = cv2.aruco.CharucoBoard((7, 6), 0.03, 0.022, dictionary)
    board.setLegacyPattern(True)
    return board


@pytest.mark.slow
def test_a_board_that_an_older_opencv_drew_is_found_and_its_key_is_named(lines):
    T = stands(3, 0.4, 0.45)
    image = picture(T, lines, printed(old_board()), seed=3)
    found = seeker(rows=6, legacy=True).corners(image)
    true = cv2.projectPoints(
        old_board().getChessboardCorners(), cv2.Rodrigues(T[:3, :3])[0], T[:3, 3], SMALL_LENS, SMALL_BENT
    )[0][:, 0]
    off = found - true
    assert (~np.isnan(off[:, 0])).sum() >= 24
    assert np.sqrt(np.nanmean((off**2).sum(axis=1))) < 0.25
    assert "write legacy = true" in seeker(rows=6).corners(image)
    new = cv2.aruco.CharucoBoard((7, 6), 0.03, 0.022, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50))
    other = picture(T, lines, printed(new), seed=3)
    assert "write legacy = false" in seeker(rows=6, legacy=True).corners(other)
    assert not isinstance(seeker(rows=6).corners(other), str)


@pytest.mark.slow
def test_legacy_is_a_charuco_boards():
    with pytest.raises(ValueError, match="legacy is for a charuco board"):
        BoardFile(kind="marker", marker_mm=50, legacy=True)
