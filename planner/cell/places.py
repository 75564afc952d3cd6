"""What a cell file says of the tool, the fixtures, the artifact, the tracker and the head of indicators."""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from planner.cell.file import FIRST_POINT, CellFile, FixtureFile, PlacedFile, ToolFile
from planner.cell.parts import Ball, Fixture, Nest, Tool, ToolPoint
from planner.common.choices import SetUp
from planner.common.errors import InputError
from planner.common.units import MM, UM, Array, from_deg, from_mm, read_only
from planner.kinematics.bodies import Body
from planner.kinematics.robot import Robot


def read_tool(path: Path, tool: ToolFile | None, robot: Robot, planning: bool) -> Tool:
    """Return the tool; without one, where that is enough, a point at the flange that the run will place.

    Raises:
        InputError: no tool where a plan needs one, one that is too heavy, or an axis that is none.
    """
    if tool is None and not planning:
        nowhere = ToolPoint(FIRST_POINT, read_only(np.zeros(3)), read_only([0, 0, 1]))
        # 20.0 * MM: [m] what is left to find of a frame or tool point after it was placed from the run
        return Tool((nowhere,), 0.0, read_only(np.zeros(3)), (), (20.0 * MM), known=False)
    if tool is None:
        raise InputError(
            f"{path}: the section [tool] with map_mm is missing: where ball, reflector or target sit on the flange"
        )
    if robot.payload is not None and tool.mass_kg > robot.payload:
        raise InputError(
            f"{path}: tool.mass_kg = {tool.mass_kg:g} exceeds the rated payload of {robot.name}, {robot.payload:g} kg"
        )
    return Tool(
        _read_tool_points(path, tool),
        tool.mass_kg,
        read_only(from_mm(tool.com_mm)),
        tuple(b.body(f"tool_{k}", path.parent) for k, b in enumerate(tool.bodies)),
        tool.prior_mm * MM if tool.map_sigma_um is None else tool.map_sigma_um * UM,
        measured=tool.map_sigma_um is not None,
        work=None if tool.work_mm is None else read_only(from_mm(tool.work_mm)),
    )


def _read_tool_points(path: Path, tool: ToolFile) -> tuple[ToolPoint, ...]:
    """All points of the tool, that of ``map_mm`` first; an axis that is not given is the first one's."""
    given = [("tool.map_axis", FIRST_POINT, tool.map_mm, tool.map_axis)]
    given += [(f"tool.points.{p.name}.map_axis", p.name, p.map_mm, p.map_axis or tool.map_axis) for p in tool.points]
    return tuple(ToolPoint(name, read_only(from_mm(at)), unit_vector(path, key, axis)) for key, name, at, axis in given)


def read_fixtures(path: Path, robot: Robot, file: CellFile, usual: SetUp) -> tuple[Fixture, ...]:
    """Return the cups, set up in the ``usual`` way where the file does not say how.

    Raises:
        InputError: a mount pose that is none of the robot's, or one for several tool points.
    """
    more = file.tool.points if file.tool else ()
    given = [f"fixtures.{f.name}.mount_deg" for f in file.fixtures if f.mount_deg]
    given += ["gauge.mount_deg"] if file.gauge.mount_deg else []
    if more and file.fixtures and given:
        raise InputError(
            f"{path}: '{given[0]}' cannot hold the bar at each of {len(more) + 1} tool points: leave it out, good "
            "mount poses are found"
        )
    common, points = (file.gauge.mount_deg, file.gauge.mount_mm), 1 + len(more)
    return tuple(_read_fixture(path, robot, f, common, points, usual) for f in file.fixtures)


def _read_fixture(
    path: Path,
    robot: Robot,
    f: FixtureFile,
    common: tuple[tuple[float, ...] | None, tuple[float, ...]],
    points: int,
    usual: SetUp,
) -> Fixture:
    key = f"fixtures.{f.name}.mount_deg" if f.mount_deg else "gauge.mount_deg"
    given, slides = (f.mount_deg, f.mount_mm) if f.mount_deg else common
    mount = None if given is None else read_joint_angles(path, robot, key, given, slides)
    axis = unit_vector(path, f"fixtures.{f.name}.axis", f.axis)
    at = read_only(from_mm(f.position_mm))
    return Fixture(f.name, at, axis, f.prior_mm * MM, (mount,) * points, set_up=f.set_up or usual)


def joint_keys(robot: Robot, stem: str) -> str:
    """Return the keys of a cell that say a joint state: ``home_deg``, with ``home_mm`` where a joint slides."""
    return f"{stem}_deg and {stem}_mm" if robot.slides.any() else f"{stem}_deg"


def read_joint_angles(
    path: Path, robot: Robot, key: str, value: tuple[float, ...] | None, slides: tuple[float, ...] = ()
) -> Array:
    """Return the joint angles (N,) [rad] of the key ``key``; ``slides`` are those of joints that slide, in mm.

    Raises:
        InputError: they are missing, not one a joint, or outside the limits.
    """
    turn, travel = int((~robot.slides).sum()), int(robot.slides.sum())
    in_mm = key.removesuffix("deg") + "mm"
    if value is None:
        more = f", and '{in_mm}' with {travel} in millimetres, of joints that slide" if travel else ""
        raise InputError(f"{path}: the key '{key}' is missing ({turn} angles in degrees{more})")
    if len(value) != turn:
        which = f" that turn ({in_mm} is for those that slide)" if travel else ""
        raise InputError(f"{path}: '{key}' has {len(value)} angles, but {robot.name} has {turn} joints{which}")
    if len(slides) != travel:
        raise InputError(
            f"{path}: '{in_mm}' has {len(slides)} values, but {robot.name} has {travel} joints that slide (in mm)"
        )
    shown = np.empty(robot.n_joints)
    shown[~robot.slides], shown[robot.slides] = value, slides
    q = from_deg(shown)
    for i in np.flatnonzero((q < robot.q_lower) | (q > robot.q_upper)):
        low, up = np.rad2deg(robot.q_lower[i]), np.rad2deg(robot.q_upper[i])
        said, unit = (in_mm, " mm") if robot.slides[i] else (key, "°")
        raise InputError(
            f"{path}: '{said}' has joint {i + 1} at {shown[i]:g}{unit}, outside its limits {low:g}{unit} … {up:g}{unit}"
        )
    return read_only(q)


def unit_vector(path: Path | str, key: str, v: tuple[float, float, float]) -> Array:
    """Return the direction (3,) of the key ``key``; ``path`` is where messages say that it stands.

    Raises:
        InputError: it has no length.
    """
    norm = float(np.linalg.norm(v))
    if norm < 1e-9:
        raise InputError(f"{path}: '{key}' = {list(v)} is no direction")
    return read_only(np.array(v) / norm)


def read_balls(path: Path, file: CellFile) -> tuple[Ball, ...]:
    """Return the balls or sockets of a cell file.

    Raises:
        InputError: an axis that is no direction.
    """
    return tuple(
        Ball(
            b.name,
            read_only(from_mm(b.position_mm)),
            b.radius_mm * MM,
            None if b.stem_to_mm is None else read_only(from_mm(b.stem_to_mm)),
            b.stem_radius_mm * MM,
            unit_vector(path, f"balls.{b.name}.axis", b.axis),
        )
        for b in file.balls
    )


def read_artifact_bodies(path: Path, file: CellFile) -> tuple[Body, ...]:
    """Return the bodies of the artifact, in its own frame."""
    bodies = () if file.artifact is None else file.artifact.bodies
    return tuple(b.body(f"artifact_{k}", path.parent) for k, b in enumerate(bodies))


def read_nests(file: CellFile) -> tuple[Nest, ...]:
    """Return the nests of a tracker."""
    nests = () if file.tracker is None else file.tracker.nests
    return tuple(
        Nest(n.name, read_only(from_mm(n.position_mm)), None if n.read_mm is None else read_only(from_mm(n.read_mm)))
        for n in nests
    )


def nests_frame(file: CellFile) -> tuple[Array, Array]:
    """Return R (3, 3), p (3,) [m] of the nests' frame in the base frame: the artifact's, or the base's own."""
    if file.artifact is None:
        return read_only(np.eye(3)), read_only(np.zeros(3))
    return placed_frame(file.artifact)


def placed_frame(placed: PlacedFile) -> tuple[Array, Array]:
    """Return R (3, 3), p (3,) [m] of what a cell places, in the base frame."""
    R = Rotation.from_euler("xyz", from_deg(placed.rpy_deg)).as_matrix()
    return read_only(R), read_only(from_mm(placed.position_mm))
