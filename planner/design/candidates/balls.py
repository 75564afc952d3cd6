"""Candidates at the balls of an artifact, and how far off centre an uncalibrated robot first meets a ball (TriCal
paper, section 3)."""

from dataclasses import astuple, dataclass, replace
from typing import ClassVar

import numpy as np

from planner.cell.cell import Cell
from planner.cell.workspace import SAFETY_MARGIN, Workspace
from planner.common.errors import NoSolutionError
from planner.common.progress import StageProgress
from planner.common.sequences import sobol_points
from planner.common.units import Array, read_only, to_mm
from planner.design.assumptions import BALL_MARGIN, CHANCE_OF_A_LED_ARM, LEAST_SINGULAR_VALUE, TURN_MARGIN_SIGMAS
from planner.design.candidates.pool import Funnel, PoseSet, draw_candidates
from planner.kinematics.inverse_kinematics import POINT_TOLERANCE, smallest_singular_value, solve_point_ik
from planner.model.model import Model
from planner.motion.collision.engines import CollisionWorld
from planner.runs.run import Samples


class FirstContact:
    """Predicts the error of the measured point before calibration, pose by pose.

    The covariance is the prior one of all errors of the robot, of the artifact's place and of the tool point as it was
    mastered: C = J Σ Jᵀ. How the robot's share is spread over its poses comes from J and the prior sigmas; its size is
    the cell's own figure, ``uncalibrated``, which the 95 % bounds of no pose exceed.
    """

    def __init__(self, cell: Cell) -> None:
        model = Model.from_cell(cell, frozenset({"fixture", "tool"}))
        robot = [k for k, p in enumerate(model.parameters) if p.group != "gauge"]
        self._robot = model.subset(robot)
        self._rest = model.subset([k for k in range(len(model.parameters)) if k not in robot])
        rng = np.random.default_rng(0)
        # 2000: states of the whole arm, over which its errors are held to what the cell says of them
        states = rng.uniform(cell.robot.q_lower, cell.robot.q_upper, (2000, cell.robot.n_joints))
        self._scale = (
            cell.gauge.indicators.uncalibrated / length_quantile(_prior_covariance(self._robot, states)).max()
        ) ** 2

    @classmethod
    def of(cls, cell: Cell) -> "FirstContact | None":
        """Return the first contact of a head of indicators; ``None`` for a socket: a person leads the ball into it."""
        head = cell.gauge.head
        return None if head is None else cls(cell)

    def at(self, q: Array) -> Array:
        """Return the distance from the centre that 95 % of contacts stay within, (n,) [m], at q (n, N) [rad]."""
        return length_quantile(self._scale * _prior_covariance(self._robot, q) + _prior_covariance(self._rest, q))


def corrected_turns(cell: Cell, q: Array) -> Array:
    """Return how much the arm's errors turn its joints where the tool point is led to a ball, (n, N) [rad].

    A reading moves by J δq + R e with the errors e of robot, tool and artifact, of their prior sigmas; what is led
    there turns by the shortest δq = −J⁺ R e. Returned are its standard deviations at q (n, N) [rad], zero where
    nothing is led.

    Raises:
        InputError: the cell does not say where its artifact stands.
    """
    if not cell.gauge.at_balls:
        return np.zeros_like(q)
    places = cell.fixtures or cell.gauge.read_places(cell.path, cell.robot, cell.file)  # read for planning alone
    model, samples = Model.from_cell(replace(cell, fixtures=places), frozenset({"fixture", "tool"})), Samples.at(q)
    turns = np.linalg.pinv(model.joint_rows(samples)) @ (model.rows(samples) * model.prior)
    return np.asarray(np.linalg.norm(turns, axis=2))


def length_quantile(covariance: Array) -> Array:
    """Return the 95 % quantile of the length of normal vectors with covariance (n, 3, 3), (n,).

    The squared length is a weighted sum of χ²; its first two moments fit a scaled χ² (Satterthwaite 1946).
    """
    trace = np.trace(covariance, axis1=1, axis2=2)
    square = np.einsum("nij,nji->n", covariance, covariance)
    degrees = trace**2 / square
    from scipy.stats import chi2  # costs most of a second

    return np.asarray(np.sqrt(square / trace * chi2.ppf(CHANCE_OF_A_LED_ARM, degrees)))


def first_contact_advice(cell: Cell, found: Array) -> str:
    """Say what would help where the first contact lies beyond what the head can take, everywhere."""
    usable = float(to_mm(cell.gauge.indicators.usable))
    return (
        f"the uncalibrated robot would meet it {float(to_mm(found.min())):.1f} mm or more off centre at every pose "
        f"(95 %), and the indicators make contact within {usable:g} mm: place the artifact better "
        "(artifact.prior_mm, prior_deg), or calibrate roughly first (gauge.head.uncalibrated_mm)"
    )


def _prior_covariance(model: Model, q: Array) -> Array:
    """Covariance of the measured point from the prior sigmas of a model's parameters, (n, 3, 3) [m²]."""
    rows = model.rows(Samples.at(q)) * model.prior
    return np.asarray(rows @ np.swapaxes(rows, 1, 2))


DRAWS = (1 << 10, 1 << 14, 1 << 17)  # samples of a ball in the first round, at least and at most, and in any later one
HOPELESS_SAMPLES = 3 * DRAWS[1]  # of which none is left: no more are drawn


@dataclass(frozen=True)
class BallFunnel(Funnel):
    """Counts of candidates at balls; there are no cones, so those pass all."""

    approach: int = 0
    contact: int = 0

    names: ClassVar[tuple[str, ...]] = (
        "sampled",
        "within joint limits",
        "on the ball",
        "oriented freely",
        "within the cable",
        "collision-free",
        "approached freely",
        "met within reach of the indicators",
    )
    missed: ClassVar[str] = "the uncalibrated robot might meet the ball too far off, or not be steered in small steps"


class SocketFunnel(BallFunnel):
    """The same at sockets, into which a person leads the ball."""

    names: ClassVar[tuple[str, ...]] = (
        *BallFunnel.names[:2], "in the socket", "turned as the socket allows", *BallFunnel.names[4:7],
        "led in by a person",
    )  # fmt: skip
    missed: ClassVar[str] = (
        "joints might come to their limits where the uncalibrated robot's ball is led into the socket"
    )


def draw_ball_candidates(cell: Cell, count: int, seed: int = 0, progress: StageProgress | None = None) -> PoseSet:
    """Draw ``count`` candidates, shared evenly by the balls, or what the rounds allow.

    Raises:
        NoSolutionError: a ball is out of reach, or no pose at it passes all filters; the message says which and why.
    """
    share = -(-count // len(cell.balls))
    world, contact = CollisionWorld.from_cell(cell), FirstContact.of(cell)
    parts: list[tuple[Array, Array]] = []
    funnel = BallFunnel()
    for ball in range(len(cell.balls)):
        one = _BallFilter(cell, ball, world, contact)
        q, back, counted = one.draw(share, seed)
        funnel += counted
        parts.append((q, back))
        if progress is not None:
            progress(ball + 1, len(cell.balls))
    which = read_only(np.repeat(np.arange(len(parts)), [len(q) for q, _ in parts]), int)
    q, back = (read_only(np.vstack(p)) for p in zip(*parts, strict=True))
    left = funnel if contact else SocketFunnel(*astuple(funnel))
    return PoseSet(Samples.at(q), left, which, back)


def draw_pose_candidates(cell: Cell, count: int, seed: int = 0, progress: StageProgress | None = None) -> PoseSet:
    """Draw ``count`` candidates for any gauge: at the balls of an artifact where it is read there, else anywhere.

    Raises:
        NoSolutionError: as :func:`draw_ball_candidates` and :func:`planner.design.candidates.pool.draw_candidates`.
    """
    draw = draw_ball_candidates if cell.gauge.at_balls else draw_candidates
    return draw(cell, count, seed, progress)


class _BallFilter:
    """The filters at one ball."""

    def __init__(self, cell: Cell, ball: int, world: CollisionWorld, contact: FirstContact | None) -> None:
        self.cell, self.ball, self.contact = cell, ball, contact
        self.away, self.at = world, CollisionWorld(world.scene.at_ball(ball))
        self.workspace = Workspace(cell, bar=False)
        self.nearest, self.hit, self.met = np.inf, np.zeros(len(self.at.scene.pairs), dtype=int), np.zeros(0)

    def draw(self, count: int, seed: int) -> tuple[Array, Array, BallFunnel]:
        """Draw until there are ``count``: poses at the ball, their approach poses (n, N) [rad], and what was left."""
        lower, upper = self.cell.sampling_range
        points = sobol_points(len(lower), [seed, self.ball])
        found: list[tuple[Array, Array]] = []
        funnel = BallFunnel()
        # 16: samples of a ball for each wanted pose in the first round
        first = int(np.clip(1 << (16 * count - 1).bit_length(), *DRAWS[:2]))
        for k in range(12):  # rounds, each twice the last
            q = lower + points(min(first << k, DRAWS[2])) * (upper - lower)
            passed, back, counted = self._filter(q)
            found.append((passed, back))
            funnel += counted
            if funnel.contact >= count or (funnel.contact == 0 and funnel.sampled >= HOPELESS_SAMPLES):
                break
        if funnel.contact == 0:
            raise NoSolutionError(self._why_empty(funnel))
        q, back = (np.vstack(p)[:count] for p in zip(*found, strict=True))
        return q, back, funnel

    def _filter(self, sample: Array) -> tuple[Array, Array, BallFunnel]:
        q, off = solve_point_ik(self.cell.chain, self.cell.robot, sample, self.cell.p_BS[self.ball])
        self.nearest = min(self.nearest, float(off.min()))
        within = (self.workspace.stage("joint_limits", q) > SAFETY_MARGIN).all(axis=1)
        on = within & (off < POINT_TOLERANCE)
        q = q[on]
        q = q[self.cell.gauge.fits(self.cell, q, self.ball)]
        fitting = len(q)
        cable = (self.workspace.stage("cable", q) > SAFETY_MARGIN).all(axis=1)
        q = q[cable]
        hits = self.at.collides(q, self.cell.motion.clearance + BALL_MARGIN)
        self._blame(q[hits])
        q = q[~hits]
        back, free = self._approach(q)
        q, back = q[free], back[free]
        near = self._contact(q)
        counts = (len(sample), int(within.sum()), int(on.sum()), fitting, int(cable.sum()), len(free), len(q))
        return q[near], back[near], BallFunnel(*counts, int(near.sum()))

    def _contact(self, q: Array) -> np.ndarray:
        """Tell where a person can lead the ball in, or a head meets it and steers in small steps, (n,) bool."""
        if not len(q):
            return np.ones(0, dtype=bool)
        robot = self.cell.robot
        if self.contact is None:
            room = np.minimum(q - robot.q_lower, robot.q_upper - q)
            return np.asarray((room > TURN_MARGIN_SIGMAS * corrected_turns(self.cell, q)).all(axis=1))
        self.met = self.contact.at(q)
        nimble = smallest_singular_value(self.cell.chain, self.cell.robot, q) > LEAST_SINGULAR_VALUE
        return np.asarray((self.met < self.cell.gauge.indicators.usable) & nimble)

    def _approach(self, q: Array) -> tuple[Array, np.ndarray]:
        """Approach poses (n, N) [rad], and which of them and of the ways from there are free, (n,) bool."""
        if not len(q):
            return q, np.zeros(0, dtype=bool)
        cell = self.cell
        back, off = cell.gauge.retract(cell, q, self.ball)
        ok = (off < 10 * POINT_TOLERANCE) & (self.workspace.margins(back) > SAFETY_MARGIN).all(axis=1)
        ok[ok] = ~self.away.collides(back[ok], cell.motion.clearance + SAFETY_MARGIN)
        for share in (0.25, 0.5, 0.75):  # share of the approach that is looked at
            between = q + share * (back - q)
            ok[ok] = ~self.at.collides(between[ok], cell.motion.clearance + BALL_MARGIN)
        return back, ok

    def _blame(self, q: Array) -> None:
        """Count which pairs keep the first colliding states from being poses."""
        if len(q):
            # 200 colliding states say what is hit
            self.hit += (self.at.distances(q[:200]) < self.cell.motion.clearance).sum(axis=0)

    def _why_empty(self, funnel: BallFunnel) -> str:
        name = self.cell.balls[self.ball].name
        head = f"no candidate pose is left at ball {name}: {funnel.text()}."
        if funnel.workspace == 0:
            place = ", ".join(f"{v:.0f}" for v in to_mm(self.cell.p_BS[self.ball]))
            if self.nearest < POINT_TOLERANCE:
                return f"{head} Only joint angles beyond the limits reach it: move the artifact."
            return (
                f"ball {name}, at [{place}] mm in the base frame, is out of reach by "
                f"{float(to_mm(self.nearest)):.0f} mm: move the artifact nearer (artifact.position_mm) "
                "or take a longer tool"
            )
        if funnel.cones == 0:
            return (
                f"{head} The tool never comes within the socket's cone: look at the socket's axis, tool.map_axis (out "
                "of the tool through its ball) and gauge.cone_deg"
            )
        if funnel.cable == 0:
            return f"{head} The cable's budget rejects all: raise cable limits, or choose a home that is less twisted."
        if funnel.approach == 0:
            pair = self.at.scene.describe_pair(int(np.argmax(self.hit)))
            where = "there" if funnel.collision == 0 else "on the way there"
            return (
                f"{head} Every pose collides {where}, most often {pair}: look at motion.clearance_mm, the stem and "
                f"bodies around it, and the bodies of the tool{_of_gripper(self.cell)}"
            )
        if self.contact is None:
            return f"{head} Joints reach their limits where errors of the usual size are led away: move the artifact."
        return f"{head} At ball {name} {first_contact_advice(self.cell, self.met)}"


def _of_gripper(cell: Cell) -> str:
    """Say what else may be in the way of an arm that was read from a URDF."""
    urdf = cell.robot.convention == "urdf"
    return "; a gripper that is taken off must be taken out of the URDF too (docs/how-to/robot.md)" if urdf else ""
