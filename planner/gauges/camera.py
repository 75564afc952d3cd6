"""A camera that sees a flat board: on the flange with the board standing, or standing with the board on the flange.

A camera whose lens the run finds as well: eight numbers more of each image, and eight parameters that move them.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar, Self, cast

import numpy as np

from planner.cell.cell import MeasurementSetup
from planner.cell.file import CellFile
from planner.cell.gauge_registry import register_gauge
from planner.cell.placement import P, Placement
from planner.common.errors import InputError
from planner.common.units import Array
from planner.effects.basis import BasisFunction
from planner.effects.context import Context
from planner.effects.effect import Parameter, ParameterMove
from planner.gauges.vision.board_camera import POSE_NUMBERS, BoardCamera
from planner.gauges.vision.board_pose import refine_lens
from planner.gauges.vision.lens import LENS_UNKNOWNS, Lens
from planner.kinematics.chain import ForwardPass
from planner.kinematics.robot import Robot
from planner.runs.run import Run, Samples

# one sigma of what is unknown of a lens whose data sheet was read: focal lengths to 3 %, the centre to 3 % of them,
# little distortion; of a lens that was calibrated some time ago it is far less
PRIORS = (0.03, 0.03, 0.03, 0.03, 0.2, 0.2, 5e-3, 5e-3)
WORDS = ("focal length along u", "focal length along v", "centre along u", "centre along v", *(
    f"distortion {name}" for name in LENS_UNKNOWNS[4:]
))  # fmt: skip


@dataclass(frozen=True)
class LensRows:
    """How the numbers of images change with the lens, (n, r, 8) [m], computed once for all functions that ask."""

    def __call__(self, c: Context) -> Array:
        """Return the rows for the images of a context."""
        setup = c.measurement_setup
        assert isinstance(setup.gauge, FreeLensCamera)
        return setup.gauge.lens_rows(setup, c.samples, c.motion)


LENS_ROWS = LensRows()


class LensMove(BasisFunction, key="lens:NUMBER:NUMBER", static=False, gauge=True):
    """How one number of an image changes with one unknown of the lens [m]."""

    unknown: float
    number: float

    def __call__(self, c: Context) -> Array:
        """Return φ for every image, (n,)."""
        return c.value(LENS_ROWS)[:, int(self.number), int(self.unknown)]


@dataclass(frozen=True)
class FreeLensCamera(BoardCamera):
    """Reads the corners of a board through a lens that is not known well.

    The pixels are kept in a basis that holds how they change with the lens as well.
    """

    width: ClassVar[int] = POSE_NUMBERS + len(LENS_UNKNOWNS)

    def basis_of(self, samples: Samples, R: Array, p: Array) -> Array:
        """Return the basis Q, (n, 2K, 14): of the board's moves, then what is left of the lens's beside them."""
        Q = super().basis_of(samples, R, p)
        L = self._lens_slopes(samples, R, p) * np.array(PRIORS)
        beside = np.linalg.svd(L - Q @ (Q.transpose(0, 2, 1) @ L), full_matrices=False)[0]
        return np.concatenate([Q, beside], axis=2)

    def _lens_slopes(self, samples: Samples, R: Array, p: Array) -> Array:
        p_C = np.einsum("nij,kj->nki", R, self.board.corners) + p[:, None]
        L = np.where(self.visible_corners(samples)[..., None], self.lens.lens_slopes(p_C), 0.0)
        return np.asarray(L.reshape(len(samples), -1, len(LENS_UNKNOWNS)))

    def lens_rows(self, setup: Placement, samples: Samples, motion: ForwardPass) -> Array:
        """Return how the numbers of images change with the lens, (n, 14, 8) [m]."""
        R, p, _ = self.view(setup, samples, motion)
        Q = self.basis(setup, samples)
        return np.asarray(self.number_scale * Q.transpose(0, 2, 1) @ self._lens_slopes(samples, R, p))

    def lens_of(self, pixels: Array) -> Lens:
        """Return the lens that fits all images, each with a board of its own, best."""
        return refine_lens(self.lens, self.board.corners, pixels, np.array(PRIORS))

    def place(self, setup: P, run: Run, p_FM: Array | None) -> P:
        """Find the lens first, and by it where camera and board are."""
        known = replace(self, lens=self.lens_of(self.whole_pixels(run.readings)))
        placed = BoardCamera.place(known, setup, run, p_FM)
        assert isinstance(placed, MeasurementSetup)
        return replace(placed, gauge=known)

    def lasting_places(self, setup: Placement) -> dict[str, Array] | None:
        """Return ``None``: no file keeps the lens as found, by which later images would have to be read."""
        return None

    def parameters(self, setup: Placement, free: frozenset[str]) -> Iterator[Parameter]:
        """What is unknown of the lens beside the places."""
        left = 0.1  # of it once all images together have found the lens
        yield from super().parameters(setup, free)
        for k, (name, words, prior) in enumerate(zip(LENS_UNKNOWNS, WORDS, PRIORS, strict=True)):
            moves = tuple(ParameterMove("reading", n, LensMove(float(k), float(n))) for n in range(self.width))
            yield Parameter(f"lens_{name}", "1", left * prior, f"{words} of the lens", moves, "gauge")

    def own_errors_text(self, before: float, after: float, values: Mapping[str, float]) -> str:
        """Say the lens as well."""
        lens = self.lens.move_by(np.array([values.get(f"lens_{n}", 0.0) for n in LENS_UNKNOWNS]))
        (fx, fy), (cx, cy) = lens.focal, lens.centre
        bent = ", ".join(f"{v:.4f}" for v in lens.distortion)
        found = f"fx {fx:.1f}, fy {fy:.1f}, cx {cx:.1f}, cy {cy:.1f} px, distortion {bent}"
        return f"{super().own_errors_text(before, after, values)}; the lens as found: {found}"


@register_gauge
@dataclass(frozen=True)
class Camera(BoardCamera):
    """A camera as a cell file has it."""

    @classmethod
    def read(cls, path: Path, robot: Robot, file: CellFile, planning: bool) -> Self:
        """Return the camera; where the run is to find its lens, one that keeps more of each image.

        Raises:
            InputError: the board has too few corners for that.
        """
        made = super().read(path, robot, file, planning)
        if not made.lens_free:
            return made
        if len(made.board) < FreeLensCamera.width:
            raise InputError(
                f"{path}: 'gauge.lens.free' needs a board of {FreeLensCamera.width} corners or more, and the "
                f"{made.board} has {len(made.board)}: calibrate the lens beforehand"
            )
        return cast(Self, FreeLensCamera(**made.fields_by_name))
