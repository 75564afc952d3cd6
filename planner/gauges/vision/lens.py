"""A pinhole camera with OpenCV's distortion: from points before the camera to pixels, its derivatives, and back.

Source: OpenCV documentation, "Camera Calibration and 3D Reconstruction": coefficients k1, k2, p1, p2, k3, pixels
counted from the centre of the first one.
"""

from dataclasses import dataclass, replace

import numpy as np

from planner.common.units import Array

LENS_UNKNOWNS = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")  # that a run may free, in the order of their columns
NEAREST = 1e-6  # [m] before the camera: a point behind it has no picture


@dataclass(frozen=True)
class Lens:
    """A camera's intrinsics.

    Attributes:
        focal: fx, fy (2,) [px].
        centre: cx, cy (2,) [px].
        distortion: k1, k2, p1, p2, k3 (5,).
        size: width and height of an image [px].
    """

    focal: Array
    centre: Array
    distortion: Array
    size: tuple[int, int]

    def pixels(self, p_C: Array) -> Array:
        """Return the pixels (..., 2) of points (..., 3) [m] in the camera's frame; NaN behind it."""
        xy, _ = self._distort(_in_plane(p_C))
        return np.asarray(np.where(p_C[..., 2:] > NEAREST, self.focal * xy + self.centre, np.nan))

    def slopes(self, p_C: Array) -> Array:
        """Return the derivative of the pixels by the points, (..., 2, 3) [px/m]."""
        xy = _in_plane(p_C)
        _, bent = self._distort(xy)
        z = np.maximum(p_C[..., 2], NEAREST)
        flat = np.zeros((*xy.shape[:-1], 2, 3))
        flat[..., 0, 0] = flat[..., 1, 1] = 1 / z
        flat[..., 2] = -xy / z[..., None]
        return np.asarray(self.focal[:, None] * (bent @ flat))

    def lens_slopes(self, p_C: Array) -> Array:
        """Return the derivative of the pixels by ``LENS_UNKNOWNS``, (..., 2, 8) [px].

        Focal lengths change by a share of themselves, the centre by a share of them, so that none has a unit.
        """
        xy = _in_plane(p_C)
        bent, _ = self._distort(xy)
        x, y, r2 = xy[..., 0], xy[..., 1], (xy**2).sum(axis=-1)
        out = np.zeros((*xy.shape[:-1], 2, len(LENS_UNKNOWNS)))
        out[..., 0, 0], out[..., 1, 1] = bent[..., 0], bent[..., 1]
        out[..., 0, 2] = out[..., 1, 3] = 1.0
        out[..., 4], out[..., 5] = xy * r2[..., None], xy * r2[..., None] ** 2
        out[..., 0, 6], out[..., 1, 6] = 2 * x * y, r2 + 2 * y**2
        out[..., 0, 7], out[..., 1, 7] = r2 + 2 * x**2, 2 * x * y
        return np.asarray(out * self.focal[:, None])

    def move_by(self, step: Array) -> "Lens":
        """Return the lens with ``LENS_UNKNOWNS`` moved by a step (8,) in the units of :meth:`lens_slopes`."""
        distortion = self.distortion.copy()
        distortion[:4] += step[4:]
        return replace(
            self, focal=self.focal * (1 + step[:2]), centre=self.centre + self.focal * step[2:4], distortion=distortion
        )

    def directions(self, pixels: Array) -> Array:
        """Return where pixels (..., 2) look: points (..., 2) of the plane one metre before an ideal camera."""
        undistort_steps = 12  # of Newton's, which end at rounding for any lens whose picture does not fold
        wanted = (pixels - self.centre) / self.focal
        xy = np.array(wanted)
        for _ in range(undistort_steps):
            found, bent = self._distort(xy)
            miss = wanted - found
            det = bent[..., 0, 0] * bent[..., 1, 1] - bent[..., 0, 1] * bent[..., 1, 0]
            step = np.stack(
                [
                    bent[..., 1, 1] * miss[..., 0] - bent[..., 0, 1] * miss[..., 1],
                    bent[..., 0, 0] * miss[..., 1] - bent[..., 1, 0] * miss[..., 0],
                ],
                axis=-1,
            )
            xy = xy + step / np.where(np.abs(det) > 1e-3, det, 1.0)[..., None]
        return xy

    def sees(self, pixels: Array) -> np.ndarray:
        """Tell which pixels (..., 2) lie in the image, (...) bool."""
        with np.errstate(invalid="ignore"):
            return np.asarray(((pixels >= 0) & (pixels <= np.array(self.size) - 1)).all(axis=-1))

    @property
    def half_angle(self) -> float:
        """Angle of the widest cone about the optical axis that lies in the image [rad]."""
        width, height = (s - 1.0 for s in self.size)
        cx, cy = self.centre
        edges = np.array([[0.0, cy], [width, cy], [cx, 0.0], [cx, height]])
        return float(np.arctan(np.linalg.norm(self.directions(edges), axis=1).min()))

    def _distort(self, xy: Array) -> tuple[Array, Array]:
        """Return distorted points (..., 2) of the plane at one metre, and their derivative (..., 2, 2)."""
        k1, k2, p1, p2, k3 = self.distortion
        x, y = xy[..., 0], xy[..., 1]
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        slope = 2 * (k1 + r2 * (2 * k2 + 3 * r2 * k3))  # of the radial factor, over x and over y
        out = np.stack(
            [x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y],
            axis=-1,
        )
        bent = np.empty((*xy.shape, 2))
        bent[..., 0, 0] = radial + x * x * slope + 2 * p1 * y + 6 * p2 * x
        bent[..., 0, 1] = bent[..., 1, 0] = x * y * slope + 2 * p1 * x + 2 * p2 * y
        bent[..., 1, 1] = radial + y * y * slope + 6 * p1 * y + 2 * p2 * x
        return out, bent


def _in_plane(p_C: Array) -> Array:
    return np.asarray(p_C[..., :2] / np.maximum(p_C[..., 2:], NEAREST))
