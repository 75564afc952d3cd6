"""The reading of a camera that sees a flat board, its derivative, and what a run of it tells of where both are.

A reading is the pixels of one image. All that an image of a flat board says of where the board stands before the
camera are six numbers. The rest of its pixels only tells how noisy they are. So an image enters the model by six
numbers z = Qᵀ(u, v), Q (2K, 6) an orthonormal basis of how its corners move with the board: their noise is that of a
corner, the same for all six and free of correlation, and nothing that the image knows is lost. They are scaled to
lengths at the board, at the middle of the range of distances: all corners that are off by a pixel there are off by as
much as that pixel covers. The first three follow from shifts of the board (right, down, away), the others from tilts.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from planner.cell.gauge import Gauge
from planner.cell.placement import P, Placement, Targets
from planner.cell.site import Site
from planner.common.errors import InputError
from planner.common.units import Array, read_only
from planner.effects.basis import BasisFunction
from planner.effects.catalogue import Excitation
from planner.effects.context import Context
from planner.effects.effect import Effect, Parameter, ParameterMove, Place, transform_move
from planner.gauges.placement.frames import place_frames
from planner.gauges.placement.solver import LOCATED_SIGMA, flange_poses
from planner.gauges.vision.board_pose import BoardPoses, drop_far_corners, find_board, pose_slopes
from planner.gauges.vision.lens import Lens
from planner.gauges.vision.sight import BoardSight
from planner.kinematics.chain import ForwardPass
from planner.runs.run import Readings, Run, Samples

POSE_NUMBERS = 6  # of a board before a camera
FEWEST_CORNERS = 4  # of an image that counts


@dataclass
class _LastBasis:
    """The basis of the samples that were asked for last, with what was asked: written at once, for threads read it."""

    known: tuple[Placement, Samples, Array] | None = None


class BoardScale(BasisFunction, key="board-scale:NUMBER", static=False, gauge=True):
    """φ = how one number of an image changes with the size of the board, relative [m]."""

    number: float

    def __call__(self, c: Context) -> Array:
        """Return φ for every image, (n,)."""
        setup = c.measurement_setup
        assert isinstance(setup.gauge, BoardCamera)
        return setup.gauge.scale_rows(setup, c.samples, c.motion)[:, int(self.number)]


@dataclass(frozen=True)
class BoardCamera(BoardSight):
    """Reads the corners of a board in an image."""

    last: _LastBasis = field(default_factory=_LastBasis, repr=False, compare=False)

    kind: ClassVar[str] = "camera"
    columns: ClassVar[str] = "corner, u_px, v_px"
    plural: ClassVar[str] = "images"
    width: ClassVar[int] = POSE_NUMBERS
    angles: ClassVar[int] = 3
    default_noise_um: ClassVar[float] = 1.0  # said in pixels
    largest_scale: ClassVar[float] = 2e-2  # printers are a hundredth off

    def with_turns(self, turns: bool) -> Gauge:
        """Return the camera whose frames are those of the placement alone: a run or a file says where they stand."""
        free = read_only(np.eye(3))
        return replace(self, R_BG=free, p_BG=read_only(np.zeros(3)), R_FM=free, last=_LastBasis())

    # ---- one reading

    @property
    def footprint(self) -> float:
        """What a pixel covers at the middle of the range of distances [m/px]."""
        middle = (self.length_min + self.length_max) / 2 if np.isfinite(self.length_max) else 0.5
        return float(middle / self.lens.focal.mean())

    @property
    def number_scale(self) -> float:
        """Length at the board that one number of a reading stands for [m/px]."""
        return float(self.footprint / np.sqrt(len(self.board)))

    @property
    def sigmas(self) -> Array:
        """The same for each number: an orthonormal basis keeps the noise of the pixels."""
        return np.full(self.width, self.noise_px * self.number_scale)

    def view(self, setup: Placement, samples: Samples, motion: ForwardPass) -> tuple[Array, Array, Array]:
        """Return how the board stands before the camera, R_CB (n, 3, 3), p_CB (n, 3) [m], and R_BC (n, 3, 3)."""
        R_M = motion.R.transpose(2, 0, 1) @ setup.R_FM[samples.point_numbers] @ self.R_FM
        R_S, p_S = setup.R_BG[samples.place], setup.p_BG[samples.place]
        R_G, p_G = R_S @ self.R_BG, R_S @ self.p_BG + p_S
        R_BC, R_BB, away = (R_M, R_G, p_G - motion.x.T) if self.on_flange else (R_G, R_M, motion.x.T - p_G)
        R_CB = R_BC.transpose(0, 2, 1)
        return R_CB @ R_BB, np.einsum("nij,nj->ni", R_CB, away), R_BC

    def basis(self, setup: Placement, samples: Samples) -> Array:
        """Return the basis Q of the pixels in which images are read, (n, 2K, 6), on the setup as it stands.

        It is J (JᵀJ)^(-1/2), which turns least of all orthonormal bases from the columns of J: its numbers follow the
        board's shifts and tilts. Corners that an image does not show have no part in it.
        """
        if (known := self.last.known) is not None and known[0] is setup and known[1] is samples:
            return known[2]
        motion = setup.chain.forward(setup.robot.theta(samples.q), setup.offsets(samples))
        R, p, _ = self.view(setup, samples, motion)
        basis = self.basis_of(samples, R, p)
        self.last.known = setup, samples, basis
        return basis

    def basis_of(self, samples: Samples, R: Array, p: Array) -> Array:
        """Return the basis where boards stand at R (n, 3, 3), p (n, 3) [m] before the camera."""
        J = self._slopes(samples, R, p)
        size, axes = np.linalg.eigh(J.transpose(0, 2, 1) @ J)
        least = np.sqrt(np.maximum(size, 1e-12 * size[:, -1:] + 1e-300))
        return np.asarray(J @ (axes / least[:, None] @ axes.transpose(0, 2, 1)))

    def _slopes(self, samples: Samples, R: Array, p: Array) -> Array:
        """Derivative of the pixels by shifts and by tilts of the board, both as a corner moves, (n, 2K, 6) [px/m]."""
        K = len(self.board)
        seen = np.where(self.visible_corners(samples), np.zeros(2), np.nan)
        J = pose_slopes(self.lens, self.board.corners, seen, R, p)[1].reshape(len(samples), 2 * K, 6)
        J[:, :, 3:] /= self.board.radius
        return J

    def visible_corners(self, samples: Samples) -> np.ndarray:
        """Return which corners of the whole board are seen, (n, K, 1) bool; a run may end before the last of them."""
        if samples.seen is None:
            return np.ones((len(samples), len(self.board), 1), dtype=bool)
        return np.pad(samples.seen, ((0, 0), (0, len(self.board) - samples.seen.shape[1])))[..., None]

    def residual(self, setup: Placement, samples: Samples, motion: ForwardPass, targets: Targets) -> Array:
        """Image seen less the one expected, (n, 6) [m]; without an image the one expected, with the sign turned."""
        R, p, _ = self.view(setup, samples, motion)
        flat = (len(samples), -1)
        expected = np.nan_to_num(self.lens.pixels(np.einsum("nij,kj->nki", R, self.board.corners) + p[:, None]))
        seen = np.zeros(1) if targets.pixels is None else targets.pixels
        left = np.nan_to_num(seen - expected).reshape(flat)
        return np.asarray(self.number_scale * np.einsum("nkr,nk->nr", self.basis(setup, samples), left))

    def project(self, setup: Placement, samples: Samples, motion: ForwardPass, which: np.ndarray) -> Array:
        """How the board moves before the camera with each transform, in the numbers of an image, (k, 6, n)."""
        R, p, R_BC = self.view(setup, samples, motion)
        to_numbers = self.basis(setup, samples).transpose(0, 2, 1) @ self._slopes(samples, R, p)
        middle = motion.x.T if not self.on_flange else motion.x.T + np.einsum("nij,nj->ni", R_BC, p)
        shift = replace(motion, x=np.ascontiguousarray(middle.T)).point_screws(which)
        turn = motion.u[which] * motion.rotation[which, None, None] * self.board.radius
        sign = -1.0 if self.on_flange else 1.0  # a camera that goes to the right sees the board go to the left
        into = sign * self.number_scale * to_numbers
        into = np.concatenate([into[:, :, :3] @ R_BC.transpose(0, 2, 1), into[:, :, 3:] @ R_BC.transpose(0, 2, 1)], 2)
        return np.asarray(np.einsum("nra,kan->krn", into, np.concatenate([shift, turn], axis=1)))

    def targets(self, setup: Placement, samples: Samples, readings: Readings) -> Targets:
        """Return the pixels of the whole board; an image needs no frame."""
        return Targets(pixels=self.whole_pixels(readings))

    def whole_pixels(self, readings: Readings) -> Array:
        """Return the pixels of every corner of the board, (n, K, 2) [px], NaN where one is not seen."""
        assert readings.pixels is not None
        missing = len(self.board) - readings.pixels.shape[1]
        return np.pad(readings.pixels, ((0, 0), (0, missing), (0, 0)), constant_values=np.nan)

    def readings(self, values: Array) -> Readings:
        """Return images with the pixels (n, 2K) [px]; what lies outside of an image is not seen."""
        pixels = values.reshape(len(values), -1, 2)
        return Readings(pixels=read_only(np.where(self.lens.sees(pixels)[..., None], pixels, np.nan)))

    @property
    def full_sigmas(self) -> Array:
        """Noise of every pixel, (2K,) [px]."""
        return np.full(2 * len(self.board), self.noise_px)

    def full_reading(self, setup: Placement, samples: Samples, motion: ForwardPass, shown: Array) -> Array:
        """Return the pixels of every corner, (n, 2K) [px], with what is ``shown`` beside (n, r) [m] put back."""
        R, p, _ = self.view(setup, samples, motion)
        pixels = self.lens.pixels(np.einsum("nij,kj->nki", R, self.board.corners) + p[:, None])
        back = np.einsum("nkr,nr->nk", self.basis(setup, samples), shown / self.number_scale)
        return np.asarray(pixels.reshape(len(samples), -1) + back)

    def reading_numbers(self, samples: Samples, readings: Readings) -> Array | None:
        """Return the pixels of the whole board, (n, 2K) [px]."""
        return self.whole_pixels(readings).reshape(len(samples), -1)

    def own_errors(self, setup: Placement, samples: Samples, fitted: Array, left: Array) -> float:
        """Return how far corners are off, rms [px]: what no place of the board explains, and what is left of it."""
        Q = self.basis(setup, samples)
        beside = np.nan_to_num(fitted)
        beside = beside - np.einsum("nkr,nr->nk", Q, np.einsum("nkr,nk->nr", Q, beside))
        off = beside + np.einsum("nkr,nr->nk", Q, left / self.number_scale)
        corners = np.where(np.isnan(fitted), np.nan, off).reshape(len(samples), -1, 2)
        return float(np.sqrt(np.nanmean((corners**2).sum(axis=2))))

    def own_errors_text(self, before: float, after: float, values: Mapping[str, float]) -> str:
        """Say the reprojection, and where lengths come from."""
        return (
            f"corners of images that no fit saw are {before:.3g} px off before and {after:.3g} px after (reprojection, "
            f"rms); all lengths come from the {self.board}: a board that is 0.1 % larger makes the robot 0.1 % larger"
        )

    def simulate(
        self, cell: Site, samples: Samples, predict: Callable[[Samples], Array],
        slopes: Callable[[Samples], Array], noise: Array,
    ) -> tuple[Samples, Readings]:  # fmt: skip
        """Return the images, without those that show too little of the board."""
        readings = self.readings(predict(samples) + noise)
        assert readings.pixels is not None
        seen = ~np.isnan(readings.pixels[..., 0])
        whole = seen.sum(axis=1) >= FEWEST_CORNERS
        return replace(samples, seen=read_only(seen, bool)).take(whole), readings.take(whole)

    # ---- a run of it

    def check_run(self, cell: Site, run: Run) -> None:
        """Refuse a run of another board or of images of another size."""
        super().check_run(cell, run)
        pixels = run.readings.pixels
        assert pixels is not None
        if pixels.shape[1] > len(self.board):
            raise InputError(
                f"{run.name}: has a corner {pixels.shape[1] - 1}, but the {self.board} of {cell.path} has corners 0 to "
                f"{len(self.board) - 1}: was another board seen?"
            )
        out = np.argwhere(~self.lens.sees(pixels) & ~np.isnan(pixels[..., 0]))
        if len(out):
            n, k = out[0]
            raise InputError(
                f"{run.where(int(n))}: corner {k} lies at ({pixels[n, k, 0]:.1f}, {pixels[n, k, 1]:.1f}) px, outside "
                f"of an image of {self.lens.size[0]} × {self.lens.size[1]} px (gauge.lens of {cell.path}): are the "
                "images of another size than the one that the lens was calibrated at?"
            )

    def sift(self, cell: Site, run: Run) -> Run:
        """Return the run without corners that do not fit their own image, and without images of too few corners.

        An image judges this by itself: whatever the robot is off by moves all its corners alike.

        Raises:
            InputError: hardly any image shows this board by this lens.
        """
        wrong_board = 20.0  # [px] median corner error of a run whose board or lens is another one
        far_pixels = 2.0  # [px] below which no corner is far
        far_corner = 8.0  # times the median corner error of a run from which on a corner was found at another place
        self.check_run(cell, run)
        found, pixels = self.boards(run)
        usual = float(np.nanmedian(found.corner_error)) if len(run) else 0.0
        if not usual < wrong_board:
            raise InputError(
                f"{run.name}: half of the corners are {usual:.0f} px or more from where the {self.board} can have "
                f"them: check gauge.board and gauge.lens of {cell.path}, and how the corners are numbered"
            )
        pixels, far = drop_far_corners(found, pixels, max(far_corner * usual, far_pixels))
        seen = ~np.isnan(pixels[..., 0])
        whole = seen.sum(axis=1) >= FEWEST_CORNERS
        said = list[str]()
        if far:
            said.append(f"{far} corners lie where their own image cannot have them: they were cut out")
        if not whole.all():
            said.append(
                f"{int((~whole).sum())} of {len(run)} images show fewer than {FEWEST_CORNERS} corners (the first: "
                f"{run.where(int(np.argmin(whole)))}): they were cut out"
            )
        if not said:
            return run
        samples = replace(run.samples, seen=read_only(seen, bool))
        sifted = replace(run, samples=samples, readings=Readings(pixels=read_only(pixels)))
        return replace(sifted.take(whole), warnings=(*run.warnings, *said))

    def boards(self, run: Run) -> tuple[BoardPoses, Array]:
        """Return where each image of a run sees the board, and its pixels (n, K, 2), of the whole board."""
        pixels = self.whole_pixels(run.readings)
        return find_board(self.lens_of(pixels), self.board.corners, pixels), pixels

    def lens_of(self, pixels: Array) -> Lens:
        """Return the lens behind the pixels (n, K, 2) [px]: the one that the cell states."""
        return self.lens

    def place(self, setup: P, run: Run, p_FM: Array | None) -> P:
        """Find where camera and board stand and sit, from the pose of the board in every image."""
        found, _ = self.boards(run)
        R, p = found.R_CB, found.p_CB
        if self.on_flange:  # the board is the frame, and the camera is what is read in it
            R = R.transpose(0, 2, 1)
            p = -np.einsum("nij,nj->ni", R, p)
        there = place_frames(flange_poses(setup, run), p, None, R)
        return replace(
            setup, R_BG=there.R_BG, p_BG=there.p_BG, p_FM=there.p_FM, R_FM=there.R_FM, tool_prior=LOCATED_SIGMA
        )

    def place_nominally(self, setup: P, cell: Site) -> P:
        """What an image shows depends on where the other part stands."""
        if not cell.fixtures:
            return setup
        place = cell.fixtures[0]
        return replace(setup, R_BG=place.R_BX[None], p_BG=place.p_BX[None])

    def number_places(self, setup: P, cell: Site, run: Run) -> P:
        """Return the setup with frames to be found; where what is on the flange sits is found as well."""
        return replace(super().number_places(setup, cell, run), fixed=setup.fixed - {"tool"})

    def coordinates(self, setup: Placement, samples: Samples, motion: ForwardPass) -> Iterator[tuple[str, Array]]:
        """Yield the tool point, and where the board is in the picture."""
        yield "position", motion.x.T
        yield "place in the picture", self.view(setup, samples, motion)[1]

    # ---- what is unknown of it

    def parameters(self, setup: Placement, free: frozenset[str]) -> Iterator[Parameter]:
        """Yield pose of the part that stands, and place and turn of the part on the flange, which are always free."""
        yield from super().parameters(setup, free | {"tool"})
        part = "camera" if self.on_flange else "board"
        for axis in "xyz":
            k = setup.chain.index(f"probe_r{axis}")
            what = f"turn of the {part} about {axis}"
            yield Parameter(f"probe_r{axis}", "rad", setup.turn_prior, what, transform_move(k), "gauge")

    def lag_moves(self) -> tuple[ParameterMove, ...]:
        """An image is taken at rest: a late clock does not show."""
        return ()

    def errors(self, run: Excitation) -> Iterator[Effect]:
        """Yield the board's scale, which no image tells from all lengths of the arm: what is stated of it counts."""
        moves = tuple(ParameterMove("reading", n, BoardScale(float(n))) for n in range(self.width))
        scale = Parameter("gauge_scale", "1", self.scale_sigma, "scale of the board", moves)
        sentence = "the board is larger than square_mm or marker_mm say, by {size}"
        yield Effect("gauge scale", Place("gauge"), (scale,), sentence, self.largest_scale, "estimated: printers")

    @property
    def scale_sigma(self) -> float:
        """As the board's file says it."""
        return self.board.file.scale_ppm * 1e-6

    def scale_rows(self, setup: Placement, samples: Samples, motion: ForwardPass) -> Array:
        """Return how the numbers of images change with the size of the board, relative, (n, r) [m]."""
        R, p, _ = self.view(setup, samples, motion)
        r = np.einsum("nij,kj->nki", R, self.board.corners)
        grown = np.einsum("nkij,nkj->nki", self.lens.slopes(r + p[:, None]), r) * self.visible_corners(samples)
        Q = self.basis(setup, samples)
        return np.asarray(self.number_scale * np.einsum("nkr,nk->nr", Q, grown.reshape(len(samples), -1)))
