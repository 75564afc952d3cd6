"""Whether a plan in a file is the one that was proven: by its hash and its folder's manifest, else by a new proof."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from planner.cell.cell import Cell
from planner.common.errors import InputError
from planner.common.files import data_folder
from planner.common.result_folder import changed_files
from planner.common.schema import read_json
from planner.motion.path.constraints import Constraints
from planner.motion.path.verdict import SeparateMotions, Verdict
from planner.session.course import Course, TimedPath
from planner.session.plan_record import content_hash
from planner.session.release import judge_corners

NOT_HASHED = ("schema", "kind", "plan_id", "programs", "notes")
PLAN, CELL = "plan.json", "cell.toml"
NEEDED = (".json", ".toml", ".urdf", ".stl", ".obj", ".dae", ".ply")  # of a plan's files what a program is made of


def check_trust(path: Path, cell: Cell, courses: Sequence[Course]) -> tuple[str, ...]:
    """Accept a plan that is as it was written; prove every motion of any other anew, with both engines.

    Args:
        path: of ``plan.json``.
        cell: the one beside it.
        courses: what would be driven.

    Returns:
        What a person must know of a plan that was changed and holds all the same.

    Raises:
        InputError: it was changed, and its path is not proven.
    """
    because = _why_not(path, cell)
    if because is None:
        return ()
    balls = _balls_of_visits(path, cell)
    for course in courses:
        for failure in _failures(cell, course, balls):
            raise InputError(
                f"{path}: is not as it was planned ({because}), and its path is not proven anew: {failure}; plan again"
            )
    return (f"{path} is not as it was planned: {because}; its path was proven anew by both engines",)


def doubts(path: Path, cell: Cell) -> tuple[str, ...]:
    """Say why a plan is not known to be as it was written; no robot moves by it, so its path is not proven anew."""
    because = _why_not(path, cell)
    return () if because is None else (f"{path} is not as it was planned ({because})",)


def _why_not(path: Path, cell: Cell) -> str | None:
    """Say why a plan is not known to be as it was written; nothing where it is."""
    content = read_json(path)
    assert isinstance(content, dict)
    said = {k: v for k, v in content.items() if k not in NOT_HASHED}
    if content_hash(said, cell) != content.get("plan_id"):
        return "plan.json or cell.toml was changed, or another version wrote it"
    changed = changed_files(path.parent, path.name)
    needed = [f for f in changed or () if Path(f).suffix.lower() in NEEDED]
    if needed:
        return f"{needed[0]} was changed"
    shipped = cell.robot.path.is_relative_to(data_folder("robots")) and not any(b.mesh for b in cell.obstacles)
    return None if shipped or changed is not None else "no manifest.json tells whether robot and meshes are the same"


def _failures(cell: Cell, course: Course, balls: Mapping[int, int]) -> list[str]:
    """Say what either engine does not prove of a course, and what the cell does not allow."""
    here = cell.with_mount(course.mounting, course.passes[0].path.q[0])
    found: list[Verdict] = []
    for path, bar in [(course.travel, False), *((p.path, True) for p in course.passes)]:
        constraints = Constraints(here, course.mounting, bar=bar)
        one_way = _one_way(path)
        separate = _ball_motions(constraints, path, one_way, balls) if bar else []
        found += judge_corners(constraints, path.q[:one_way], path.trajectory, separate)[0]
    return [f"{v.engine}: {f}" for v in found for f in v.failures[:1]]


def _one_way(path: TimedPath) -> int:
    """Return how many of the points lead there, where the path is driven there and back."""
    count = (len(path.q) + 1) // 2
    return count if np.array_equal(path.q, path.q[::-1]) else len(path.q)


def _ball_motions(
    constraints: Constraints, path: TimedPath, count: int, balls: Mapping[int, int]
) -> list[SeparateMotions]:
    """Motions to and from balls keep the constraints that hold there."""
    at = np.array([balls.get(int(v), -1) for v in path.visit[:count]])
    of_motion = np.maximum(at[:-1], at[1:])
    return [
        SeparateMotions(constraints.at_ball(int(b)), np.flatnonzero(of_motion == b))
        for b in np.unique(of_motion[of_motion >= 0])
    ]


def _balls_of_visits(path: Path, cell: Cell) -> dict[int, int]:
    content, names = read_json(path), [b.name for b in cell.balls]
    poses = content.get("poses", []) if isinstance(content, dict) else []
    return {int(p["id"]): names.index(str(p["ball"])) for p in poses if str(p.get("ball")) in names}
