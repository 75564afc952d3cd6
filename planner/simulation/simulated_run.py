"""What the gauge would read along a plan: at rest at every visit, or while the path is driven."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.cell.cell import Cell
from planner.common.errors import InputError
from planner.common.units import Array, read_only
from planner.runs.run import NO_REFERENCE_READINGS, SIMULATED, ReferenceReadings, Run, Samples
from planner.session.document import PlanDocument, PoseRecord
from planner.session.plan_types import Course
from planner.simulation.assumptions import CORRELATION_TIME
from planner.simulation.equilibrium import solve_equilibrium
from planner.simulation.truth import Truth

SAMPLE_RATE = 100.0  # [Hz] of the samples of a run that is measured while moving


@dataclass(frozen=True, repr=False)
class SimulatedRun(Run):
    """A run that nobody measured.

    Attributes:
        truth: the errors behind it, as keys of ``TRUTH.toml``.
        beside: what was read beside the poses.
    """

    truth: tuple[str, ...] = ()
    beside: ReferenceReadings = NO_REFERENCE_READINGS

    def comments(self) -> str:
        """Return the comment lines that tell a person so, and what was read beside the poses."""
        truth = [f"truth: {line}" for line in (SIMULATED, *self.truth)]
        return "".join(f"# {line}\n" for line in (*truth, *self.beside.lines()))


def planned_samples(cell: Cell, plan: PlanDocument, courses: Sequence[Course]) -> Samples:
    """Return where the arm is told to stand when the gauge is read.

    A plan at rest gives one sample a visit, mounting poses left out. One that is driven gives ``RATE`` samples a
    second both ways, each with the id of the visit that it is nearest to in time, so that validation poses can be
    kept out with the stretch of path around them.

    Raises:
        InputError: nothing is measured.
    """
    moving = cell.motion.is_continuous
    parts = [_driven_samples(c) if moving else _samples_at_rest(cell, plan, c) for c in courses]
    fixture_change_s = 60.0  # for taking the bar to the next fixture
    starts = np.cumsum([0.0] + [c.trajectory.duration_s + fixture_change_s for c in courses[:-1]])
    count = [len(p.t) for p in parts]
    if not sum(count):
        raise InputError("the plan measures at no pose: each of them has the role 'mount'")
    q = np.concatenate([p.q for p in parts])
    place, point = (np.repeat(k, count) for k in zip(*(c.mounting for c in courses), strict=True))
    return Samples(
        q=read_only(q),
        place=place,
        point=point if len(cell.tool.points) > 1 else None,
        t=read_only(np.concatenate([p.t + start for p, start in zip(parts, starts, strict=True)])),
        session=np.repeat(np.arange(len(parts)), count) if moving else None,
        pose=np.concatenate([p.pose for p in parts]),
        direction=None if moving else read_only(np.concatenate([p.direction for p in parts])),
        speed=read_only(np.concatenate([p.speed for p in parts])) if moving else None,
    )


def simulate_run(cell: Cell, plan_id: str, samples: Samples, truth: Truth, seed: int) -> SimulatedRun:
    """Measure the samples on the robot as it truly is.

    The encoders read where the arm is told to stand; repeatability is what the joints are off by.
    """
    moving = cell.motion.is_continuous
    model, errors = truth.complete_model()
    rng = np.random.default_rng([seed, 1])
    off = model.joint_sigma * _repeatability_noise(rng, samples, moving)
    setup = model.setup
    gauge = setup.gauge
    noise = gauge.full_sigmas * rng.standard_normal((len(samples), len(gauge.full_sigmas)))

    def predict(told: Samples) -> Array:
        """Return the readings where the true robot stands, in balance under the gauge's force."""
        there = replace(told, q=told.q + off)
        where, stood = (model, there) if there.force is None else solve_equilibrium(model, there, errors)
        return where.full_reading(stood, errors)

    samples, readings = gauge.simulate(cell, samples, predict, model.joint_rows, noise)
    return SimulatedRun(
        name=f"simulated run of {plan_id}",
        samples=samples,
        readings=readings,
        places=setup.place_names,
        balls=() if readings.ball is None else tuple(b.name for b in cell.balls),
        points=setup.point_names,
        continuous=moving,
        plan_id=plan_id,
        robot=cell.robot.name,
        simulated=True,
        slides=cell.robot.slide_numbers,
        warnings=gauge.range_warnings(readings),
        truth=truth.lines(),
        beside=cell.gauge.reference_readings(cell, np.random.default_rng([seed, 2])),
    )


@dataclass(frozen=True)
class _FixtureSamples:
    """Samples of one fixture: t (n,) [s], q, speed (n, N) [rad, rad/s], pose (n,), direction (n, N) of −1, 0, 1."""

    t: Array
    q: Array
    speed: Array
    pose: np.ndarray
    direction: Array


def _samples_at_rest(cell: Cell, plan: PlanDocument, course: Course) -> _FixtureSamples:
    """Every visit in the middle of its reading."""
    poses = {p.id: p for p in plan.poses if p.role != "mount"}
    visit = course.measuring.visit
    at = np.flatnonzero(np.isin(visit, list(poses)))
    visited: list[PoseRecord] = [poses[int(k)] for k in visit[at]]
    t = course.trajectory.waypoint_time[at] + cell.seconds_until_read
    q = course.measuring.q[at]
    none = (0,) * q.shape[1]
    return _FixtureSamples(
        t, q, np.zeros_like(q), visit[at], np.array([p.approach or none for p in visited], dtype=float)
    )


def _driven_samples(course: Course) -> _FixtureSamples:
    """The whole drive; every sample belongs to the visit that is passed nearest in time."""
    trajectory = course.trajectory
    motion = trajectory.sample(1.0 / SAMPLE_RATE)
    at = np.flatnonzero(course.measuring.visit >= 0)
    passed = trajectory.waypoint_time[at] + trajectory.dwell[at] / 2
    nearest = np.searchsorted((passed[1:] + passed[:-1]) / 2, motion.t)
    return _FixtureSamples(motion.t, motion.q, motion.dq, course.measuring.visit[at][nearest], np.zeros_like(motion.q))


def _repeatability_noise(rng: np.random.Generator, samples: Samples, moving: bool) -> Array:
    """Deviations of the joints of unit size, (n, N): anew at every visit, wandering along a drive."""
    fresh = rng.standard_normal(samples.q.shape)
    if not moving or samples.session is None:
        return fresh
    from scipy.signal import lfilter  # costs most of a second

    stay = np.exp(-1.0 / (SAMPLE_RATE * CORRELATION_TIME))
    follows = np.diff(samples.session, prepend=-1) == 0
    fresh[follows] *= np.sqrt(1.0 - stay**2)
    for part in np.split(np.arange(len(fresh)), np.flatnonzero(~follows)[1:]):
        fresh[part] = lfilter([1.0], [1.0, -stay], fresh[part], axis=0)
    return fresh
