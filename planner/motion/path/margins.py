"""Margins of limits, bar length, cones, cable and body distances, and how much of each a neighbourhood can use up."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.cell.gauge_types import PointTravel
from planner.cell.workspace import Workspace, axis_reach, bar_twist, chain_reach, unit_across, wrap_angle
from planner.common.units import Array
from planner.kinematics.chain import Chain
from planner.kinematics.geometry import bar_state
from planner.motion.collision.scene import Scene, SceneBody


@dataclass(frozen=True)
class ToolState:
    """Tool and bar at n states, in the base frame.

    Attributes:
        x: measurement application point, (n, 3) [m].
        J: its velocity per joint angle of the kinematic rows, (n, 3, N) [m].
        W: angular velocity of the tool per joint angle, (n, 3, N).
        length: of the bar, (n,) [m].
        direction: of the bar from fixture to MAP, (n, 3).
        axis: of the MAP's ball joint, (n, 3).
        spin: turn of the tool about the bar from its zero, (n,) [rad].
    """

    x: Array
    J: Array
    W: Array
    length: Array
    direction: Array
    axis: Array
    spin: Array


FAR = np.inf


@dataclass(frozen=True)
class Travel(PointTravel):
    """Bounds over n neighbourhoods.

    Attributes:
        step: largest |Δθ| of each joint, (n, N) [rad].
        seen: path length of the MAP as each of the links 1 … N sees it, (n, N) [m]; turned: turn of the link, (n, N)
            [rad].
    """

    step: Array
    seen: Array
    turned: Array


def bound_travel(pose: ToolState, spokes: Array, reach: Array) -> Travel:
    """Bound the travel of tool and bar over neighbourhoods.

    Args:
        pose: tool and bar at the n centres.
        spokes: Δθ of each spoke, (n, M, N) [rad].
        reach: largest distance of the MAP from each axis, (N,) [m].
    """
    step = np.abs(spokes).max(axis=1)
    # what the joints from the tool inward, and from the base outward, do together
    velocity = np.cumsum((pose.J[:, None] * spokes[:, :, None])[..., ::-1], axis=3)[..., ::-1]
    turning = np.cumsum(pose.W[:, None] * spokes[:, :, None], axis=3)
    bend, speed = curvature(step, reach), _longest_length(velocity)
    seen = speed + bend / 2
    bend, speed, move = bend[:, 0], speed[:, 0], seen[:, 0]
    along = np.abs(np.einsum("nmi,ni->nm", velocity[..., 0], pose.direction)).max(axis=1)
    left = pose.length - move  # shortest length in the neighbourhood
    safe = np.maximum(left, 1e-9)
    stretch = np.minimum(move, along + ((speed + bend) ** 2 / safe + bend) / 2)
    swing = np.where(left > 0, move / safe, FAR)
    earlier = np.cumsum(step, axis=1) - step
    turned = _longest_length(turning) + np.cumsum(step * earlier, axis=1) / 2
    # link k is carried by the joints up to its own, and sees what those behind it do
    seen = np.column_stack([seen[:, 1:], np.zeros(len(step))])
    return Travel(move, stretch, swing, turned[:, -1], step, seen, turned)


def _longest_length(vectors: Array) -> Array:
    """Return the length of the longest of M vectors (n, M, 3, N), (n, N)."""
    return np.asarray(np.sqrt(np.einsum("nmij,nmij->nmj", vectors, vectors)).max(axis=1))


def curvature(step: Array, reach: Array) -> Array:
    """Return Σ_ij step_i step_j reach_max(i,j) over the joints i, j from each one on, (n, N) [m].

    Steps are (n, N) [rad], reaches (N,) [m].
    """
    later = np.cumsum((reach * step)[:, ::-1], axis=1)[:, ::-1] - reach * step
    return np.asarray(np.cumsum((step * (reach * step + 2 * later))[:, ::-1], axis=1)[:, ::-1])


@dataclass(frozen=True)
class WorkspaceBounds:
    """Forward pass of one workspace, with the margins' bounds."""

    workspace: Workspace

    def at(self, q: Array) -> ToolState:
        """Return tool and bar at controller angles q (n, N) [rad]."""
        cell, fixture = self.workspace.cell, self.workspace.fixture
        motion = self._chain.forward(cell.robot.theta(q))
        J = np.moveaxis(motion.point_screws(self._chain.joint_places), (0, 1, 2), (2, 1, 0))
        W = np.moveaxis(motion.turns(self._chain.joint_places), (0, 1, 2), (2, 1, 0))
        bar = bar_state(motion.x.T, fixture.p_BX)
        axis, spin = np.einsum("ijn,j->ni", motion.R, cell.tool.axis_F), np.zeros(len(q))
        if cell.cable.tool_about_bar is not None:
            mark = np.einsum("ijn,j->ni", motion.R, unit_across(cell.tool.axis_F))
            spin = wrap_angle(bar_twist(fixture.axis_B, bar.direction, axis, mark) - self.workspace.zero_spin)
        return ToolState(motion.x.T, J, W, bar.length, bar.direction, axis, spin)

    @cached_property
    def map_reach(self) -> Array:
        """Largest distance of the MAP from each joint's axis over all states, (N,) [m]."""
        return axis_reach(self._chain.transforms, self.workspace.cell.robot.n_joints)

    @cached_property
    def _chain(self) -> Chain:
        return self.workspace.cell.chain

    def travel(self, q: Array, spokes: Array) -> tuple[ToolState, Travel]:
        """Return tool, bar and their travel over neighbourhoods q (n, N), spokes (n, M, N) [rad, controller's]."""
        pose = self.at(q)
        return pose, bound_travel(pose, spokes @ self.workspace.cell.robot.coupling_matrix.T, self.map_reach)

    def margins(self, q: Array) -> Array:
        """Margins of the workspace at q (n, N) [rad], (n, columns) [rad or m]."""
        return self.workspace.margins(q, self.at(q) if self.workspace.bar else None)

    def look(self, q: Array, spokes: Array) -> tuple[Array, Array, Travel]:
        """Return margins at the centres, what they can lose, (n, columns) [rad or m] both, and the travel.

        Without the bar only the joints' steps count: of the point nothing is asked, and nothing bounded.
        """
        if self.workspace.bar:
            pose, far = self.travel(q, spokes)
            return self.workspace.margins(q, pose), self.changes(spokes, far), far
        unknown = np.full(len(q), FAR)
        step = np.abs(spokes @ self.workspace.cell.robot.coupling_matrix.T).max(axis=1)
        far = Travel(unknown, unknown, unknown, unknown, step, *np.full((2, *step.shape), FAR))
        return self.workspace.margins(q), self.changes(spokes, far), far

    def changes(self, spokes: Array, far: Travel) -> Array:
        """Bound by how much each margin can fall within the neighbourhoods, (n, columns) [rad or m]."""
        cell, step = self.workspace.cell, np.abs(spokes)
        limits = step.max(axis=1)
        sums = [step[:, :, axes].sum(axis=2).max(axis=1) for axes, _ in cell.cable.sums]
        if not self.workspace.bar:
            return np.column_stack([limits, *sums])
        spin = []
        if cell.cable.tool_about_bar is not None:
            # carried along the sphere at a tilt of c, a line turns at tan(c/2) times the rate of the direction
            at_fixture, at_map = np.tan(cell.gauge.cone_fixture / 2), np.tan(cell.gauge.cone_map / 2)
            spin = [far.turn + far.swing * at_fixture + (far.swing + far.turn) * at_map]
        return np.column_stack([limits, *cell.gauge.margin_changes(far), *sums, *spin])


@dataclass(frozen=True)
class BarPairs:
    """Pairs of bodies of which one is a part of the bar.

    Attributes:
        pair: position of each among the scene's pairs, (m,) int.
        housing: whether the part is the housing, else the rod, (m,) bool.
        end: reach of the part's core, (m,) [m].
        reach: largest distance of the other piece from each axis before it, (m, N) [m]; zero where it stands still.
        link: which carries the other piece, (m,), 0 where it stands still; to_map: its largest distance from the MAP
            then, (m,) [m].
    """

    pair: np.ndarray
    housing: np.ndarray
    end: Array
    reach: Array
    link: np.ndarray
    to_map: Array


@dataclass(frozen=True)
class PairBounds:
    """Bounds for the checked pairs of a scene."""

    scene: Scene

    def changes(self, far: Travel) -> Array:
        """Return the largest decrease of each pair's distance within the neighbourhoods, (n, pairs) [m]."""
        n, pairs = len(far.step), len(self.scene.pairs)
        rows, columns = np.divmod(np.arange(n * pairs), max(pairs, 1))
        return np.asarray(self.pair_changes(far, rows, columns).reshape(n, pairs))

    def pair_changes(self, far: Travel, rows: np.ndarray, columns: np.ndarray) -> Array:
        """Return what the distance of the pairs ``columns`` (m,) can lose in the neighbourhoods ``rows``, (m,) [m]."""
        out = np.einsum("mj,mj->m", far.step[rows], self._reach[columns])
        place = self._bar_place[columns]
        mine = np.flatnonzero(place >= 0)
        if len(mine):
            out[mine] = self._bar_changes(far.take(rows[mine]), place[mine])
        return np.asarray(out)

    def _bar_changes(self, far: Travel, place: np.ndarray) -> Array:
        """Return what the distance of pairs with the bar, those at ``place`` (m,), can lose, each in its own travel.

        The housing turns about the fixture. A point of the rod at ρ ≤ 2 L from the MAP is no faster than the MAP. What
        the tool carries turns with it about the MAP.

        Seen from a link, the rod is carried with the MAP, and turns about it as both do together. Seen from the rod it
        is the link that turns about the MAP: what is less far from the MAP decides.
        """
        bar = self._bar
        link, to_map, end, rows = bar.link[place], bar.to_map[place], bar.end[place], np.arange(len(place))
        own = np.where(bar.housing[place], end * far.swing, far.move)
        carried = np.einsum("mj,mj->m", far.step, bar.reach[place])
        at_tool = link == far.step.shape[1]
        carried = np.where(at_tool, np.minimum(carried, far.move + to_map * far.turn), carried)
        apart = own + carried
        turned = np.minimum(end, to_map) * (far.swing + far.turned[rows, link - 1])
        rod = (link > 0) & ~bar.housing[place]
        return np.asarray(np.where(rod, np.minimum(apart, far.seen[rows, link - 1] + turned), apart))

    @cached_property
    def _bar_place(self) -> np.ndarray:
        """Which of the pairs with the bar each pair is, (pairs,), −1 for others."""
        out = np.full(len(self.scene.pairs), -1)
        out[self._bar.pair] = np.arange(len(self._bar.pair))
        return out

    @cached_property
    def _bar(self) -> "BarPairs":
        """The pairs with a part of the bar."""
        pieces, robot = self.scene.pieces, self.scene.cell.robot
        found = [(k, *pair) for k, pair in enumerate(self.scene.pairs) if any(pieces[i].of_bar for i in pair)]
        found = [(k, a, b) if pieces[a].of_bar else (k, b, a) for k, a, b in found]
        bars, others = [pieces[a] for _, a, _ in found], [pieces[b] for *_, b in found]
        link = np.array([p.link if p.carrier == "link" else 0 for p in others], dtype=int)
        to_map = np.array([self._distance_from_map(p) for p in others])
        before = [robot.transforms[: robot.link_end[p.link]] for p in others]  # what stands still is before all joints
        reach = [axis_reach(b, robot.n_joints, core_reach(p)) for b, p in zip(before, others, strict=True)]
        return BarPairs(
            pair=np.array([k for k, *_ in found], dtype=int),
            housing=np.array([p.carrier == "housing" for p in bars], dtype=bool),
            end=np.array([core_reach(p) for p in bars]),
            reach=np.array(reach),
            link=link,
            to_map=to_map,
        )

    @cached_property
    def _reach(self) -> Array:
        """Largest distance from each axis between the two of a pair, (pairs, N) [m]; zero for pairs with the bar."""
        out = np.zeros((len(self.scene.pairs), self.scene.cell.robot.n_joints))
        for k, (a, b) in enumerate(self.scene.pairs):
            outward = sorted((self.scene.pieces[i] for i in (a, b)), key=lambda p: (p.carrier != "world", p.link))
            if not any(p.of_bar for p in outward):
                out[k] = self._joints_between(*outward)
        return out

    def _joints_between(self, near: SceneBody, far: SceneBody) -> Array:
        """Largest distance of the nearer of the two pieces from each axis between them, (N,) [m]."""
        robot = self.scene.cell.robot
        start, end = (0 if p.carrier == "world" else robot.link_end[p.link] for p in (near, far))
        between = robot.transforms[start:end]
        outward = axis_reach(between, robot.n_joints, core_reach(far))
        inward = axis_reach(between[::-1], robot.n_joints, core_reach(near))
        return np.asarray(np.minimum(outward, inward))

    def _distance_from_map(self, piece: SceneBody) -> float:
        """Bound the distance of the core of a piece that a link carries from the MAP [m]."""
        cell, body = self.scene.cell, piece.body
        if piece.link < cell.robot.n_joints:
            return chain_reach(cell.chain.transforms[cell.robot.link_end[piece.link] :]) + core_reach(piece)
        T_LF = cell.robot.flange_frame()
        p = T_LF[:3, :3] @ cell.tool.p_FM + T_LF[:3, 3]
        if body.kind == "capsule":
            ends = [body.T[:3, 3] + s * body.T[:3, 2] * body.size[1] / 2 for s in (-1, 1)]
            return max(float(np.linalg.norm(e - p)) for e in ends)
        return float(np.linalg.norm(p)) + core_reach(piece)


def core_reach(piece: SceneBody) -> float:
    """Largest distance of the body's core (a capsule's segment, a sphere's centre) from its carrier's origin [m]."""
    body = piece.body
    return piece.reach - body.size[0] if body.kind in ("capsule", "sphere") else piece.reach
