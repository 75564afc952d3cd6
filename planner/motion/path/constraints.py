"""Everything that a pose and a motion must keep: limits, bar length, cones, cable, and the clearance of all bodies."""

from functools import cached_property

import numpy as np

from planner.cell.cell import Cell
from planner.cell.workspace import Workspace
from planner.common.progress import UNLIMITED, TimeLimit
from planner.common.units import MM, Array, to_deg, to_mm
from planner.motion.collision.engines import CollisionWorld
from planner.motion.collision.fcl_world import FclWorld, ScreenedDistances
from planner.motion.collision.scene import Scene, build_scene
from planner.motion.path.margins import PairBounds, WorkspaceBounds
from planner.motion.path.proof import Extremes, Proof, Prover, find_extremes
from planner.motion.timing.leg_times import limit_times
from planner.runs.run import FIRST_MOUNTING, Mounting


class Constraints:
    """Constraints of a cell with the gauge held in one way.

    Args:
        cell: the cell.
        mounting: how the gauge is held.
        bar: whether the bar is attached; without it the arm travels free of length, cones and twist about the bar.
        scene: bodies and pairs, where a collision world has already found out which pairs always overlap.
        room: distance of bodies that is wanted beyond the cell's clearance [m].
        limit: of the time that proofs and searches may take.
    """

    def __init__(
        self, cell: Cell, mounting: Mounting = FIRST_MOUNTING, bar: bool = True, scene: Scene | None = None,
        room: float = 0.0, limit: TimeLimit = UNLIMITED,
    ) -> None:  # fmt: skip
        cell = cell.at(mounting)
        scene = build_scene(cell, mounting) if scene is None else scene
        bar = bar and cell.gauge.is_attached
        self.cell, self.bar, self.room, self.limit = cell, bar, room, limit
        self.workspace = Workspace(cell, mounting, bar)
        self.scene = scene if bar else scene.without_bar()
        self.world = CollisionWorld(self.scene)
        self.bounds, self.pairs = WorkspaceBounds(self.workspace), PairBounds(self.scene)
        self._at_balls: dict[int, Constraints] = {}
        self._proofs: dict[tuple[str, bytes], Proof] = {}

    def at_ball(self, ball: int) -> "Constraints":
        """Return the constraints of the last way to one ball of an artifact, which the indicators' tips may touch."""
        if ball not in self._at_balls:
            scene = self.scene.at_ball(ball)
            self._at_balls[ball] = Constraints(self.cell, self.workspace.mounting, False, scene, self.room, self.limit)
        return self._at_balls[ball]

    @property
    def clearance(self) -> float:
        """Smallest distance of two bodies that is allowed [m]."""
        return self.cell.motion.clearance + self.room

    def with_room(self, room: float) -> "Constraints":
        """Return the same constraints with bodies kept ``room`` [m] further apart than the cell asks."""
        wide = Constraints(self.cell, self.workspace.mounting, self.bar, self.scene, room, self.limit)
        wide.pairs = self.pairs  # found already: bounds of how fast distances change know no clearance
        return wide

    def valid(self, q: Array) -> np.ndarray:
        """Tell which states (n, N) [rad] keep every constraint, (n,) bool."""
        rows = np.flatnonzero((self.bounds.margins(q) > 0.0).all(axis=1))
        out = np.zeros(len(q), dtype=bool)
        out[rows] = ~self.world.find_near(q[rows], self.clearance)
        return out

    def reason(self, q: Array) -> str | None:
        """Say what is wrong with the state q (N,) [rad], or ``None``."""
        margins = self.workspace.margins(q[None])[0]
        if margins.min() <= 0.0:
            return self._overrun(int(np.argmin(margins)), float(margins.min()))
        found = self.world.distances(q[None])[0]
        if len(found) == 0:  # a robot without bodies has nothing to collide with
            return None
        k = int(np.argmin(found))
        return self._too_near(k, float(found[k])) if found[k] <= self.clearance else None

    def touching_links(self, q: Array) -> list[str]:
        """Return the pairs of the robot's own links that are too near at q (N,) [rad], written as in ``never_meet``."""
        near = np.flatnonzero(self.world.distances(q[None])[0] <= self.clearance).tolist()
        return sorted({key for key in map(self.scene.never_meet_key, near) if key})

    def driven_times(self, q_from: Array, q_to: Array) -> Array:
        """Return the time of straight joint motions (m, N) [rad] by the slowest limit of cell and gauge, (m,) [s]."""
        return limit_times(self.cell, self.workspace.mounting, q_from, q_to, self.bar)

    def prove(self, q_from: Array, q_to: Array) -> Proof:
        """Prove the straight joint motions between states (m, N) and (m, N) [rad], continuously."""
        return self.prove_corners(np.stack([q_from, q_to], axis=1))

    def prove_corners(self, corners: Array) -> Proof:
        """Prove every state in the hulls of corners (m, K, N) [rad]: motions (K = 2), triangles about a blend (K = 3).

        For searches: with distances in closed form where there are any.
        """
        return self._prover.prove(corners)

    def judge_by_coal(self, corners: Array) -> Proof:
        """Prove motions or triangles (m, K, N) [rad] with coal's distances alone."""
        return self._judge_once(
            "coal", Prover(self.bounds, self.pairs, self.world, self.clearance, self.limit), corners
        )

    def judge(self, corners: Array) -> Proof:
        """Prove motions or triangles (m, K, N) [rad] again with python-fcl's distances."""
        return self._judge_once("python-fcl", self._judge, corners)

    def prove_by_both_engines(self, corners: Array) -> np.ndarray:
        """Tell which motions or triangles (m, K, N) [rad] both engines prove, (m,) bool."""
        out = self.prove_corners(corners).proven
        out[out] = self.judge(corners[out]).proven
        return out

    def _judge_once(self, engine: str, judge: Prover, corners: Array) -> Proof:
        """Prove what this engine has not proven yet: a path is judged when it is found, and again with blends."""
        keys = [(engine, each.tobytes()) for each in corners]
        new = [k for k, key in enumerate(keys) if key not in self._proofs]
        if not keys:
            return judge.prove(corners)
        if new:
            proof = judge.prove(corners[new])
            self._proofs |= {keys[k]: proof.take(np.array([i])) for i, k in enumerate(new)}
        return Proof.concatenate([self._proofs[key] for key in keys])

    def remember(self, corners: Array, judged: Proof) -> None:
        """Keep what a copy of this process found by :meth:`judge` for motions or triangles (m, K, N) [rad]."""
        self._proofs |= {("python-fcl", each.tobytes()): judged.take(np.array([k])) for k, each in enumerate(corners)}

    def extremes(self, corners: Array, tolerance: float) -> Extremes:
        """Smallest clearance and extreme lengths over motions or triangles (m, K, N) [rad], to ``tolerance`` [m]."""
        return find_extremes(self._prover, corners, tolerance)

    def failure(self, proof: Proof, k: int) -> str | None:
        """Say which constraint motion ``k`` of a proof fails, and where, or ``None``."""
        column = int(proof.failed[k])
        if column < 0:
            return None
        columns = self.workspace.columns
        name = columns[column][1] if column < len(columns) else self.scene.pair_name(column - len(columns))
        what = name if column < len(columns) else f"clearance of {name}"
        return f"{what}, {100 * proof.failed_at[k]:.0f} % of the way"

    @cached_property
    def _prover(self) -> Prover:
        return Prover(self.bounds, self.pairs, ScreenedDistances(self.world), self.clearance, self.limit)

    @cached_property
    def _judge(self) -> Prover:
        return Prover(self.bounds, self.pairs, FclWorld(self.scene), self.clearance, self.limit)

    def _overrun(self, column: int, margin: float) -> str:
        stage, name = self.workspace.columns[column]
        size = f"{to_mm(-margin):.1f} mm" if stage == "workspace" else f"{to_deg(-margin):.1f}°"
        return f"{name} exceeded by {size}"

    def _too_near(self, pair: int, distance: float) -> str:
        name, wanted = self.scene.describe_pair(pair), to_mm(self.clearance)
        if distance <= 0.0:
            return f"{name} collide ({wanted:g} mm wanted between them)"
        return f"{name} come within {distance / MM:.1f} mm ({wanted:g} mm wanted)"
