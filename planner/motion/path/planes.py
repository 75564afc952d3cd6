"""Planes that keep convex bodies apart over whole neighbourhoods of states.

Let n be the unit way from body a to body b, and let it turn with a. Seen from a, a point p of b moves by v + w × p
and a term of second order, (w, v) the screw of b relative to a. So the gap along n stays at least

    min over the spokes of  n·v − h_b(−n − n × w)  − h_a(n) − bend / 2

with the support functions h and a bound ``bend`` of the second derivative: linear in the screw, so concave, and least
at a corner. Bounds of distances alone let every point of b come straight at a, by the longest way that any point has.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.cell.workspace import axis_reach
from planner.common.units import Array
from planner.motion.collision.scene import Scene, outline
from planner.motion.path.margins import ToolState, Travel, WorkspaceBounds, core_reach, curvature

FEW = 64  # neighbourhoods of a pair: for fewer the next halves are looked at as quickly
BLOCK = 256  # directions at a time: they stay in the cache
HOUSING, ROD, WORLD = -3, -2, -1  # carriers behind the links


@dataclass(frozen=True)
class CarrierMotion:
    """Frames and screws of all carriers (the links, then housing, rod and world) over n neighbourhoods.

    Attributes:
        R, x: frames at the centres, (carriers, 3, 3, n) and (carriers, 3, n) [m]; of the bar only its axis, z.
        w, v: screws about the base's origin for each spoke, both ways where there is one, (carriers, n, S, 3).
        pose, far: tool and bar, and how far they travel.
        rate, bend: largest speed of the MAP, and its change, (n,) [m].
    """

    R: Array
    x: Array
    w: Array
    v: Array
    pose: ToolState
    far: Travel
    rate: Array
    bend: Array


@dataclass(frozen=True)
class PlaneBounds:
    """Bounds for the checked pairs of convex bodies of a scene.

    Attributes:
        scene: bodies and pairs.
        bounds: of tool and bar.
    """

    scene: Scene
    bounds: WorkspaceBounds

    def gaps(self, q: Array, spokes: Array, rows: np.ndarray, columns: np.ndarray, normal: Array) -> Array:
        """Return what each pair keeps between its bodies in the whole neighbourhood at least, (m,) [m], or −inf.

        Args:
            q, spokes: of n neighbourhoods, (n, N) and (n, M, N) [rad].
            rows, columns: which neighbourhood and which pair, (m,).
            normal: way from the first body of the pair to the second at the centre, (m, 3); whichever it is, the gap
                along it is found from the bodies; the shortest way shows most.
        """
        out, often = np.full(len(rows), -np.inf), np.bincount(columns, minlength=len(self.scene.pairs)) >= FEW
        normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
        some = np.unique(rows[often[columns] & self._convex[columns]])
        if not len(some):
            return out
        motion, place = self._move(q[some], spokes[some]), np.searchsorted(some, rows)
        for pair in np.flatnonzero(often & self._convex):
            mine = np.flatnonzero(columns == pair)
            a, b = self.scene.pairs[pair]
            views = self._views(motion, place[mine], a, b)
            seen = [self._gap(motion, place[mine], *view, normal[mine] * (1 if view[0] == a else -1)) for view in views]
            out[mine] = np.max(seen, axis=0)
        return out

    def _gap(self, motion: CarrierMotion, rows: np.ndarray, a: int, b: int, bend: Array, n: Array) -> Array:
        """The gap along n (m, 3) from body a to body b, seen from a."""
        near, far = self._carrier[a], self._carrier[b]
        w, v = (screw[far, rows] - screw[near, rows] for screw in (motion.w, motion.v))  # (m, S, 3)
        tilted = -n[:, None] - np.cross(n[:, None], w)
        reach = [self._support(motion, rows, b, tilted[:, k]) for k in range(w.shape[1])]
        along = np.einsum("mi,mki->mk", n, v) - np.stack(reach, axis=1)
        return np.asarray(along.min(axis=1) - self._support(motion, rows, a, n) - self._radius[[a, b]].sum() - bend / 2)

    def _support(self, motion: CarrierMotion, rows: np.ndarray, k: int, along: Array) -> Array:
        """How far the core of body k reaches along the vectors (m, 3), (m,) [m]."""
        carrier = self._carrier[k]
        local = np.einsum("mi,ijm->mj", along, motion.R[carrier][:, :, rows])
        points = self._points[k].T
        reach = [(local[s : s + BLOCK] @ points).max(axis=1) for s in range(0, len(rows), BLOCK)]
        return np.asarray(np.concatenate(reach) + np.einsum("mi,im->m", along, motion.x[carrier][:, rows]))

    def _views(self, motion: CarrierMotion, rows: np.ndarray, a: int, b: int) -> Iterator[tuple[int, int, Array]]:
        """The bodies in the order in which one sees the other, with the second derivative of what it sees, (m,) [m]."""
        pieces, step = self.scene.pieces, motion.far.step[rows]
        if pieces[a].of_bar or pieces[b].of_bar:
            bar, other = (a, b) if pieces[a].of_bar else (b, a)
            yield bar, other, self._bend_from_bar(motion, rows, bar, other)
            return
        near, far = (a, b) if self._carrier[a] <= self._carrier[b] else (b, a)
        outward, inward = self._reaches[near, far]
        step = step * ((outward > 0.0) | (inward > 0.0))
        yield near, far, curvature(step, outward)
        if pieces[near].carrier != "world":
            yield far, near, curvature(step[:, ::-1], inward[::-1])  # the last joint is the first that it sees

    def _bend_from_bar(self, motion: CarrierMotion, rows: np.ndarray, bar: int, other: int) -> Array:
        """Second derivative of a point r from the bar's ball, seen from the bar: r'' − ω'×r − 2 ω×r' + ω×(ω×r)."""
        link, housing = self._carrier[other], self.scene.pieces[bar].carrier == "housing"
        left = np.maximum(motion.pose.length - motion.far.move, 1e-9)[rows]
        turn = motion.rate[rows] / left
        turning = turn**2 + motion.bend[rows] / left
        centre, radius = self._balls[other]
        c = np.einsum("ijm,j->mi", motion.R[link][:, :, rows], centre) + motion.x[link][:, rows].T
        ball = motion.x[HOUSING if housing else ROD][:, rows].T
        w, v = motion.w[link, rows], motion.v[link, rows]
        own = np.zeros_like(v) if housing else self._point_speed(motion, rows, ROD, ball)
        speed = np.linalg.norm(v + np.cross(w, c[:, None]) - own, axis=2) + radius * np.linalg.norm(w, axis=2)
        reach = self._link_reaches.get(other)
        bend = (0.0 if reach is None else curvature(motion.far.step[rows], reach)) + (not housing) * motion.bend[rows]
        speed = speed.max(axis=1) + bend
        away = np.linalg.norm(c - ball, axis=1) + radius + speed
        whole = bend + (turning + turn**2) * away + 2 * turn * speed
        return np.where(motion.pose.length[rows] > motion.far.move[rows], whole, np.inf)

    def _point_speed(self, motion: CarrierMotion, rows: np.ndarray, carrier: int, p: Array) -> Array:
        """Velocities (m, S, 3) of points (m, 3) [m] that a carrier holds."""
        return np.asarray(motion.v[carrier, rows] + np.cross(motion.w[carrier, rows], p[:, None]))

    def _move(self, q: Array, spokes: Array) -> CarrierMotion:
        robot, n = self.scene.cell.robot, len(q)
        pose, far = self.bounds.travel(q, spokes)
        spokes = spokes @ robot.sense_matrix.T
        spokes = np.concatenate([spokes, -spokes], axis=1) if spokes.shape[1] == 1 else spokes
        axes = np.moveaxis(pose.W, 2, 0)  # (N, n, 3)
        moments = np.moveaxis(pose.J, 2, 0) - np.cross(axes, pose.x)
        share = np.moveaxis(spokes, 2, 0)[..., None]  # (N, n, S, 1)
        turns, shifts = (np.cumsum(share * screw[:, :, None], axis=0) for screw in (axes, moments))
        still = np.zeros((1, *turns.shape[1:]))
        tip = np.einsum("nij,nsj->nsi", pose.J, spokes)
        swing = np.cross(pose.direction[:, None], tip) / np.maximum(pose.length, 1e-9)[:, None, None]
        p_BX = np.broadcast_to(self.scene.p_BX, (n, 3))
        bar_v = [np.cross(p_BX[:, None], swing), tip + np.cross(pose.x[:, None], swing)]
        axis = np.zeros((3, 3, n))
        axis[:, 2] = pose.direction.T
        links = robot.chain.frames(robot.theta(q), robot.link_end)
        R = [*(np.broadcast_to(R, (3, 3, n)) for R, _ in links), axis, axis, np.tile(np.eye(3)[:, :, None], n)]
        x = [*(np.broadcast_to(x, (3, n)) for _, x in links), p_BX.T, pose.x.T, np.zeros((3, n))]
        bend = curvature(far.step, self.bounds.map_reach)
        rate = np.linalg.norm(tip, axis=2).max(axis=1) + bend
        w, v = np.concatenate([still, turns, [swing, swing], still]), np.concatenate([still, shifts, bar_v, still])
        return CarrierMotion(np.stack(R), np.stack(x), w, v, pose, far, rate, bend)

    @cached_property
    def _carrier(self) -> list[int]:
        """Which carrier holds each piece."""
        other = {"housing": HOUSING, "rod": ROD, "world": WORLD}
        return [other.get(p.carrier, p.link) for p in self.scene.pieces]

    @cached_property
    def _points(self) -> list[Array]:
        """Points whose hull each piece's core is, in the frame of its carrier, (k, 3) [m]."""
        return [outline(p.body) @ p.body.T[:3, :3].T + p.body.T[:3, 3] for p in self.scene.pieces]

    @cached_property
    def _radius(self) -> Array:
        """Of what is round about the cores, (pieces,) [m]."""
        return np.array([p.reach - core_reach(p) for p in self.scene.pieces])

    @cached_property
    def _balls(self) -> list[tuple[Array, float]]:
        """Centre (3,) and radius [m] of a ball about each core, in the frame of its carrier."""
        centres = [(p.min(axis=0) + p.max(axis=0)) / 2 for p in self._points]
        return [(c, float(np.linalg.norm(p - c, axis=1).max())) for c, p in zip(centres, self._points, strict=True)]

    @cached_property
    def _convex(self) -> np.ndarray:
        """Which pairs hold convex bodies alone, (pairs,) bool."""
        convex = np.array([p.body.kind != "mesh" or p.body.hull for p in self.scene.pieces], dtype=bool)
        return np.asarray(convex[np.array(self.scene.pairs, dtype=int).reshape(-1, 2)].all(axis=1))

    @cached_property
    def _reaches(self) -> dict[tuple[int, int], tuple[Array, Array]]:
        """Largest distance of the farther and of the nearer body from the axes between the two, (N,) [m] each."""
        robot, out = self.scene.cell.robot, dict[tuple[int, int], tuple[Array, Array]]()
        for a, b in self.scene.pairs:
            if self.scene.pieces[a].of_bar or self.scene.pieces[b].of_bar:
                continue
            near, far = (a, b) if self._carrier[a] <= self._carrier[b] else (b, a)
            start, end = (robot.link_end[self._carrier[k]] if self._carrier[k] >= 0 else 0 for k in (near, far))
            between, last = robot.transforms[start:end], [core_reach(self.scene.pieces[k]) for k in (far, near)]
            out[near, far] = (
                axis_reach(between, robot.n_joints, last[0]),
                axis_reach(between[::-1], robot.n_joints, last[1]),
            )
        return out

    @cached_property
    def _link_reaches(self) -> dict[int, Array]:
        """Largest distance of each link's piece from the axes before it, (N,) [m]."""
        robot, held = self.scene.cell.robot, [k for k, p in enumerate(self.scene.pieces) if p.carrier == "link"]
        before = {k: robot.transforms[: robot.link_end[self._carrier[k]]] for k in held}
        return {k: axis_reach(t, robot.n_joints, core_reach(self.scene.pieces[k])) for k, t in before.items()}
