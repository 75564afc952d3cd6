"""Joint angles at which the nominal robot reaches the poses of a file, in the configuration that the file says.

Why targets cannot be corrected, and what an arm with fewer than six axes cannot do at those that can.
"""

from collections.abc import Sequence
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

from planner.common.sequences import sobol_points
from planner.common.units import DEG, Array
from planner.compensation.arm_shapes import WrittenShape, has_shape, shape_of
from planner.compensation.correction import ALL_TURNS, Correction, NominalFlange, move_limit, solve_flange_ik
from planner.compensation.few_axes import FULL_AXES, ToolDeviation, ToolGoal, solve_few_axes
from planner.compensation.rotations import inverse
from planner.compensation.targets import CartesianTarget, Note, Target
from planner.compensation.tolerances import MISSED_TURN, REACHED
from planner.kinematics.robot import Robot

UNREACHED = "the nominal robot does not reach the pose"


class SearchSeeds:
    """Arm positions that the search for a pose starts from, spread over the limits of one robot."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot

    @cached_property
    def q(self) -> Array:
        """The positions, (m, N) [rad], one turn of each joint at most."""
        lower, upper = self.robot.one_turn
        return np.asarray(lower + _unit_points(self.robot.n_joints) * (upper - lower))

    @cached_property
    def _shapes(self) -> np.ndarray:
        return shape_of(self.robot, self.q)

    @cached_property
    def _features(self) -> Array:
        return self.pose_features(*NominalFlange(self.robot).flange(self.q))

    @cached_property
    def _trees(self) -> dict[int, tuple[np.ndarray, KDTree]]:
        return {}

    def pose_features(self, p: Array, R: Array) -> Array:
        """Return the features by which poses are compared, (n, 12): position over the reach of the arm, and axes."""
        reach = sum(t.extent for t in self.robot.transforms if t.kind == "translation")
        return np.concatenate([2.0 * p / reach, 0.5 * R.reshape(len(p), 9)], axis=1)

    def of_shape(self, shape: int) -> tuple[np.ndarray, KDTree | None]:
        """Return the rows of ``q`` in one shape of the arm, and the tree of their features."""
        if shape not in self._trees:
            own = np.flatnonzero(self._shapes == shape)
            if not own.size:
                return own, None
            self._trees[shape] = own, KDTree(self._features[own])
        return self._trees[shape]


def solve_nominal_angles(targets: list[Target], seeds: SearchSeeds) -> tuple[Array, list[Note]]:
    """Return the angles (n, N) [rad] of the targets of a file, NaN where there are none, and (line, why) of those."""
    q = np.full((len(targets), seeds.robot.n_joints), np.nan)
    problems: list[Note] = []
    for i, target in enumerate(targets):
        if target.q is not None:
            q[i] = target.q
    _from_start(seeds.robot, targets, q, problems)
    _from_configuration(targets, q, problems, seeds)
    return q, problems


def flange_of(poses: list[CartesianTarget]) -> Array:
    """Return the flange in the robot's own frame, (n, 4, 4) [m]."""
    T_WB, T_BT = np.array([p.T_WB for p in poses]), np.array([p.T_BT for p in poses])
    return np.asarray(T_WB @ T_BT @ inverse(np.array([p.T_FT for p in poses])))


def _from_start(robot: Robot, targets: list[Target], q: Array, problems: list[Note]) -> None:
    rows = [(i, t.pose, t.pose.start) for i, t in enumerate(targets) if t.pose is not None and t.pose.start is not None]
    if not rows:
        return
    T = flange_of([pose for _, pose, _ in rows])
    found, ok = _reach(robot, np.array([start for _, _, start in rows]), T)
    for (i, _, _), solution, good in zip(rows, found, ok, strict=True):
        if good:
            q[i] = solution
        else:
            problems.append((targets[i].line, "the pose is not reached from its starting angles"))


def _from_configuration(targets: list[Target], q: Array, problems: list[Note], seeds: SearchSeeds) -> None:
    robot = seeds.robot
    rows = [i for i, t in enumerate(targets) if t.pose is not None and t.pose.start is None]
    if not rows:
        return
    shapes = np.zeros(len(targets), dtype=int)
    given = ~np.isnan(q[:, 0])
    if given.any():
        shapes[given] = shape_of(robot, q[given])
    poses = []
    for i in rows:
        pose, follows = targets[i].pose, targets[i].follows
        assert pose is not None
        wanted = None if pose.configuration is None else pose.configuration.shape
        shapes[i] = shapes[follows[0]] if wanted is None and follows else wanted or 0
        poses.append(pose)
    found, ok = _search(flange_of(poses), shapes[rows], seeds)
    _other_wrists(seeds, poses, found, ok)
    for i, pose, solution, good in zip(rows, poses, found, ok, strict=True):
        target = targets[i]
        before = targets[target.follows[0]].line if target.follows else None
        if before is not None and np.isnan(q[target.follows[0]]).any():
            other = f"line {before}, whose" if before != target.line else "the target before it in its line, whose"
            problems.append((target.line, f"it follows {other} joint angles are not known"))
        elif not good:
            problems.append((target.line, f"{UNREACHED} in {_shape_sentence(before)}"))
        else:
            q[i], why = _choose_turns(robot, pose, solution, q, target.follows[0] if target.follows else None)
            if why:
                problems.append((target.line, f"in {_shape_sentence(before)} {why}"))
    _agree(robot, targets, q, problems)


def _other_wrists(seeds: SearchSeeds, poses: list[CartesianTarget], found: Array, ok: np.ndarray) -> None:
    """Replace angles by those of another shape, where the words leave several and these are in none of their turns."""
    for k, pose in enumerate(poses):
        shapes = pose.configuration.shapes if isinstance(pose.configuration, WrittenShape) else ()
        for shape in shapes[1:]:
            if ok[k] and not _choose_turns(seeds.robot, pose, found[k], found[:0], None)[1]:
                break
            other, good = _search(flange_of([pose]), np.array([shape]), seeds)
            if good[0]:
                found[k], ok[k] = other[0], True


def _agree(robot: Robot, targets: list[Target], q: Array, problems: list[Note]) -> None:
    """Take back the angles of a pose that the arm reaches in another way when it comes from another of its targets."""
    for i, target in enumerate(targets):
        for other in target.follows[1:]:
            if not _in_one_way(robot, q[[i, other]]):
                line = targets[other].line
                problems.append((target.line, f"the arm comes from line {line} too, and may reach it in another way"))
                q[i] = np.nan
                break
    wrong = [i for i, t in enumerate(targets) if any(_turns_over(robot, q[[i, other]]) for other in t.straight)]
    for i in wrong:
        said = "a straight move to it comes from a target in another configuration, which the arm keeps"
        problems.append((targets[i].line, said))
    q[wrong] = np.nan


def _in_one_way(robot: Robot, both: Array) -> bool:
    """Tell whether two rows of angles (2, N) are in one shape of the arm and within half a turn."""
    return not (np.isnan(both).any() or len(set(shape_of(robot, both))) > 1 or np.abs(both[0] - both[1]).max() > np.pi)


def _turns_over(robot: Robot, both: Array) -> bool:
    return not np.isnan(both).any() and not _in_one_way(robot, both)


def _search(T: Array, shapes: np.ndarray, seeds: SearchSeeds) -> tuple[Array, np.ndarray]:
    """Return angles (n, 6) in the shapes (n,) that reach T (n, 4, 4), and which were found."""
    robot = seeds.robot
    q, ok = np.zeros((len(T), robot.n_joints)), np.zeros(len(T), dtype=bool)
    pose_features = seeds.pose_features(T[:, :3, 3], T[:, :3, :3])
    for shape in np.unique(shapes):
        rows = np.flatnonzero(shapes == shape)
        own, tree = seeds.of_shape(int(shape))
        if tree is None:
            continue
        for count in (2, 8, 32):  # positions that the search of one pose starts from, more where fewer did not do
            rows = rows[~ok[rows]]
            if not rows.size:
                break
            near = tree.query(pose_features[rows], k=range(1, min(count, own.size) + 1))[1]
            found, good = _reach(
                robot, seeds.q[own[near]].reshape(-1, robot.n_joints), np.repeat(T[rows], near.shape[1], 0)
            )
            good = (good & has_shape(robot, found, np.full(len(found), shape))).reshape(near.shape)
            q[rows] = found.reshape(*near.shape, -1)[np.arange(len(rows)), good.argmax(axis=1)]
            ok[rows] = good.any(axis=1)
    return q, ok


def _reach(robot: Robot, start: Array, T: Array) -> tuple[Array, np.ndarray]:
    """Return angles (n, N) [rad] from which the nominal flange is at T (n, 4, 4), and which of them do reach it.

    Of an arm with fewer than six axes the place is asked for, and the turn as nearly as it can.
    """
    nominal, p_BF, R_BF = NominalFlange(robot), T[:, :3, 3], T[:, :3, :3]
    if robot.n_joints < FULL_AXES:
        goal = ToolGoal(np.broadcast_to(np.eye(4), T.shape), p_BF, R_BF)
        q = solve_few_axes(robot, nominal, start, goal, ALL_TURNS, np.inf)
        return q, np.asarray(np.linalg.norm(goal.missing_motion(nominal, q)[0], axis=1) < REACHED)
    # 30, 0: iterations, all with the nominal Jacobian, which is exact here
    q = solve_flange_ik(robot, nominal, start, p_BF, R_BF, (30, 0))
    p, R = nominal.flange(q)
    far, off = np.abs(p - p_BF).max(axis=1), np.abs(R - R_BF).max(axis=(1, 2))
    return q, (far < REACHED) & (off < REACHED)


def _shape_sentence(before: int | None) -> str:
    return "the shape that is said" if before is None else f"the shape of the target before (line {before})"


def _choose_turns(
    robot: Robot, pose: CartesianTarget, solution: Array, q: Array, follows: int | None
) -> tuple[Array, str]:
    """Add the whole turns that the configuration says, or that bring the angles nearest to those before.

    Returns:
        The angles (N,) [rad], NaN where there are none, and why there are none.
    """
    A = robot.coupling_matrix
    whole = (np.round(A) == A).all(axis=0) & ~robot.slides  # its turn leaves the pose
    options = solution + 2.0 * np.pi * np.arange(-3, 4)[:, None] * whole
    within = (options >= robot.q_lower - REACHED) & (options <= robot.q_upper + REACHED)
    nothing = np.full(len(solution), np.nan)
    if not within.any(axis=0).all():
        j = int(np.argmin(within.any(axis=0)))
        low, up = robot.q_lower[j] / DEG, robot.joint_text(j, robot.q_upper[j], "g")
        stands = robot.joint_text(j, solution[j], ".2f")
        return nothing, f"joint {j + 1} would stand at {stands}; {low:g} … {up} are allowed"
    if pose.configuration is not None:
        allowed, distance = within & pose.configuration.turns(options), np.abs(options)
    else:
        assert follows is not None
        allowed, distance = within, np.abs(options - q[follows])
    if not allowed.any(axis=0).all():
        j = int(np.argmin(allowed.any(axis=0)))
        angles = " or ".join(f"{robot.joint_text(j, v, '.2f')}" for v in options[within[:, j], j])
        return nothing, f"joint {j + 1} would stand at {angles}, which is not in the turn that is said"
    best = np.where(allowed, distance, np.inf).argmin(axis=0)
    return np.asarray(options[best, np.arange(robot.n_joints)]), ""


@lru_cache(maxsize=4)
def _unit_points(dimension: int) -> Array:
    return sobol_points(dimension, None)(1 << 15)  # 32 768 arm positions are kept to start from


def turn_notes(nominal: Robot, targets: Sequence[Target], q: Array) -> list[Note]:
    """Say of poses how far an arm with fewer than six axes is from the turn that they ask for, uncorrected already."""
    at = [k for k, t in enumerate(targets) if t.pose is not None]
    if nominal.n_joints >= FULL_AXES or not at:
        return []
    poses = [p for t in targets if (p := t.pose) is not None]
    T = flange_of(poses)
    off = ToolDeviation.at(
        ToolGoal(np.array([p.T_FT for p in poses]), *_tool_of(T, poses)), NominalFlange(nominal), q[at]
    )
    return [
        (
            targets[k].line,
            f"an arm of {nominal.n_joints} axes cannot turn its tool as this pose asks: its axis stays "
            f"{off.tilt[i] / DEG:.2f}° off, and its turn about the axis {off.spin[i] / DEG:.2f}°; the place is met",
        )
        for i, k in enumerate(at)
        if max(off.tilt[i], off.spin[i]) > MISSED_TURN
    ]


def _tool_of(T_BF: Array, poses: Sequence[CartesianTarget]) -> tuple[Array, Array]:
    """Return tool points (n, 3) [m] and turns (n, 3, 3) in the base frame, of flanges (n, 4, 4) that have tools."""
    T = T_BF @ np.array([p.T_FT for p in poses])
    return T[:, :3, 3], T[:, :3, :3]


def target_problems(lines: list[int], nominal: Robot, c: Correction) -> list[Note]:
    """Say of every target that cannot be used why."""
    problems = []
    for k in np.flatnonzero(~c.usable):
        where = ": the target is near a singular position" if c.singular[k] else ""
        if not c.within[k] and c.solved[k]:
            j = int(np.argmax(np.maximum(nominal.q_lower - c.q[k], c.q[k] - nominal.q_upper)))
            low, up = nominal.q_lower[j] / DEG, nominal.joint_text(j, nominal.q_upper[j], "g")
            why = f"joint {j + 1} would have to stand at {nominal.joint_text(j, c.q[k, j])}; {low:g} … {up} are allowed"
        elif c.solved[k]:
            j = int(np.abs(c.moved[k]).argmax())
            why = (
                f"joint {j + 1} would have to move by {nominal.joint_text(j, c.moved[k, j], '.1f')}, further than "
                f"{nominal.joint_text(j, move_limit(nominal), 'g')}{where or ', which is more than a correction'}"
            )
        else:
            ends = "the arm is at a singular position or at the end of its reach"
            beyond = "the calibrated robot does not reach it within its limits"
            why = (
                f"{c.after.distance[k] * 1e6:.1f} µm and {c.residual_rad[k] * 1e6:.1f} µrad are left: "
                f"{ends if c.singular[k] else beyond}"
            )
        problems.append((lines[k], why))
    return problems


def problems_summary(path: Path, problems: Sequence[Note], targets: Sequence[Target]) -> str:
    """Return the sentence above the list of targets that cannot be corrected, and what would help."""
    help_ = (
        "; move them away from limits and singular positions (a wrist that is straight)"
        if any("singular" in why or "allowed" in why for _, why in problems)
        else ""
    )
    return f"{path.name}: {len(problems)} of {len(targets)} targets have no fake target near the nominal one{help_}"
