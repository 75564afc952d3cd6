"""Lens and board against OpenCV's."""

import cv2
import numpy as np
import pytest

from planner.gauges.vision.board import BoardFile
from planner.gauges.vision.board_pose import find_board, refine_lens
from planner.gauges.vision.lens import LENS_UNKNOWNS, Lens
from planner.kinematics.geometry import exp3

LENSES = {
    "plain": np.zeros(5),
    "barrel": np.array([-0.2, 0.1, 1e-3, -5e-4, 0.02]),
    "pincushion": np.array([0.15, 0.05, -2e-3, 1e-3, 0.0]),
}


def lens_of(bent):
    return Lens(np.array([1500.0, 1480.0]), np.array([960.0, 545.0]), bent, (1920, 1080))


@pytest.fixture(params=LENSES)
def lens(request):
    return lens_of(LENSES[request.param])


@pytest.fixture
def points():
    return np.random.default_rng(0).normal([0, 0, 0.7], 0.15, (200, 3))


def by_opencv(lens, p):
    K = np.array([[lens.focal[0], 0, lens.centre[0]], [0, lens.focal[1], lens.centre[1]], [0, 0, 1]])
    uv, J = cv2.projectPoints(p, np.zeros(3), np.zeros(3), K, lens.distortion)
    return uv[:, 0], J.reshape(len(p), 2, -1)


def test_pixels_are_opencvs(lens, points):
    np.testing.assert_allclose(lens.pixels(points), by_opencv(lens, points)[0], atol=1e-9)


def test_slopes_are_opencvs(lens, points):
    J = by_opencv(lens, points)[1]
    np.testing.assert_allclose(lens.slopes(points), J[:, :, 3:6], atol=1e-8)
    found = lens.lens_slopes(points)
    assert found.shape[-1] == len(LENS_UNKNOWNS)
    np.testing.assert_allclose(found[..., :2], J[..., 6:8] * lens.focal, atol=1e-8)
    np.testing.assert_allclose(found[..., 2:4], J[..., 8:10] * lens.focal, atol=1e-8)
    np.testing.assert_allclose(found[..., 4:], J[..., 10:14], atol=1e-8)


def test_a_pixel_leads_back_to_its_direction(lens, points):
    np.testing.assert_allclose(lens.directions(lens.pixels(points)), points[:, :2] / points[:, 2:], atol=1e-12)


def test_a_point_behind_the_camera_has_no_pixel(lens):
    assert np.isnan(lens.pixels(np.array([[0.0, 0.1, -0.5]]))).all()


def test_the_widest_cone_lies_in_the_picture(lens):
    around = np.linspace(0, 2 * np.pi, 720)
    on_cone = np.column_stack([np.cos(around), np.sin(around), np.full(720, 1 / np.tan(lens.half_angle - 1e-3))])
    assert lens.sees(lens.pixels(on_cone)).all()
    on_cone[:, 2] = 1 / np.tan(lens.half_angle + 5e-3)
    assert not lens.sees(lens.pixels(on_cone)).all()


def test_corners_of_a_chessboard_lie_where_opencv_has_them():
    board = BoardFile(kind="charuco", columns=7, rows=5, square_mm=30, marker_mm=22).board
    theirs = cv2.aruco.CharucoBoard(
        (7, 5), 0.03, 0.022, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    ).getChessboardCorners()
    moved = theirs * [1, -1, -1] + [-0.105, 0.075, 0]
    np.testing.assert_allclose(board.corners, moved, atol=1e-8)
    assert len(board) == 24


def test_corners_of_tags_lie_where_opencv_has_them():
    board = BoardFile(kind="tags", columns=4, rows=3, marker_mm=40, gap_mm=10).board
    theirs = cv2.aruco.GridBoard((4, 3), 0.04, 0.01, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50))
    moved = np.concatenate(theirs.getObjPoints()) * [1, -1, -1] + [-0.095, 0.07, 0]
    np.testing.assert_allclose(board.corners, moved, atol=1e-8)


def looks(n, seed=0):
    rng = np.random.default_rng(seed)
    R = exp3(np.array([np.pi, 0, 0])) @ exp3(rng.normal(0, 0.35, (n, 3)))
    return R, rng.uniform([-0.1, -0.06, 0.35], [0.1, 0.06, 0.8], (n, 3)), rng


def test_a_board_is_found_as_opencv_finds_it():
    board, lens = (
        BoardFile(kind="charuco", columns=7, rows=5, square_mm=30, marker_mm=22).board,
        lens_of(LENSES["barrel"]),
    )
    R, p, rng = looks(40)
    seen = lens.pixels(np.einsum("nij,kj->nki", R, board.corners) + p[:, None]) + rng.normal(0, 0.2, (40, 24, 2))
    found = find_board(lens, board.corners, seen)
    K = np.array([[lens.focal[0], 0, lens.centre[0]], [0, lens.focal[1], lens.centre[1]], [0, 0, 1]])
    for k in range(40):
        _, turns, places, errors = cv2.solvePnPGeneric(
            board.corners, seen[k], K, lens.distortion, flags=cv2.SOLVEPNP_IPPE
        )
        best = int(np.argmin(errors))
        turn, place = cv2.solvePnPRefineLM(board.corners, seen[k], K, lens.distortion, turns[best], places[best])
        # ours weighs the few furthest corners less
        np.testing.assert_allclose(found.p_CB[k], place[:, 0], atol=1e-3)
        np.testing.assert_allclose(found.R_CB[k], cv2.Rodrigues(turn)[0], atol=1e-2)
    np.testing.assert_allclose(found.p_CB, p, atol=2e-3)
    np.testing.assert_allclose(found.rms, 0.2 * np.sqrt(2), rtol=0.5)


def test_a_far_corner_moves_no_board():
    board, lens = (
        BoardFile(kind="charuco", columns=7, rows=5, square_mm=30, marker_mm=22).board,
        lens_of(LENSES["plain"]),
    )
    R, p, rng = looks(20)
    seen = lens.pixels(np.einsum("nij,kj->nki", R, board.corners) + p[:, None]) + rng.normal(0, 0.1, (20, 24, 2))
    clean = find_board(lens, board.corners, seen)
    wrong = seen.copy()
    wrong[:, 5] += 40.0
    found = find_board(lens, board.corners, wrong)
    assert (found.corner_error[:, 5] > 35).all()
    np.testing.assert_allclose(found.p_CB, clean.p_CB, atol=1.5e-3)


@pytest.mark.slow
def test_a_lens_is_found_from_the_board_alone():
    board, lens = (
        BoardFile(kind="charuco", columns=7, rows=5, square_mm=30, marker_mm=22).board,
        lens_of(LENSES["barrel"]),
    )
    R, p, rng = looks(80)
    seen = lens.pixels(np.einsum("nij,kj->nki", R, board.corners) + p[:, None]) + rng.normal(0, 0.1, (80, 24, 2))
    start = Lens(lens.focal * [1.03, 0.98], lens.centre + np.array([15, -12]), np.array([0, 0, 0, 0, 0.02]), lens.size)
    found = refine_lens(start, board.corners, seen, np.array([0.05, 0.05, 0.03, 0.03, 0.3, 0.3, 0.01, 0.01]))
    np.testing.assert_allclose(found.focal, lens.focal, rtol=2e-3)
    np.testing.assert_allclose(found.centre, lens.centre, atol=3.0)
    np.testing.assert_allclose(found.distortion[:2], lens.distortion[:2], atol=0.02)
