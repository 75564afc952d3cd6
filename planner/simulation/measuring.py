"""What the gauge would read along a plan: at rest at every visit, or while the path is driven."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from planner.cell import Cell
from planner.loaded.balance import in_balance
from planner.plan import Course, PlanFile, PoseFile, is_continuous
from planner.rig import Targets, rig_of
from planner.run import Readings, Run, Samples
from planner.run.beside import NOTHING, Beside
from planner.simulation.points import simulated_beside, simulated_points
from planner.simulation.truth import Truth
from planner.units import Array, frozen

RATE = 100.0  # [Hz] of the samples of a run that is measured while moving
PAUSE = 60.0  # [s] for taking the bar to the next fixture
WANDER = 1.0  # [s] over which the joints' deviation from where they read is correlated while moving


@dataclass(frozen=True)
class SimulatedRun(Run):
    """A run that nobody measured.

    Attributes:
        truth: the errors behind it, as keys of ``TRUTH.toml``.
        beside: what was read beside the poses.
    """

    truth: tuple[str, ...] = ()
    beside: Beside = NOTHING

    def comments(self) -> str:
        """Return the comment lines that tell a person so, and what was read beside the poses."""
        truth = [f"truth: {line}" for line in ("simulated, nobody measured this", *self.truth)]
        return "".join(f"# {line}\n" for line in (*truth, *self.beside.lines()))


def samples_of(cell: Cell, plan: PlanFile, courses: Sequence[Course]) -> Samples:
    """Return where the arm is told to stand when the gauge is read.

    A plan at rest gives one sample a visit, mounting poses left out; one that is driven gives ``RATE`` samples a
    second both ways, each with the id of the visit that it is nearest to in time, so that validation poses can be
    kept out with the stretch of path around them.
    """
    moving = is_continuous(cell)
    parts = [_driven(c) if moving else _rests(cell, plan, c) for c in courses]
    starts = np.cumsum([0.0] + [c.trajectory.duration_s + PAUSE for c in courses[:-1]])
    count = [len(p.t) for p in parts]
    q = np.concatenate([p.q for p in parts])
    hung = rig_of(cell).visits(q, np.repeat([c.fixture for c in courses], count))
    return Samples(
        q=frozen(q),
        place=hung.place,
        point=hung.point,
        t=frozen(np.concatenate([p.t + start for p, start in zip(parts, starts, strict=True)])),
        session=np.repeat(np.arange(len(parts)), count) if moving else None,
        pose=np.concatenate([p.pose for p in parts]),
        direction=None if moving else frozen(np.concatenate([p.direction for p in parts])),
        speed=frozen(np.concatenate([p.speed for p in parts])) if moving else None,
    )


def simulate(cell: Cell, plan_id: str, samples: Samples, truth: Truth, seed: int) -> SimulatedRun:
    """Measure the samples on the robot as it truly is.

    The encoders read where the arm is told to stand; repeatability is what the joints are off by.
    """
    moving = is_continuous(cell)
    model, errors = truth.complete()
    rng = np.random.default_rng([seed, 1])
    off = model.joint_sigma * _shaken(rng, samples, moving)
    if not cell.gauge.is_bar:
        samples, readings = simulated_points(cell, model, errors, samples, off, rng)
        balls = tuple(b.name for b in cell.balls) if readings.ball is not None else ()
        return SimulatedRun(
            name=f"simulated run of {plan_id}",
            samples=samples,
            readings=readings,
            balls=balls,
            plan_id=plan_id,
            robot=cell.robot.name,
            truth=truth.lines(),
            beside=simulated_beside(cell, np.random.default_rng([seed, 2])),
        )
    nothing = Targets(length=np.zeros(len(samples)))
    stood = replace(samples, q=samples.q + off)
    if samples.force is not None:  # a loaded bar turns as the arm yields, and its moments with it
        model, stood = in_balance(model, stood, errors)
    exact = -model.residual(stood, nothing, errors)[:, 0]
    length = exact + model.rig.noise * rng.standard_normal(len(samples))
    return SimulatedRun(
        name=f"simulated run of {plan_id}",
        samples=samples,
        readings=Readings(length=frozen(length)),
        places=model.rig.place_names,
        points=model.rig.point_names,
        continuous=moving,
        plan_id=plan_id,
        robot=cell.robot.name,
        warnings=_unreachable(cell, length),
        truth=truth.lines(),
    )


@dataclass(frozen=True)
class _Part:
    """Samples of one fixture: t (n,) [s], q, speed (n, N) [rad, rad/s], pose (n,), direction (n, N) of −1, 0, 1."""

    t: Array
    q: Array
    speed: Array
    pose: np.ndarray
    direction: Array


def _rests(cell: Cell, plan: PlanFile, course: Course) -> _Part:
    """Every visit in the middle of its dwell."""
    poses = {p.id: p for p in plan.poses if p.role != "mount"}
    visit = course.measuring.visit
    at = np.flatnonzero(np.isin(visit, list(poses)))
    visited: list[PoseFile] = [poses[int(k)] for k in visit[at]]
    t = course.trajectory.waypoint_time[at] + cell.motion.settle + cell.motion.dwell / 2
    q = course.measuring.q[at]
    none = (0,) * q.shape[1]
    return _Part(t, q, np.zeros_like(q), visit[at], np.array([p.approach or none for p in visited], dtype=float))


def _driven(course: Course) -> _Part:
    """The whole drive; every sample belongs to the visit that is passed nearest in time."""
    trajectory = course.trajectory
    motion = trajectory.sample(1.0 / RATE)
    at = np.flatnonzero(course.measuring.visit >= 0)
    passed = trajectory.waypoint_time[at] + trajectory.dwell[at] / 2
    nearest = np.searchsorted((passed[1:] + passed[:-1]) / 2, motion.t)
    return _Part(motion.t, motion.q, motion.dq, course.measuring.visit[at][nearest], np.zeros_like(motion.q))


def _shaken(rng: np.random.Generator, samples: Samples, moving: bool) -> Array:
    """Deviations of the joints of unit size, (n, N): anew at every visit, wandering along a drive."""
    fresh = rng.standard_normal(samples.q.shape)
    if not moving or samples.session is None:
        return fresh
    stay = np.exp(-1.0 / (RATE * WANDER))
    follows = np.diff(samples.session, prepend=-1) == 0
    fresh[follows] *= np.sqrt(1.0 - stay**2)
    for part in np.split(np.arange(len(fresh)), np.flatnonzero(~follows)[1:]):
        fresh[part] = lfilter([1.0], [1.0, -stay], fresh[part], axis=0)
    return fresh


def _unreachable(cell: Cell, length: Array) -> tuple[str, ...]:
    out = (length < cell.gauge.length_min) | (length > cell.gauge.length_max)
    if not out.any():
        return ()
    low, high = cell.gauge.length_min * 1e3, cell.gauge.length_max * 1e3
    return (
        f"{out.sum()} of {len(length)} lengths lie outside the bar's {low:g} … {high:g} mm: with these errors it "
        "would be pulled off there",
    )
