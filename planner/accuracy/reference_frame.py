"""A tracker's frame found from nests, the models of a robot judged in it, and what even a perfect one would show."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from planner.accuracy.assumptions import FRAMES
from planner.cell.cell import Cell
from planner.cell.places import nests_frame
from planner.common.errors import InputError
from planner.common.units import Array, to_deg, to_mm
from planner.documents.calibrated_robot import CalibratedRobot
from planner.gauges.placement.frames import are_collinear, place_frames
from planner.gauges.placement.solver import FlangePoses
from planner.kinematics.geometry import registration, skew
from planner.kinematics.robot import Loads, Robot
from planner.kinematics.robot_reader import load_robot
from planner.model.gauge_frames import PlacePose
from planner.model.identification_document import Identification
from planner.model.model import Model
from planner.runs.run import Run


@dataclass(frozen=True)
class NestFrame:
    """Where the nests' frame W stands in the robot's base: R_BW (3, 3), p_BW (3,) [m]."""

    R_BW: Array
    p_BW: Array


@dataclass(frozen=True)
class TrackerRegistration:
    """Where the tracker's frame G stands in the nests' frame W: R_WG (3, 3), p_WG (3,) [m].

    ``misses`` (k,) [m] is what is left at each nest, ``p_WN`` (k, 3) [m] where they are.
    """

    R_WG: Array
    p_WG: Array
    misses: Array
    p_WN: Array

    def to_nests(self, p_GM: Array) -> Array:
        """Bring points (n, 3) [m] from the tracker's frame to the nests'."""
        return np.asarray(p_GM @ self.R_WG.T + self.p_WG)


def nest_frame(cell: Cell) -> NestFrame:
    """Return where the nests' frame stands as the cell says: with the artifact, or on the base without one."""
    return NestFrame(*nests_frame(cell.file))


def register_tracker(cell: Cell) -> TrackerRegistration:
    """Find the tracker's frame from the cell's nests.

    Raises:
        InputError: fewer than three nests were read, they lie on a line, or one is not where it should be.
    """
    read = [n for n in cell.nests if n.p_GN is not None]
    if len(read) < FRAMES.fewest_nests:
        missing = [n.name for n in cell.nests if n.p_GN is None]
        which = f"read_mm is missing for {', '.join(missing)}" if missing else f"it has {len(read)} of them"
        raise InputError(
            f"{cell.path}: the tracker's frame takes {FRAMES.fewest_nests} nests in [[tracker.nests]]; {which}; each "
            "needs its place there and a line '# nest_mm: NAME, x, y, z' above the columns of the run"
        )
    W, G = np.array([n.p_WN for n in read]), np.array([n.p_GN for n in read])
    if are_collinear(W):
        raise InputError(f"{cell.path}: the nests lie nearly on one line, about which the tracker's frame stays open")
    R, p = registration(W, G, np.ones(len(W)))
    misses = np.linalg.norm(G @ R.T + p - W, axis=1)
    if misses.max() > FRAMES.nest_tolerance:
        metres = " (their readings look like metres)" if np.ptp(G, axis=0).max() < np.ptp(W, axis=0).max() / 500 else ""
        raise InputError(
            f"{cell.path}: the nests miss their places by up to {float(to_mm(misses.max())):.3f} mm{metres}, with the"
            f" tracker's frame as it fits best, and {float(to_mm(FRAMES.nest_tolerance)):g} mm are allowed: read them "
            "again, look whether two were exchanged, or check their position_mm"
        )
    return TrackerRegistration(R, p, misses, W)


def position_errors(robot: Robot, p_FM: Array, stand: NestFrame, frame: TrackerRegistration, run: Run) -> Array:
    """Return where the tracker saw the tool less where the robot's model has it, in the base frame, (n, 3) [m].

    Args:
        robot: nominal or calibrated; before and after differ in nothing else but ``stand``.
        p_FM: the reflector in the flange, (3,) [m].
        stand: where the nests' frame stands in this robot's base; a calibration on the artifact finds it.
        frame: of the tracker.
        run: positions, read in the tracker's own frame.

    Raises:
        InputError: the run has no positions.
    """
    if run.readings.position is None:
        raise InputError(f"{run.name}: a validation needs the tracker's x_mm, y_mm, z_mm")
    p_BF, R_BF = CalibratedRobot(robot).flange(run.samples.q)
    model = p_BF + R_BF @ p_FM
    seen = frame.to_nests(run.readings.position) @ stand.R_BW.T + stand.p_BW
    return np.asarray(seen - model)


@dataclass(frozen=True)
class ErrorFloor:
    """Root mean square distances over the poses [m], as declared: by the nests, by the tracker, by the arm."""

    nests: float
    tracker: float
    arm: float

    @property
    def all(self) -> float:
        """Error by nests, tracker and arm together, rms [m]."""
        return float(np.sqrt(self.nests**2 + self.tracker**2 + self.arm**2))

    def text(self) -> str:
        """Say it in a sentence."""
        whole, nests, tracker, arm = (float(to_mm(v)) for v in (self.all, self.nests, self.tracker, self.arm))
        first = f"{nests:.3f} by the nests' readings, " if nests else ""
        return (
            f"{whole:.3f} mm rms is what a perfect model would show: {first}{tracker:.3f} by the tracker's noise, "
            f"{arm:.3f} by the arm's repeatability"
        )


def error_floor(cell: Cell, run: Run, frame: TrackerRegistration, by_nests: bool = True) -> ErrorFloor:
    """Work it out for the poses of a run with positions; without ``by_nests`` the model stands by no nest."""
    assert run.readings.position is not None
    noise = Model.from_cell(cell).reading_noise(run.samples)
    nests = frame_uncertainty(frame, frame.to_nests(run.readings.position), cell.gauge.noise)
    return ErrorFloor(
        float(np.sqrt((nests**2).mean())) * by_nests,
        float(np.sqrt(noise.gauge_variance.sum(axis=1).mean())),
        float(np.sqrt(noise.robot_variance.sum(axis=1).mean())),
    )


def frame_uncertainty(frame: TrackerRegistration, p_WM: Array, noise: float) -> Array:
    """Root mean square distance (n,) [m] by which nests read with ``noise`` [m] put points p_WM (n, 3) wrongly."""
    own = _rigid_jacobian(frame.p_WN).reshape(-1, 6)
    rows = _rigid_jacobian(p_WM)
    covariance = noise**2 * np.linalg.inv(own.T @ own)
    return np.asarray(np.sqrt(np.einsum("nij,jk,nik->n", rows, covariance, rows)))


def _rigid_jacobian(p: Array) -> Array:
    """How points (n, 3) move with a small shift and turn of their frame, (n, 3, 6)."""
    return np.concatenate([np.broadcast_to(np.eye(3), (len(p), 3, 3)), -skew(p)], axis=2)


RESULTS = "identification.json"


@dataclass(frozen=True)
class RobotModel:
    """A robot to be judged: its model, the reflector p_FM (3,) [m] in its flange, where the nests' frame stands.

    ``notes`` are what a person should know of it; ``by_nests`` is false where that frame was found through the tracker,
    so that what the nests' readings are off by shows nowhere.
    """

    robot: Robot
    p_FM: Array
    stand: NestFrame
    notes: tuple[str, ...] = ()
    by_nests: bool = True


def nominal_model(cell: Cell) -> RobotModel:
    """Return the robot of the data sheet, standing where the cell says."""
    return RobotModel(cell.robot, cell.tool.p_FM, nest_frame(cell))


def calibrated_model(cell: Cell, model: Path, frame: TrackerRegistration, others: Run | None = None) -> RobotModel:
    """Return the calibrated robot of ``model``, placed in the frame of the nests, with the reflector on its flange.

    Both are as its calibration found them. One with a bar finds neither; they are then fitted to the poses ``others``,
    by which the robot is not judged.

    Raises:
        InputError: no robot there, or another one than the cell's.
        NoSolutionError: the other poses cannot place it.
    """
    robot = load_robot(str(model))
    if robot.name != cell.robot.name:
        raise InputError(f"{model}: is a model of {robot.name}, but {cell.path} has the robot {cell.robot.name}")
    edited = [edit.sentence for edit in robot.hand_edits]
    robot, notes = _with_tool_load(cell, robot)
    notes += edited
    path = (model if model.is_dir() else model.parent) / RESULTS
    found = Identification.read(path) if path.is_file() else None
    if found is not None and found.robot != robot.name:
        raise InputError(f"{path}: is the identification of {found.robot}, but {model} is a model of {robot.name}")
    stand, by_nests = (None, True) if found is None else _fitted_frame(cell, found, frame)
    if found is not None and stand is not None:
        return RobotModel(robot, _reflector(cell, found), stand, (*notes, *_frame_notes(cell, stand)), by_nests)
    if others is not None and len(others) >= FRAMES.placing_poses:
        return _place_model(robot, others, frame, notes)
    why = "says nothing of where the nests stand, its gauge stood elsewhere" if found is not None else "is missing"
    notes.append(
        f"{path} {why}: the calibrated robot is taken to stand where the cell says. An error of its place counts "
        f"as an error of the robot. {FRAMES.placing_poses} or more poses of the plan to calibrate with (--plan) would "
        "place it"
    )
    return RobotModel(robot, cell.tool.p_FM, nest_frame(cell), tuple(notes))


def _place_model(robot: Robot, others: Run, frame: TrackerRegistration, notes: list[str]) -> RobotModel:
    """Place the calibrated robot in the nests' frame, and the reflector on it, by poses that nothing is judged by."""
    p_BF, R_BF = CalibratedRobot(robot).flange(others.samples.q)
    assert others.readings.position is not None
    found = place_frames(FlangePoses.of_one(p_BF, R_BF), frame.to_nests(others.readings.position))
    notes.append(
        f"the model's gauge stood elsewhere: {len(others)} poses of the plan to calibrate with placed robot and "
        "reflector, those that it is judged by had no part in it"
    )
    return RobotModel(robot, found.p_FM[0], NestFrame(found.R_BG[0], found.p_BG[0]), tuple(notes), by_nests=False)


def _with_tool_load(cell: Cell, robot: Robot) -> tuple[Robot, list[str]]:
    """Return the robot with the tool that the cell has, and what to say where it was calibrated with another."""
    if robot.loads is None or not cell.tool.mass or not robot.effects:
        return robot, []
    here = Loads(cell.tool.mass, cell.tool.com_F, robot.loads.base_rpy)
    same = abs(here.payload - robot.loads.payload) < 1e-6 and np.allclose(here.com_F, robot.loads.com_F, atol=1e-6)
    note = f"calibrated with a tool of {robot.loads.payload:g} kg, judged with one of {here.payload:g} kg"
    return replace(robot, loads=here), [] if same else [note]


def _fitted_frame(cell: Cell, found: Identification, frame: TrackerRegistration) -> tuple[NestFrame | None, bool]:
    """Where the calibration has the nests' frame, ``None`` if unsaid, and whether as that of the artifact."""
    nominal = nest_frame(cell)
    tracker = NestFrame(nominal.R_BW @ frame.R_WG, nominal.R_BW @ frame.p_WG + nominal.p_BW)
    for place in found.frames.places:
        fitted = _frame_of_place(place)
        if _frames_agree(fitted, nominal, FRAMES.artifact_off):
            return fitted, True
        if _frames_agree(
            fitted, tracker, FRAMES.artifact_off + FRAMES.artifact_turned * float(np.linalg.norm(frame.p_WG))
        ):  # T_BW = T_BG · T_WG⁻¹
            R = fitted.R_BW @ frame.R_WG.T
            return NestFrame(R, fitted.p_BW - R @ frame.p_WG), False
    return None, True


def _frame_notes(cell: Cell, stand: NestFrame) -> list[str]:
    """Say so where the nests stand well away from where the cell has them."""
    stated = nest_frame(cell)
    off = float(np.linalg.norm(stand.p_BW - stated.p_BW))
    turned = float(Rotation.from_matrix(stand.R_BW.T @ stated.R_BW).magnitude())
    if off < FRAMES.elsewhere and turned < FRAMES.tilted:
        return []
    return [
        f"by the calibration the nests' frame stands {float(to_mm(off)):.1f} mm and {float(to_deg(turned)):.2f}° away "
        "from where the cell says: before it that counts as the robot's error"
    ]


def _frame_of_place(place: PlacePose) -> NestFrame:
    R = Rotation.from_euler("xyz", place.rpy).as_matrix()
    return NestFrame(np.asarray(R), np.array(place.position))


def _frames_agree(a: NestFrame, b: NestFrame, near: float) -> bool:
    turned = float(Rotation.from_matrix(a.R_BW.T @ b.R_BW).magnitude())
    return float(np.linalg.norm(a.p_BW - b.p_BW)) < near and turned < FRAMES.artifact_turned


def _reflector(cell: Cell, found: Identification) -> Array:
    """The reflector in the flange: as fitted, where the calibration measured the same point of the tool."""
    nominal = {p.name: p.nominal for p in found.estimates}
    there = [nominal.get(f"map_{axis}", np.nan) for axis in "xyz"]
    if len(found.frames.tool) == 1 and np.allclose(there, cell.tool.p_FM, rtol=0, atol=FRAMES.same_point):
        return np.array(found.frames.tool[0].p_FM)
    return cell.tool.p_FM
