"""Images of a board as a camera takes them: through its lens, with the noise and the blur that are asked for."""

import cv2
import numpy as np

from tests.gauges.camera.scene import SQUARE, charuco

PRINTED = 100  # [px] of one square as it is printed
FINE = 2  # times finer than the image, each way, before it is averaged
SMALL_SIZE = (960, 600)
SMALL_LENS = np.array([[700.0, 0, 479.5], [0, 700.0, 299.5], [0, 0, 1]])
SMALL_BENT = np.array([-0.10, 0.05, 0.0, 0.0, 0.0])
GREY, LIGHT, DARK = 110, 220, 25


def printed(board=None):
    board = board or charuco()
    columns, rows = board.getChessboardSize() if hasattr(board, "getChessboardSize") else board.getGridSize()
    return board.generateImage((columns * PRINTED, rows * PRINTED), marginSize=0)


def sight_lines(lens=SMALL_LENS, bent=SMALL_BENT, size=SMALL_SIZE):
    """Directions (h, w, 2) of all fine pixels, by OpenCV."""
    w, h = size[0] * FINE, size[1] * FINE
    u, v = np.meshgrid((np.arange(w) - (FINE - 1) / 2) / FINE, (np.arange(h) - (FINE - 1) / 2) / FINE)
    seen = cv2.undistortPoints(np.stack([u.ravel(), v.ravel()], 1)[:, None], lens, bent)
    return seen.reshape(h, w, 2)


def picture(T, lines, pattern, square=SQUARE, blur=0.7, noise=2.0, seed=0):
    """The image of a pattern whose corner frame (OpenCV's) stands at T before the camera; ``blur`` is σ in pixels."""
    H = np.linalg.inv(np.column_stack([T[:3, 0], T[:3, 1], T[:3, 3]]))
    p = np.concatenate([lines, np.ones((*lines.shape[:2], 1))], axis=2) @ H.T
    at = p[..., :2] / p[..., 2:] * (PRINTED / square) - 0.5
    margin = PRINTED // 2
    paper = cv2.copyMakeBorder(pattern, *[margin] * 4, cv2.BORDER_CONSTANT, value=255)
    x, y = (np.where(p[..., 2] > 0, at[..., k] + margin, -1e4).astype(np.float32) for k in range(2))
    fine = cv2.remap(paper, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=GREY)
    fine = cv2.GaussianBlur(fine, (0, 0), blur * FINE).astype(float)
    coarse = fine.reshape(lines.shape[0] // FINE, FINE, lines.shape[1] // FINE, FINE).mean(axis=(1, 3))
    rng = np.random.default_rng(seed)
    shown = DARK + coarse * (LIGHT - DARK) / 255 + rng.normal(0, noise, coarse.shape)
    return np.clip(shown, 0, 255).astype(np.uint8)
