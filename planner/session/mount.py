"""Where a session starts and ends: the cell's own mount pose, or a good one that is found."""

from dataclasses import dataclass, replace

import numpy as np

from planner.cell.cell import Cell
from planner.cell.places import joint_keys
from planner.cell.workspace import Workspace
from planner.common.errors import InputError, NoSolutionError
from planner.common.progress import UNLIMITED, LastStart, TimeLimit
from planner.common.summary import Aside
from planner.common.units import Array, round_angles
from planner.design.candidates.pool import PoseSet, draw_candidates
from planner.design.pose_selection import identify_candidates
from planner.design.selection.certificate import Certificate
from planner.design.selection.index_bound import certify_bound, price_candidates
from planner.motion.collision.scene import advise_never_meet
from planner.motion.path.connection import add_room
from planner.motion.path.constraints import Constraints
from planner.motion.path.parts import PartMap
from planner.runs.run import FIRST_MOUNTING, Mounting
from planner.session.tolerances import FEW_JOINED_SHARE, ROOMY_SHARE


def check_home(cell: Cell, without_bar: Constraints) -> None:
    """Refuse a home where the robot itself collides.

    Raises:
        InputError: naming the two bodies or the limit.
    """
    reason = without_bar.reason(cell.home)
    if reason is not None:
        keys = without_bar.touching_links(cell.home)
        cure = f"; where only crude shapes touch, {advise_never_meet(keys)}" if keys else ""
        raise InputError(f"{cell.path}: {joint_keys(cell.robot, 'home')} cannot be the start pose: {reason}{cure}")


def with_mounts(cell: Cell, seed: int, limit: TimeLimit = UNLIMITED) -> Cell:
    """Return the cell with a mount pose for every fixture and tool point: see :func:`settle_mounts`."""
    return settle_mounts(cell, seed, limit)[0]


def settle_mounts(cell: Cell, seed: int, limit: TimeLimit = UNLIMITED) -> tuple[Cell, dict[Mounting, PartMap]]:
    """Return the cell with a mount pose for every fixture and tool point: its own, checked, or one that is found.

    The twist of a cable along the bar is counted from there, so it is settled before the candidates are drawn.
    Beside it: the parts of the valid states, which a search for a pose has found, where it counts no twist.

    Raises:
        InputError: home or a mount pose of the cell breaks a constraint.
        NoSolutionError: no pose at all holds the bar.
    """
    check_home(cell, Constraints(cell, bar=False))
    found: dict[Mounting, PartMap] = {}
    for m in cell.mountings:
        if cell.mount(m) is None:
            pose, found[m] = _find_mount(cell, m, seed, limit)
            cell = cell.with_mount(m, round_angles(pose))
    for m in cell.mountings:
        reason = Constraints(cell, m).reason(np.asarray(cell.mount(m)))
        if reason is not None:
            raise InputError(
                f"{cell.path}: mount_deg of fixture {cell.place_name(m)} cannot hold the {cell.gauge.noun}: {reason}"
            )
    if cell.cable.tool_about_bar is not None or len(cell.mountings) > 1:
        return cell, {}  # they were found without the twist, or without the other fixtures
    return cell, {m: p.begin_at(_with_room(cell, m, limit), np.asarray(cell.mount(m))) for m, p in found.items()}


def move_mounts(cell: Cell, given: Cell, pool: PoseSet, reach: "MountMaps") -> Cell:
    """Return the cell with other mount poses, in the largest part of the candidates, where nearly none are joined.

    The cable's twist is counted from the mount pose, so which candidates there are, and their parts, depend on it.

    Args:
        cell: with mount poses; those of ``given`` stay.
        given: the cell as the user wrote it.
        pool: candidates.
        reach: which of them a path joins to their mount pose.
    """
    for m in cell.mountings:
        mine = np.flatnonzero(pool.samples.at_mounting(m))
        if given.mount(m) is None and len(mine) and reach.joined[mine].mean() < FEW_JOINED_SHARE:
            largest = mine[reach.maps[m].parts(pool.q[mine]) == 0]
            if len(largest):
                cell = cell.with_mount(m, round_angles(_quickest_roomy(cell.at(m), pool.q[largest])))
    return cell


@dataclass(frozen=True)
class MountMaps:
    """What can be reached from the mount poses.

    Attributes:
        joined: which candidates lie in their mount pose's part, (n,) bool.
        maps: the parts of the valid states at each mounting, the mount pose their start.
    """

    joined: np.ndarray
    maps: dict[Mounting, PartMap]

    @classmethod
    def judge(cls, pool: PoseSet, maps: dict[Mounting, PartMap]) -> "MountMaps":
        """Judge the poses of a pool by their neighbours in the maps."""
        joined = np.zeros(len(pool), dtype=bool)
        for m, known in maps.items():
            mine = np.flatnonzero(pool.samples.at_mounting(m))
            joined[mine] = known.joins_start(pool.q[mine])
        return cls(joined, maps)

    def with_poses(self, pool: PoseSet, certain: np.ndarray) -> "MountMaps":
        """Judge the poses of a pool anew, those in ``certain`` (positions, ascending) as states of the roadmaps."""
        samples = pool.samples.take(certain)
        maps = {m: known.with_poses(samples.q[samples.at_mounting(m)]) for m, known in self.maps.items()}
        return MountMaps.judge(pool, maps)


def drop_unreachable(
    cell: Cell, pool: PoseSet, reach: MountMaps, index: str, poses: int | None, seed: int, limit: TimeLimit = UNLIMITED
) -> tuple[PoseSet, MountMaps, tuple[str, ...], Certificate]:
    """Keep the candidates that a path joins to the mount pose; a note says how many others there were.

    The certificate bounds the index over these candidates; it is rough, and later bounds begin with it.

    Where the cable or an obstacle splits the shell in parts, a tour must keep to one of them. All candidates are judged
    by their neighbours in a roadmap (``reach``, of :func:`join_to_mounts`). Those whose price in the bound singles
    them out are in it themselves.

    Raises:
        NoSolutionError: too few are joined to it to choose from.
    """
    likely = pool.take(reach.joined)
    try:
        _, _, rows = identify_candidates(cell, likely)
    except NoSolutionError as few:
        raise NoSolutionError(f"{few}{_describe_apart(len(pool), len(likely))}") from None
    n = min(poses or 35, len(rows))  # poses, where no number is given
    # 5e-3: [1] gap of the bound, whose prices single out likely candidates
    rough = certify_bound(rows, index, n, tolerance=5e-3, seed=seed, limit=limit)
    if limit.must_stop(
        LastStart.ROADMAP, "paths to the mount pose were looked for from a sample of the candidates alone"
    ):
        reach = replace(reach, joined=np.ones(len(likely), dtype=bool))
    else:
        order, _ = price_candidates(rows, rough, n)
        # 2000: likely candidates that are joined to the roadmap themselves
        reach = reach.with_poses(likely, np.sort(order[:2000]))
    lost = len(pool) - int(reach.joined.sum())
    note = Aside(f"{lost} of {len(pool)} candidates were left out: no path joins them to the mount pose")
    return likely.take(reach.joined), reach, (note,) if lost else (), rough.restrict_to_candidates(reach.joined)


def _describe_apart(count: int, joined: int) -> str:
    """Say that few of ``count`` candidates are joined to the mount pose, and what helps; empty where all are."""
    if joined == count:
        return ""
    return (
        f"; {count - joined} of {count} candidates were left out, as no path joins them to the mount pose: give "
        "another gauge.mount_deg, lower motion.clearance_mm, or name links whose crude shapes touch in never_meet"
    )


def join_to_mounts(
    cell: Cell, pool: PoseSet, seed: int, found: dict[Mounting, PartMap] | None = None, limit: TimeLimit = UNLIMITED
) -> MountMaps:
    """Tell which candidates lie in their mount pose's part.

    The parts are those ``found`` with the mount pose, else those of a roadmap over a sample of the candidates.
    """
    maps = dict(found or {})
    for m in cell.mountings:
        if m not in maps:
            q = pool.q[pool.samples.at_mounting(m)]
            maps[m] = PartMap.of(_with_room(cell, m, limit), np.vstack([np.array(cell.mount(m)), q]), seed)
    return MountMaps.judge(pool, maps)


def _find_mount(cell: Cell, mounting: Mounting, seed: int, limit: TimeLimit) -> tuple[Array, PartMap]:
    """Return a pose in the largest part of the shell, and its parts."""
    one = replace(cell.without_twist.restrict_to(mounting), plan=replace(cell.plan, grid_step=None))
    q = draw_candidates(one, 2000, seed, limit=limit).q  # poses among which a mount pose is looked for
    parts = PartMap.of(_with_room(one, FIRST_MOUNTING, limit), q, seed)
    return _quickest_roomy(one, q[parts.parts(q) == 0]), parts


def _with_room(cell: Cell, mounting: Mounting, limit: TimeLimit) -> Constraints:
    """Return the constraints of roadmaps: with the room of the ways that are sought on them later."""
    constraints, mount = Constraints(cell, mounting, limit=limit), cell.mount(mounting)
    return add_room(constraints, np.empty((0, cell.robot.n_joints)) if mount is None else np.array([mount]))


def _quickest_roomy(cell: Cell, q: Array) -> Array:
    """Return, of the poses q (n, N) [rad] with the most room to every limit, the one that is quickest from home."""
    margins = Workspace(cell).margins(q)
    room = (margins / np.median(margins, axis=0)).min(axis=1)
    roomy = q[np.argsort(-room, kind="stable")[: max(1, int(ROOMY_SHARE * len(q)))]]
    seconds = (np.abs(roomy - cell.home) / cell.robot.speed).max(axis=1)
    return np.asarray(roomy[int(np.argmin(seconds))])


def with_point_mount(cell: Cell, away: Constraints, seed: int, pool: Array | None = None) -> Cell:
    """Return the cell with the pose where the session starts and ends.

    A head is mastered with its opening upwards, so that gravity holds the master ball (TriCal paper, section 3). A
    tracker is to see the reflector there: the nearest to home of the candidates ``pool`` (n, N) [rad].

    Raises:
        InputError: home or the cell's own pose breaks a constraint.
        NoSolutionError: no pose turns the head upwards.
    """
    check_home(cell, away)
    given = cell.mount(FIRST_MOUNTING)
    if given is not None:
        reason = away.reason(given)
        if reason is not None:
            raise InputError(f"{cell.path}: gauge.mount_deg cannot be where the session starts: {reason}")
        return cell
    found = _draw_upright(cell, away, seed) if pool is None else pool
    seconds = (np.abs(found - cell.home) / cell.robot.speed).max(axis=1)
    return cell.with_mount(FIRST_MOUNTING, round_angles(found[int(np.argmin(seconds))]))


def _draw_upright(cell: Cell, away: Constraints, seed: int) -> Array:
    upright = np.deg2rad(10.0)  # tilt at which the master ball still rests in its socket
    robot, rng = cell.robot, np.random.default_rng([seed, 3])
    half = np.where(robot.slides, np.inf, np.pi)
    lower, upper = np.maximum(robot.q_lower, cell.home - half), np.minimum(robot.q_upper, cell.home + half)
    q = rng.uniform(lower, upper, (200_000, robot.n_joints))  # states among which a pose for mastering is looked for
    up = cell.map_axis(q) @ cell.base.R_WB[2]
    q = q[up > np.cos(upright)]
    q = q[away.valid(q)]
    if not len(q):
        raise NoSolutionError(
            f"no collision-free pose turns the head upwards within {np.rad2deg(upright):.0f}°, as mastering the "
            "indicators takes: give gauge.mount_deg"
        )
    return np.asarray(q)
