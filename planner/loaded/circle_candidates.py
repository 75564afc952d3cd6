"""Places where a loaded circle could be driven: a grid of centres, three planes from both sides, followed round.

Turning everything about axis 1 changes no torque of the bar, so the centres lie in one upright plane through that axis,
the one in which the cell's own circle has its centre.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.cell.cell import Cell, MeasurementSetup, setup_of
from planner.cell.reading import cell_file_of, cell_of
from planner.circular.configurations import follow_poses, rotated_orientations
from planner.circular.plan import Circle, CirclePlane, circles_of
from planner.common.determinism import on_one_thread
from planner.common.errors import InputError, NoSolutionError
from planner.common.units import MM, Array, read_only, to_mm
from planner.design.selection.d_optimal import detmax
from planner.effects.compliance import compliance_parameters
from planner.kinematics.geometry import bar_state, tilt_angle
from planner.kinematics.inverse_kinematics import smallest_singular_value, solve_pose_ik
from planner.loaded.assumptions import DEFLECTION, DRIVABLE
from planner.loaded.compliance import harmonic_counts, harmonics_of
from planner.loaded.types import AveragedCurves, DrivenCircle
from planner.model.model import Model
from planner.runs.run import Samples

FOLLOWED_ANGLES = 36  # of a circle that is followed: every 10 degrees
STEPS = (7, 6)  # of the grid in distance from axis 1, and in height
PLANES: tuple[CirclePlane, ...] = ("XY", "XZ", "YZ")


@dataclass(frozen=True)
class CirclePlace:
    """A circle that the arm can drive, loaded and repeated as the cell's own.

    Attributes:
        circle: where it lies.
        p_BX: the fixture's ball (3,) [m].
        q: controller angles round the circle, from angle 0 on, (B, N) [rad].
    """

    circle: Circle
    p_BX: Array
    q: Array

    @property
    def side(self) -> int:
        """1 where the circle lies ahead of its fixture along its normal, −1 behind."""
        return 1 if (self.circle.p_BC - self.p_BX) @ self.circle.normal >= 0 else -1

    @property
    def axis_B(self) -> Array:
        """Axis of the fixture's ball joint, towards the circle (3,)."""
        return self.side * self.circle.normal


def find_circle_places(cell: Cell, seed: int = 0, steps: tuple[int, int] = STEPS) -> tuple[CirclePlace, ...]:
    """Return every place of the grid whose circle the arm follows within limits and cones, in a fixed order.

    ``steps`` are those of the grid. Collisions are not looked at here: the plan of a chosen cell judges them.

    Raises:
        InputError: the cell has no circle to take radius and loads from.
        NoSolutionError: no circle can be followed anywhere.
    """
    circle = own_circle(cell)
    grid = [
        (replace(circle, plane=plane, p_BC=read_only(c)), side)
        for c in _centre_grid(cell, circle, steps)
        for plane in PLANES
        for side in (1, -1)
    ]
    found = _follow_circles(cell, grid, abs(_centre_height(cell, circle)), seed)
    if not found:
        raise NoSolutionError(
            f"{cell.path}: none of {len(grid)} circles of radius {circle.radius / MM:.0f} mm can be followed within "
            "joint limits and cones: widen gauge.cone_deg, or drive a smaller circle"
        )
    return tuple(found)


def find_own_place(cell: Cell, seed: int = 0) -> CirclePlace:
    """Return the cell's own circle as a candidate.

    Raises:
        InputError: the cell has no circle.
        NoSolutionError: the arm cannot follow it.
    """
    circle = own_circle(cell)
    height = _centre_height(cell, circle)
    found = _follow_circles(cell, [(circle, 1 if height >= 0 else -1)], abs(height), seed)
    if not found:
        raise NoSolutionError(
            f"{cell.path}: circle {circle.name} cannot be followed within joint limits and cones from its fixture"
        )
    return found[0]


def own_circle(cell: Cell) -> Circle:
    """Return the cell's first circle.

    Raises:
        InputError: it has none, or it is driven without loads.
    """
    if not circles_of(cell):
        raise InputError(f"{cell.path}: has no [[circles]]; radius, loads and the bar's lean are taken from the first")
    if len(circles_of(cell)[0].loads) < 2:
        raise InputError(
            f"{cell.path}: circle {circles_of(cell)[0].name} has {len(circles_of(cell)[0].loads)} loads in loads_N; a "
            "stiffness needs two at least, better five"
        )
    return circles_of(cell)[0]


def _centre_height(cell: Cell, circle: Circle) -> float:
    return float((circle.p_BC - cell.fixtures[circle.fixture].p_BX) @ circle.normal)


def _centre_grid(cell: Cell, circle: Circle, steps: tuple[int, int]) -> list[Array]:
    """Grid of centres in the upright plane through axis 1 and the cell's own centre."""
    reach = sum(t.extent for t in cell.robot.transforms if t.kind == "translation")
    towards = np.append(circle.p_BC[:2] / np.linalg.norm(circle.p_BC[:2]), 0.0)
    far = np.linspace(DRIVABLE.nearest_share * reach, DRIVABLE.furthest_share * reach, steps[0])
    high = np.linspace(circle.radius + 0.1, DRIVABLE.top_share * reach, steps[1])
    return [np.round(r * towards + [0, 0, z], 3) for r in far for z in high]


def _follow_circles(cell: Cell, grid: list[tuple[Circle, int]], height: float, seed: int) -> list[CirclePlace]:
    """Circles that can be followed, each in its roomiest way; the fixture lies ``height`` [m] off each on one side."""
    normals = np.array([side * circle.normal for circle, side in grid])
    p_BX = np.array([circle.p_BC for circle, _ in grid]) - height * normals
    theta = np.arange(FOLLOWED_ANGLES) * 2 * np.pi / FOLLOWED_ANGLES
    x = np.array([circle.points(theta) for circle, _ in grid])
    which, start, R = _find_starts(cell, x[:, 0], normals, seed)
    q, reached = follow_poses(cell, start, x[which], np.repeat(R[:, None], FOLLOWED_ANGLES, axis=1), lead=0.0)
    whole = np.flatnonzero(reached == FOLLOWED_ANGLES)
    room = np.array([_smallest_margin(cell, q[m], p_BX[which[m]], normals[which[m]]) for m in whole])
    out = []
    for k, (circle, _) in enumerate(grid):
        own = np.flatnonzero((which[whole] == k) & (room > DRIVABLE.limit_margin))
        if len(own):
            best = whole[own[int(np.argmax(np.round(room[own], 6)))]]
            out.append(CirclePlace(circle, read_only(p_BX[k]), read_only(q[best])))
    return out


def _find_starts(cell: Cell, x: Array, normals: Array, seed: int) -> tuple[np.ndarray, Array, Array]:
    """Start poses: which circle (m,), angles (m, N) [rad] and orientation (m, 3, 3), the tool against the normal."""
    from scipy.stats import qmc  # costs most of a second

    spins = 4  # turns of the tool about its own axis
    robot = cell.robot
    low, high = np.maximum(robot.q_lower, -np.pi / 2), np.minimum(robot.q_upper, np.pi / 2)
    # 8 arm positions from which a start is looked for
    seeds = np.vstack([cell.home, low + qmc.Sobol(robot.n_joints, seed=seed).random_base2(3) * (high - low)])
    R = np.repeat(rotated_orientations(cell.tool.axis_F, -normals, spins), len(seeds), axis=0)
    which = np.repeat(np.arange(len(x)), spins * len(seeds))
    # 40: rounds of Newton for a start
    q, good = solve_pose_ik(cell.chain, robot, np.tile(seeds, (len(x) * spins, 1)), x[which], R, 40)
    q = (q + np.pi) % (2 * np.pi) - np.pi
    good &= ((q > robot.q_lower) & (q < robot.q_upper)).all(axis=1)
    return which[good], q[good], R[good]


def _smallest_margin(cell: Cell, q: Array, p_BX: Array, axis_B: Array) -> float:
    """Smallest distance of a way round from limits, cones and singularities [rad]."""
    robot = cell.robot
    direction = bar_state(cell.map_position(q), p_BX).direction
    return float(
        min(
            (robot.q_upper - q).min(),
            (q - robot.q_lower).min(),
            (cell.gauge.cone_fixture - tilt_angle(direction, axis_B)).min(),
            (cell.gauge.cone_map - tilt_angle(-direction, cell.map_axis(q))).min(),
            smallest_singular_value(cell.chain, cell.robot, q).min(),
        )
    )


def with_circles(cell: Cell, places: Sequence[CirclePlace]) -> Cell:
    """Return the cell with fixtures and circles P1 … at these places, each driven and loaded as the cell's own."""
    content = cell.file.model_dump(mode="json", by_alias=True, exclude_none=True)
    fixture, circle = content["fixtures"][own_circle(cell).fixture], content["circles"][0]
    fixture.pop("mount_deg", None)
    circle.pop("start_deg", None)
    content["fixtures"], content["circles"] = [], []
    for k, p in enumerate(places):
        name, axis = f"P{k + 1}", p.axis_B + 0.0
        content["fixtures"].append({**fixture, "name": name, "position_mm": _mm(p.p_BX), "axis": axis.tolist()})
        where = {"plane": p.circle.plane, "centre_mm": _mm(p.circle.p_BC), "tool_axis": (0.0 - axis).tolist()}
        content["circles"].append({**circle, "name": name, "fixture": name, **where})
    there = cell_of(cell_file_of(content, str(cell.path)), cell.path, cell.name)
    return replace(cell, file=there.file, fixtures=there.fixtures, sections=there.sections)


def _mm(point: Array) -> list[float]:
    return [float(v) for v in np.round(to_mm(point), 3)]


@dataclass(frozen=True)
class PredictedCompliance:
    """What some circles would tell: standard deviation with the prior (N,), and without (N,), per prior sigma."""

    std: Array
    alone: Array

    @property
    def worst_share(self) -> float:
        """Share of its prior sigma that the least known joint keeps."""
        return float(self.std.max())


@dataclass(frozen=True)
class CirclePlaceChoice:
    """Candidates, what each tells, and the best sets of one, two, … places.

    Attributes:
        names: of the compliances.
        pool: the candidates; information: of each in prior sigmas, (M, N, N).
        own: what the cell's own circle tells.
        sets: positions in the pool of the best 1, 2, … places; known: what each set tells.
    """

    names: tuple[str, ...]
    pool: tuple[CirclePlace, ...]
    information: Array
    own: PredictedCompliance
    sets: tuple[np.ndarray, ...]
    known: tuple[PredictedCompliance, ...]

    def best_places(self, count: int) -> list[CirclePlace]:
        """Return the best set of ``count`` places."""
        return [self.pool[int(i)] for i in self.sets[count - 1]]


def select_circle_places(
    cell: Cell, pool: Sequence[CirclePlace], own: CirclePlace, most: int, seed: int = 0
) -> CirclePlaceChoice:
    """Choose the places whose circles know the compliances best together (largest determinant, DETMAX)."""
    setup = setup_of(cell)
    stiff = compliance_parameters(setup)
    prior = np.array([p.prior for p in stiff])
    information = np.array([predict_information(setup, c) for c in pool]) * np.outer(prior, prior)
    rows = np.array([_information_root(block) for block in information])
    sets = tuple(detmax(rows, k, seed=seed) for k in range(1, min(most, len(pool)) + 1))
    return CirclePlaceChoice(
        tuple(p.name for p in stiff),
        tuple(pool),
        read_only(information),
        predict_compliance(predict_information(setup, own) * np.outer(prior, prior)),
        sets,
        tuple(predict_compliance(information[s].sum(axis=0)) for s in sets),
    )


def predict_information(setup: MeasurementSetup, place: CirclePlace) -> Array:
    """Information of the compliances by one circle driven as the cell's own, (N, N) [(Nm/rad)²].

    It is the one that the evaluation finds, with the noise that gauge and repeatability promise.
    """
    circle = place.circle
    curves = planned_curves(setup, place)
    there = replace(setup, p_BX=place.p_BX[None], place_names=(circle.name,), place_prior=setup.place_prior[:1])
    model = Model(there, tuple(compliance_parameters(setup)))
    waves = harmonics_of(model, curves, DRIVABLE.typical_compliance_share * model.prior)
    return waves.information(curves.noise, float(setup.place_prior[circle.fixture])).information


def planned_curves(setup: MeasurementSetup, place: CirclePlace) -> AveragedCurves:
    """Return the curves that a circle would give, without their readings."""
    circle = place.circle
    D, K, B = len(circle.directions), len(circle.loads), len(place.q)
    loads, shape = np.array(circle.loads), (D, K, B)
    axes = np.stack([*circle.axes, place.axis_B])
    where = DrivenCircle(circle.p_BC, read_only(axes), circle.radius, place.p_BX, circle.name, 0)
    there = replace(setup, p_BX=place.p_BX[None])
    return AveragedCurves(
        circle=where,
        theta=read_only(np.arange(B) * 2 * np.pi / B),
        directions=(1, -1)[:D],
        loads=read_only(loads),
        q=read_only(np.broadcast_to(place.q, (*shape, place.q.shape[1]))),
        length=read_only(np.zeros(shape)),
        force=read_only(np.broadcast_to(loads[:, None], shape)),
        noise=read_only(predicted_turn_noise(there, place.q)),
        repeats=np.full((D, K), circle.repeats),
    )


def predicted_turn_noise(setup: MeasurementSetup, q: Array) -> Array:
    """Variance of one turn's harmonics, (H,) [m²]: the gauge's in all, the arm's repeatability in the first few."""
    B = len(q)
    noise = Model(setup, ()).reading_noise(Samples.at(q))
    count = harmonic_counts(B)
    few = np.zeros(len(count))
    few[: DEFLECTION.spread_harmonics] = (
        float(noise.robot_variance.mean()) * count.sum() / count[: DEFLECTION.spread_harmonics].sum()
    )
    return np.asarray(few + noise.gauge_variance[0])


def predict_compliance(information: Array) -> PredictedCompliance:
    """Return how well an information (per prior sigma, (N, N)) determines each compliance."""
    size = np.diag(np.linalg.inv(information + np.eye(len(information))))
    alone = np.diag(np.linalg.inv(information + 1e-12 * np.trace(information) * np.eye(len(information))))
    return PredictedCompliance(read_only(np.sqrt(size)), read_only(np.sqrt(alone)))


def _information_root(block: Array) -> Array:
    """Rows J (N, N) with JᵀJ the information."""
    size, axes = np.linalg.eigh(block)
    return np.asarray(np.sqrt(np.maximum(size, 0.0))[:, None] * axes.T)


@on_one_thread
def study_circle_places(cell: Cell, most: int = 6, seed: int = 0) -> CirclePlaceChoice:
    """Find where up to ``most`` loaded circles tell the compliances of a cell's arm apart.

    Raises:
        InputError: the cell has no circle under load.
        NoSolutionError: no circle can be followed.
    """
    return select_circle_places(cell, find_circle_places(cell, seed), find_own_place(cell, seed), most, seed)
