"""The regions of joint space that hold a driven motion: its legs, its cut corners, and its many small steps."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from planner.common.units import Array
from planner.motion.timing.curve import ToolPosition, corner_ends
from planner.session.driven_motion import Chain
from planner.session.tolerances import ENCLOSED, SMALL_STEP

GROUP = 64  # small steps that are looked at together first


@dataclass(frozen=True)
class Hulls:
    """Regions that hold parts of a motion: hulls of corners (m, K, N) [rad], and of which moves (m,) they are what.

    K is 2, 3 or 4, as for :class:`~planner.motion.path.proof.Neighbourhoods`.
    """

    corners: Array
    number: np.ndarray
    kind: str

    def names(self) -> list[str]:
        """Name every region."""
        return [f"{self.kind} {k}" for k in self.number.tolist()]


Proven = Callable[[Array], np.ndarray]
"""Tells which hulls of corners (m, K, N) [rad] keep every constraint, (m,) bool."""


def motion_hulls(chain: Chain, tool_position: ToolPosition, proven: Proven) -> Iterator[Hulls]:
    """Yield what holds a chain: straight legs, the triangles of cut corners, and the like about small steps.

    ``proven``: a quick look at whether a large region about small steps will do.
    """
    way = f"on the path to start {chain.way}, " if chain.way else ""
    moved = np.abs(np.diff(chain.q, axis=0)).max(axis=1) > 0.0
    kept = np.concatenate([[True], moved])
    q, number = chain.q[kept], chain.number[moved]
    last = np.concatenate([np.flatnonzero(kept)[1:] - 1, [len(kept) - 1]])
    blend, rounded = np.minimum.reduceat(chain.blend, np.flatnonzero(kept)), chain.rounded[last]
    if len(q) < 2:
        yield Hulls(np.stack([chain.q[:1], chain.q[:1]], axis=1), chain.number[:1], f"{way}move")
        return
    small = np.abs(np.diff(q, axis=0)).max(axis=1) < SMALL_STEP
    rounded[1:-1] |= (blend[1:-1] > 0.0) & small[:-1] & small[1:]
    rounded[[0, -1]] = False
    begin = np.flatnonzero(np.diff(np.concatenate([[0], rounded.view(np.int8), [0]])) == 1)
    end = np.flatnonzero(np.diff(np.concatenate([[0], rounded.view(np.int8), [0]])) == -1)
    legs = ~(rounded[:-1] | rounded[1:])
    yield Hulls(np.stack([q[:-1], q[1:]], axis=1)[legs], number[legs], f"{way}move")
    corner = np.flatnonzero((blend > 0.0) & ~rounded)
    corner = corner[(corner > 0) & (corner < len(q) - 1)]
    entry, leave = corner_ends(q, corner, blend[corner], tool_position)
    yield Hulls(np.stack([entry, q[corner], leave], axis=1), number[corner - 1], f"{way}corner after move")
    for a, b in zip(begin - 1, end, strict=True):  # the points of the run and one beside it on either side
        (segments, first), (triangles, begun) = enclose_steps(q[a : b + 1], number[a:b], proven)
        narrow = _are_narrow(triangles)
        yield Hulls(segments, first, f"{way}move")
        yield Hulls(triangles[~narrow], begun[~narrow], f"{way}move")
        yield Hulls(_quadrilaterals(triangles[narrow]), np.tile(begun[narrow], 2), f"{way}move")


def enclose_steps(q: Array, number: np.ndarray, proven: Proven) -> list[tuple[Array, np.ndarray]]:
    """Return hulls that enclose the steps between points q (n, N) and the corners between these steps.

    Steps on a straight line share a segment: that is what was proven of the leg that they are cut from. (A triangle
    without a width takes far more cells to prove: beside a limit more than ``CROWD``.) Steps on a plane curve share a
    triangle, which ends at the tangents, where it is proven; others have smaller ones, at last one for each corner.

    Args:
        q: the points (n, N) [rad].
        number: (n − 1,) of each step.
        proven: a quick look at whether a region about several steps will do.

    Returns:
        Segments (m, 2, N) [rad] and triangles (k, 3, N) [rad], beside each of both the number of its first step.
    """
    found: tuple[list[Array], list[Array]] = ([], [])
    numbers: tuple[list[np.ndarray], list[np.ndarray]] = ([], [])
    starts, size = np.arange(0, max(len(q) - 2, 1), GROUP), GROUP
    while len(starts):
        rows = np.minimum(starts[:, None] + np.arange(size + 2), len(q) - 1)
        apex, holds = _apexes(q[rows]) if size > 1 else (q[rows[:, 1]], np.ones(len(rows), dtype=bool))
        triangles = np.stack([q[rows[:, 0]], apex, q[rows[:, -1]]], axis=1)
        straight, settled = _run_straight(q[rows]), np.zeros(len(rows), dtype=bool)
        for k, (kind, hulls) in enumerate(((straight, triangles[:, ::2]), (holds & ~straight, triangles))):
            good = kind.copy()
            if size > 1:
                good[kind] = proven(hulls[kind])
            found[k].append(hulls[good])
            numbers[k].append(number[np.minimum(starts[good], len(number) - 1)])
            settled |= good
        left, size = starts[~settled], size // 2
        starts = (left[:, None] + np.array([0, size])).ravel() if size else left[:0]
        starts = starts[starts < len(q) - 2]
    return [(np.concatenate(f), np.concatenate(n)) for f, n in zip(found, numbers, strict=True)]


def _are_narrow(triangles: Array) -> np.ndarray:
    """Tell which triangles (m, 3, N) [rad] are less high than 0.05 of their length, (m,) bool."""
    height = np.linalg.norm(triangles[:, 1] - _foot(triangles), axis=1)
    # 0.05: of its length: such a triangle is proven as quadrilaterals, in fewer cells
    return np.asarray(height < 0.05 * np.linalg.norm(triangles[:, 2] - triangles[:, 0], axis=1))


def _quadrilaterals(triangles: Array) -> Array:
    """Cut triangles (m, 3, N) [rad] at their heights, (2 m, 4, N): with a corner twice, they are proven like a leg."""
    a, apex, c = (triangles[:, k] for k in range(3))
    foot = _foot(triangles)
    return np.concatenate([np.stack([a, foot, apex, a], axis=1), np.stack([foot, c, c, apex], axis=1)])


def _foot(triangles: Array) -> Array:
    """Return the place of the side between the ends that is nearest to the corner between them, (m, N) [rad]."""
    a, apex, c = (triangles[:, k] for k in range(3))
    side = c - a
    share = ((apex - a) * side).sum(axis=1) / np.maximum((side**2).sum(axis=1), 1e-300)
    return np.asarray(a + np.clip(share, 0.0, 1.0)[:, None] * side)


def _run_straight(points: Array) -> np.ndarray:
    """Tell which runs of points (g, k, N) lie between their ends to within ``ENCLOSED``, (g,) bool."""
    return np.asarray((_off_side(points, points[:, :1], points[:, -1:]) <= ENCLOSED).all(axis=1))


def _apexes(points: Array) -> tuple[Array, np.ndarray]:
    """Return where the first and last steps of runs of points (g, k, N) meet, (g, N), and which triangles hold all."""
    steps = np.diff(points, axis=1)
    length = np.linalg.norm(steps, axis=2)
    out = steps[:, 0] / np.maximum(length[:, :1], 1e-300)
    final = (
        points.shape[1] - 2 - np.argmax(length[:, ::-1] > 0.0, axis=1)
    )  # beyond the path's end its last point repeats
    rows = np.arange(len(points))
    back = -steps[rows, final] / np.maximum(length[rows, final, None], 1e-300)
    chord = points[:, -1] - points[:, 0]
    cosine = np.einsum("gi,gi->g", out, back)
    sine2 = np.maximum(1.0 - cosine**2, 0.0)
    along, against = np.einsum("gi,gi->g", out, chord), np.einsum("gi,gi->g", back, chord)
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = (along - cosine * against) / sine2
    # 1e-9: of the sine between the first and the last step of a group that runs straight
    bent = (sine2 > 1e-9**2) & np.isfinite(reach) & (reach > 0.0) & (reach < np.linalg.norm(chord, axis=1))
    apex = np.where(
        bent[:, None], points[:, 0] + np.where(bent, reach, 0.0)[:, None] * out, (points[:, 0] + points[:, -1]) / 2
    )
    return apex, _hold(np.stack([points[:, 0], apex, points[:, -1]], axis=1), points)


def _hold(triangle: Array, points: Array) -> np.ndarray:
    """Tell which triangles (g, 3, N) hold all of their points (g, k, N) to within ``ENCLOSED``, (g,) bool.

    A point's nearest place on the triangle is sought on its plane, and on its three sides.
    """
    a, b, c = (triangle[:, None, k] for k in range(3))
    off = np.minimum(_off_side(points, a, c), np.minimum(_off_side(points, a, b), _off_side(points, b, c)))
    u, v, w = b - a, c - a, points - a
    uu, uv, vv = ((x * y).sum(axis=2) for x, y in ((u, u), (u, v), (v, v)))
    wu, wv = (w * u).sum(axis=2), (w * v).sum(axis=2)
    area = uu * vv - uv**2
    with np.errstate(all="ignore"):  # a flat triangle has no inside
        s, t = (vv * wu - uv * wv) / area, (uu * wv - uv * wu) / area
        total = s + t
    inside = (area > 0.0) & (s >= 0.0) & (t >= 0.0) & (total <= 1.0)
    s, t = np.where(inside, s, 0.0), np.where(inside, t, 0.0)
    beyond = np.linalg.norm(w - s[..., None] * u - t[..., None] * v, axis=2)
    off = np.where(inside, np.minimum(off, beyond), off)
    return np.asarray((off <= ENCLOSED).all(axis=1))


def _off_side(points: Array, a: Array, b: Array) -> Array:
    """Distance of points (g, k, N) from the straight lines between a and b (g, 1, N), (g, k)."""
    side = b - a
    length2 = np.maximum((side**2).sum(axis=2), 1e-300)
    share = np.clip(((points - a) * side).sum(axis=2) / length2, 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - a - share[..., None] * side, axis=2))
