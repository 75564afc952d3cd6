"""An arm, a camera and a board as they truly are, by OpenCV and a few lines of numpy: no model of the planner's."""

from dataclasses import dataclass, field

import cv2
import numpy as np

# UR5e by its data sheet: d, a [m], α [rad] of standard DH
SHEET = np.array(
    [
        [0.1625, 0.0, np.pi / 2],
        [0.0, -0.425, 0.0],
        [0.0, -0.3922, 0.0],
        [0.1333, 0.0, np.pi / 2],
        [0.0997, 0.0, -np.pi / 2],
        [0.0996, 0.0, 0.0],
    ]
)
LENS = np.array([[1400.0, 0, 959.5], [0, 1400.0, 599.5], [0, 0, 1]])
BENT = np.array([-0.10, 0.05, 0.0, 0.0, 0.0])
SIZE = (1920, 1200)
COLUMNS, ROWS, SQUARE, MARKER = 7, 5, 0.03, 0.022  # [m]


def charuco():
    return cv2.aruco.CharucoBoard(
        (COLUMNS, ROWS), SQUARE, MARKER, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    )


def pose(rotation_vector, place):
    T = np.eye(4)
    T[:3, :3] = cv2.Rodrigues(np.asarray(rotation_vector, float))[0]
    T[:3, 3] = place
    return T


def flange(q, rows=SHEET, zeros=(0,) * 6):
    """Pose of the flange (4, 4), joint by joint."""
    T = np.eye(4)
    for (d, a, alpha), angle in zip(rows, q + np.asarray(zeros), strict=True):
        c, s, ca, sa = np.cos(angle), np.sin(angle), np.cos(alpha), np.sin(alpha)
        T = T @ np.array([[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]])
    return T


BOARD_TO_CORNER = pose([np.pi, 0, 0], [-COLUMNS * SQUARE / 2, ROWS * SQUARE / 2, 0])  # OpenCV's: y down, z away


@dataclass
class Scene:
    """What is true: errors of the rows and of the joints' zeros, where board and camera are."""

    on_flange: bool
    rows: np.ndarray = field(default_factory=lambda: SHEET.copy())
    zeros: np.ndarray = field(default_factory=lambda: np.zeros(6))
    standing: np.ndarray = field(default_factory=lambda: np.eye(4))  # of what stands, in the base
    sitting: np.ndarray = field(default_factory=lambda: np.eye(4))  # of what is on the flange
    lens: np.ndarray = field(default_factory=LENS.copy)
    bent: np.ndarray = field(default_factory=BENT.copy)

    @classmethod
    def drawn(cls, seed, on_flange=True, standing=None, sitting=None):
        rng = np.random.default_rng(seed)
        scene = cls(on_flange)
        scene.rows = SHEET + rng.normal(0, [4e-4, 4e-4, 5e-4], SHEET.shape)
        scene.zeros = rng.normal(0, 1e-3, 6)
        scene.standing = standing @ pose(rng.normal(0, 0.01, 3), rng.normal(0, 0.005, 3))
        scene.sitting = sitting @ pose(rng.normal(0, 0.01, 3), rng.normal(0, 0.003, 3))
        return scene

    def board_in_camera(self, q):
        tool = flange(q, self.rows, self.zeros) @ self.sitting
        return np.linalg.inv(tool) @ self.standing if self.on_flange else np.linalg.inv(self.standing) @ tool

    def corners(self, q, noise=0.0, rng=None):
        """Corners in one image (K, 2) [px], NaN outside of it."""
        T = self.board_in_camera(q) @ BOARD_TO_CORNER
        uv = cv2.projectPoints(
            charuco().getChessboardCorners(), cv2.Rodrigues(T[:3, :3])[0], T[:3, 3], self.lens, self.bent
        )[0][:, 0]
        uv = uv + (0 if rng is None else rng.normal(0, noise, uv.shape))
        inside = ((uv >= 0) & (uv <= np.array(SIZE) - 1)).all(axis=1) & (T[2, 3] > 0)
        return np.where(inside[:, None], uv, np.nan)


def run_text(scene, q, noise=0.15, seed=0, repeatability=0.0):
    """A run as a person would write it: one row a corner."""
    rng = np.random.default_rng(seed)
    lines = ["# robot: ur5e", "pose," + ",".join(f"q{j}_deg" for j in range(1, 7)) + ",corner,u_px,v_px"]
    for k, state in enumerate(q, start=1):
        angles = ",".join(f"{v:.9f}" for v in np.rad2deg(state))
        seen = scene.corners(state + repeatability * rng.standard_normal(6), noise, rng)
        lines += [f"{k},{angles},{c},{u:.4f},{v:.4f}" for c, (u, v) in enumerate(seen) if np.isfinite(u)]
    return "\n".join(lines) + "\n"
