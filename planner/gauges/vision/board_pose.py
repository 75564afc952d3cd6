"""Where a flat board stands before a camera, image by image: closed form, then least squares, all images at once."""

from dataclasses import dataclass

import numpy as np

from planner.common.robust import huber_weights
from planner.common.units import Array
from planner.gauges.vision.lens import Lens
from planner.kinematics.geometry import exp3, nearest_rotation, skew

FEWEST_CORNERS = 4  # that hold the six numbers of a pose
STEPS = 10  # of Gauss–Newton
OUTSIDE = 8.0  # times it, from which on it does not count at all


@dataclass(frozen=True)
class BoardPoses:
    """Poses of a board in the camera's frame: R_CB (n, 3, 3), p_CB (n, 3) [m].

    ``left`` are pixels seen less those of the pose, (n, K, 2), NaN where none is seen.
    """

    R_CB: Array
    p_CB: Array
    left: Array

    @property
    def corner_error(self) -> Array:
        """How far each corner is off, (n, K) [px]."""
        return np.asarray(np.linalg.norm(self.left, axis=2))

    @property
    def rms(self) -> Array:
        """Rms distance of the corners of each image from their predicted pixels, (n,) [px]."""
        return np.asarray(np.sqrt(np.nanmean(self.corner_error**2, axis=1)))


def find_board(lens: Lens, corners: Array, pixels: Array) -> BoardPoses:
    """Return where the board stands in each image.

    A flat board has two tilts that look much alike: both are refined, and the one that fits better is kept.

    Args:
        lens: of the camera.
        corners: of the board, (K, 3) [m] in the plane z = 0.
        pixels: as seen, (n, K, 2) [px], NaN where a corner is not; at least ``FEWEST_CORNERS`` an image.
    """
    R, p = _from_homography(lens.directions(pixels), corners)
    first = refine_poses(lens, corners, pixels, R, p)
    other = refine_poses(lens, corners, pixels, _mirror_tilt(first), first.p_CB)
    better = (other.rms < first.rms)[:, None]
    return BoardPoses(
        np.where(better[..., None], other.R_CB, first.R_CB),
        np.where(better, other.p_CB, first.p_CB),
        np.where(better[..., None], other.left, first.left),
    )


def refine_poses(lens: Lens, corners: Array, pixels: Array, R: Array, p: Array) -> BoardPoses:
    """Return the poses by least squares, far corners counting less, from R (n, 3, 3) and p (n, 3) [m]."""
    huber = 2.5  # times an image's median error, from which on a corner counts less
    least_middle = 0.1  # [px] of a median error: below it corners are as good as they can be
    damping = 1e-9  # share of the largest curvature: an image whose corners lie on one line stays where it is
    unseen = np.isnan(pixels[..., 0])
    halfway = np.maximum((~unseen).sum(axis=1, keepdims=True) - 1, 0) // 2
    for step_number in range(STEPS):
        left, J = pose_slopes(lens, corners, pixels, R, p)
        size = np.linalg.norm(left, axis=2)
        middle = np.take_along_axis(np.sort(np.where(unseen, np.inf, size), axis=1), halfway, axis=1)
        weight = huber_weights(size, huber * middle)
        if step_number >= STEPS // 2:  # where the rest has found its place, what lies elsewhere has no say
            weight = np.where(size > OUTSIDE * np.maximum(middle, least_middle), 0.0, weight)
        H = np.einsum("nk,nkia,nkib->nab", weight, J, J)
        H += np.eye(6) * (damping * np.trace(H, axis1=1, axis2=2) + 1e-300)[:, None, None]
        step = np.linalg.solve(H, np.einsum("nk,nkia,nki->na", weight, J, left)[..., None])[..., 0]
        p = p + step[:, :3]
        p[:, 2] = np.maximum(p[:, 2], 1e-3)
        R = exp3(step[:, 3:]) @ R
    left, _ = pose_slopes(lens, corners, pixels, R, p)
    return BoardPoses(R, p, np.where(np.isnan(pixels), np.nan, left))


def pose_slopes(lens: Lens, corners: Array, pixels: Array, R: Array, p: Array) -> tuple[Array, Array]:
    """Return pixels less those of poses (n, K, 2), and the derivative of the latter (n, K, 2, 6) [px/m, px/rad].

    A step is a shift of the board in the camera's axes, then a turn about its middle. Zeros where no corner is seen.
    """
    r = np.einsum("nij,kj->nki", R, corners)
    p_C = r + p[:, None]
    unseen = np.isnan(pixels[..., 0])
    left = np.where(unseen[..., None], 0.0, pixels - np.nan_to_num(lens.pixels(p_C)))
    J = lens.slopes(p_C)
    J[unseen] = 0.0
    return left, np.concatenate([J, -J @ skew(r)], axis=3)


def refine_lens(lens: Lens, corners: Array, pixels: Array, prior: Array) -> Lens:
    """Return the lens that fits all images best, each with a pose of its own (Zhang, IEEE PAMI 22 (2000) 1330).

    ``prior`` (8,) are one-sigma sizes of what is unknown of the lens, a pixel being the size of a corner's error.
    """
    for _ in range(STEPS):
        found = find_board(lens, corners, pixels)
        left, J = pose_slopes(lens, corners, pixels, found.R_CB, found.p_CB)
        p_C = np.einsum("nij,kj->nki", found.R_CB, corners) + found.p_CB[:, None]
        L = np.where(np.isnan(pixels)[..., None], 0.0, lens.lens_slopes(p_C))
        n = len(pixels)
        J, L, e = J.reshape(n, -1, 6), L.reshape(n, -1, L.shape[-1]), left.reshape(n, -1)
        # poses out of the way: their part of the pixels is projected off
        Q = np.linalg.qr(J)[0]
        L = L - Q @ (Q.transpose(0, 2, 1) @ L)
        H = np.einsum("nia,nib->ab", L, L) + np.diag(prior**-2.0)
        step = np.linalg.solve(H, np.einsum("nia,ni->a", L, e))
        lens = lens.move_by(step)
        if np.abs(step / prior).max() < 1e-6:
            break
    return lens


def drop_far_corners(found: BoardPoses, pixels: Array, limit: float) -> tuple[Array, int]:
    """Return the pixels without corners further than ``limit`` [px] off, and how many these were."""
    with np.errstate(invalid="ignore"):
        far = found.corner_error > limit
    return np.where(far[..., None], np.nan, pixels), int(far.sum())


def _from_homography(xy: Array, corners: Array) -> tuple[Array, Array]:
    """Closed form: the map of the board's plane onto the plane at one metre, by linear least squares (Zhang 2000)."""
    seen = ~np.isnan(xy[..., 0])
    size = np.linalg.norm(corners, axis=1).max()
    X = np.column_stack([corners[:, :2] / size, np.ones(len(corners))])
    w = np.where(seen[..., None], np.nan_to_num(xy), 0.0)
    X = np.where(seen[..., None], X, 0.0)
    zero = np.zeros_like(X)
    A = np.concatenate(
        [np.concatenate([X, zero, -w[..., :1] * X], axis=2), np.concatenate([zero, X, -w[..., 1:] * X], axis=2)], axis=1
    )
    H = np.linalg.eigh(A.transpose(0, 2, 1) @ A)[1][:, :, 0].reshape(-1, 3, 3)
    H[:, :, :2] /= size
    scale = np.linalg.norm(H[:, :, :2], axis=1).mean(axis=1)
    H = H / (scale * np.where(H[:, 2, 2] < 0, -1.0, 1.0))[:, None, None]
    a, b, p = H[:, :, 0], H[:, :, 1], H[:, :, 2]
    return nearest_rotation(np.stack([a, b, np.cross(a, b)], axis=2)), p.copy()


def _mirror_tilt(found: BoardPoses) -> Array:
    """Return the other tilt: the board's normal mirrored at the line of sight."""
    sight = found.p_CB / np.linalg.norm(found.p_CB, axis=1, keepdims=True)
    normal = found.R_CB[:, :, 2]
    wanted = 2 * np.einsum("ni,ni->n", normal, sight)[:, None] * sight - normal
    axis = np.cross(normal, wanted)
    sine = np.linalg.norm(axis, axis=1, keepdims=True)
    angle = np.arctan2(sine[:, 0], np.einsum("ni,ni->n", normal, wanted))
    return np.asarray(exp3(axis / np.maximum(sine, 1e-12) * angle[:, None]) @ found.R_CB)
