"""Where the bar is attached: the cell's own mount poses, or good ones found before anything else is drawn."""

from dataclasses import replace

import numpy as np

from planner.candidates import PoseSet, draw_candidates
from planner.cell import Cell
from planner.choice import what_is_seen
from planner.errors import InputError
from planner.path import Constraints, parts
from planner.plan import settled
from planner.selection import bound, core
from planner.units import Array
from planner.workspace import Workspace

POSES, ROUGH = 35, 5e-3  # number of poses and tolerance of the bound whose prices single out likely candidates
CERTAIN = 2000  # likely candidates that are joined to the roadmap themselves
TRIED = 2000  # poses among which a mount pose is looked for
ROOMY = 0.25  # share of them with the most room, from which the quickest to reach is taken


def check_home(cell: Cell, without_bar: Constraints) -> None:
    """Refuse a home where the robot itself collides.

    Raises:
        InputError: naming the two bodies or the limit.
    """
    reason = without_bar.reason(cell.home)
    if reason is not None:
        raise InputError(f"{cell.path}: home_deg cannot be the start pose: {reason}")


def with_mounts(cell: Cell, seed: int) -> Cell:
    """Return the cell with a mount pose for every fixture: its own, checked, or one that is found.

    The twist of a cable along the bar is counted from there, so it is settled before the candidates are drawn.

    Raises:
        InputError: home or a mount pose of the cell breaks a constraint.
        NoSolutionError: no pose at all holds the bar.
    """
    check_home(cell, Constraints(cell, bar=False))
    fixtures = []
    for k, fixture in enumerate(cell.fixtures):
        mount = settled(_found(cell, k, seed)) if fixture.mount is None else fixture.mount
        fixtures.append(replace(fixture, mount=mount))
    cell = replace(cell, fixtures=tuple(fixtures))
    for k, fixture in enumerate(cell.fixtures):
        reason = Constraints(cell, k).reason(np.asarray(fixture.mount))
        if reason is not None:
            raise InputError(f"{cell.path}: mount_deg of fixture {cell.place_name(k)} cannot hold the bar: {reason}")
    return cell


def reachable(cell: Cell, pool: PoseSet, index: str, poses: int | None, seed: int) -> tuple[PoseSet, tuple[str, ...]]:
    """Keep the candidates that a path joins to the mount pose; a note says how many others there were.

    Where the cable or an obstacle splits the shell in parts, a tour must keep to one of them. All candidates are judged
    by their neighbours in a roadmap; those whose price in the bound singles them out are in it themselves.
    """
    kept = _joined(cell, pool, np.arange(0), seed)
    likely = pool.take(kept)
    _, _, rows = what_is_seen(cell, likely)
    n = min(poses or POSES, len(rows))
    order, _ = core(rows, bound(rows, index, n, tolerance=ROUGH, seed=seed), n)
    kept = _joined(cell, likely, np.sort(order[:CERTAIN]), seed)
    lost = len(pool) - int(kept.sum())
    note = f"{lost} of {len(pool)} candidates lie in parts of the shell that no path joins to the mount pose; left out"
    return likely.take(kept), (note,) if lost else ()


def _joined(cell: Cell, pool: PoseSet, certain: np.ndarray, seed: int) -> np.ndarray:
    """Tell which candidates lie in their mount pose's part; those in ``certain`` by roadmap edges of their own."""
    kept = np.zeros(len(pool), dtype=bool)
    for k, fixture in enumerate(cell.fixtures):
        mine = np.flatnonzero(pool.fixture == k)
        first = certain[pool.fixture[certain] == k]
        rows = np.concatenate([first, np.setdiff1d(mine, first)])
        part = parts(Constraints(cell, k), np.vstack([np.array(fixture.mount), pool.q[rows]]), seed, 1 + len(first))
        kept[rows] = part[1:] == part[0]
    return kept


def _found(cell: Cell, fixture: int, seed: int) -> Array:
    """Of the poses in the largest part of the shell with the most room to every limit, the quickest to reach."""
    one = replace(cell.unwound, fixtures=(cell.fixtures[fixture],), plan=replace(cell.plan, grid_step=None))
    q = draw_candidates(one, TRIED, seed).q
    q = q[parts(Constraints(one), q, seed) == 0]
    workspace = Workspace(one)
    margins = workspace.margins(q)
    room = (margins / np.median(margins, axis=0)).min(axis=1)
    roomy = q[np.argsort(-room, kind="stable")[: max(1, int(ROOMY * len(q)))]]
    seconds = (np.abs(roomy - cell.home) / cell.robot.speed).max(axis=1)
    return np.asarray(roomy[int(np.argmin(seconds))])
