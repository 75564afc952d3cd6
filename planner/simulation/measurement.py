"""What the gauge would read along a plan: at rest at every visit, or while the path is driven."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from planner.cell.cell import Cell
from planner.cell.places import nests_frame
from planner.cell.setup import Targets, setup_of
from planner.common.units import MM, UM, Array, read_only
from planner.instruments.loaded.equilibrium import solve_equilibrium
from planner.model.model import Model
from planner.runs.reference_readings import NO_REFERENCE_READINGS, ReferenceReadings
from planner.runs.run import Readings, Run, Samples
from planner.session.course import Course, is_continuous
from planner.session.plan_file import PlanFile, PoseFile
from planner.simulation.truth import Truth

INDICATOR_NOISE = 0.5 * UM  # scatter of an indicator on the master ball
NEWTON_STEPS = 8  # of Newton's method from a planned pose to the centred one, millimetres away


def simulate_points(
    cell: Cell, model: Model, errors: Array, samples: Samples, off: Array, rng: np.random.Generator
) -> tuple[Samples, Readings]:
    """Return the samples as they are recorded, and the readings.

    Args:
        cell: the cell; artifact or tracker stand where it says, but for the errors that the model has of that.
        model, errors: the robot as it is, (P,).
        samples: where the arm is told to stand.
        off: what the joints are off by, (n, N) [rad].
        rng: of the gauge's noise.
    """
    noise = model.setup.noise * rng.standard_normal((len(samples), 3))
    if cell.gauge.head is None:
        place = cell.fixtures[0]
        x = _measured_point(model, samples, off, errors)
        return samples, Readings(position=read_only((x - place.p_BX) @ place.R_BX + noise))
    ball = np.argmin(np.linalg.norm(cell.map_position(samples.q)[:, None] - cell.p_BS[None], axis=2), axis=1)
    goal = cell.p_BS[ball] + noise
    for _ in range(NEWTON_STEPS):
        missing = goal - _measured_point(model, samples, off, errors)
        J = model.joint_rows(samples)
        samples = replace(samples, q=samples.q + np.einsum("nij,nj->ni", np.linalg.pinv(J), missing))
    return replace(samples, q=read_only(samples.q)), Readings(ball=ball)


def simulate_reference_readings(cell: Cell, rng: np.random.Generator) -> ReferenceReadings:
    """Return what is read before the poses: a tracker's nests, or twice a head's indicators at the master ball."""
    if cell.gauge.head is not None:
        wanted = cell.gauge.head.master / 2 - cell.balls[0].radius
        return ReferenceReadings(
            masters=tuple(read_only(wanted + INDICATOR_NOISE * rng.standard_normal(3)) for _ in range(2))
        )
    R_BW, p_BW = nests_frame(cell.file)
    place = cell.fixtures[0]
    seen = [(n.name, (R_BW @ n.p_WN + p_BW - place.p_BX) @ place.R_BX) for n in cell.nests]
    return ReferenceReadings(
        tuple((name, read_only(p + cell.gauge.noise * rng.standard_normal(3))) for name, p in seen)
    )


def _measured_point(model: Model, samples: Samples, off: Array, errors: Array) -> Array:
    """Where the measured point is, (n, 3) [m]."""
    there = replace(samples, q=samples.q + off)
    return -model.residual(there, Targets(position=np.zeros((len(samples), 3))), errors)


SAMPLE_RATE = 100.0  # [Hz] of the samples of a run that is measured while moving
FIXTURE_CHANGE_TIME = 60.0  # [s] for taking the bar to the next fixture
CORRELATION_TIME = 1.0  # [s] over which the joints' deviation from where they read is correlated while moving


@dataclass(frozen=True)
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
        truth = [f"truth: {line}" for line in ("simulated, nobody measured this", *self.truth)]
        return "".join(f"# {line}\n" for line in (*truth, *self.beside.lines()))


def planned_samples(cell: Cell, plan: PlanFile, courses: Sequence[Course]) -> Samples:
    """Return where the arm is told to stand when the gauge is read.

    A plan at rest gives one sample a visit, mounting poses left out; one that is driven gives ``RATE`` samples a
    second both ways, each with the id of the visit that it is nearest to in time, so that validation poses can be
    kept out with the stretch of path around them.
    """
    moving = is_continuous(cell)
    parts = [_samples_driven(c) if moving else _samples_at_rest(cell, plan, c) for c in courses]
    starts = np.cumsum([0.0] + [c.trajectory.duration_s + FIXTURE_CHANGE_TIME for c in courses[:-1]])
    count = [len(p.t) for p in parts]
    q = np.concatenate([p.q for p in parts])
    hung = setup_of(cell).visits(q, np.repeat([c.fixture for c in courses], count))
    return Samples(
        q=read_only(q),
        place=hung.place,
        point=hung.point,
        t=read_only(np.concatenate([p.t + start for p, start in zip(parts, starts, strict=True)])),
        session=np.repeat(np.arange(len(parts)), count) if moving else None,
        pose=np.concatenate([p.pose for p in parts]),
        direction=None if moving else read_only(np.concatenate([p.direction for p in parts])),
        speed=read_only(np.concatenate([p.speed for p in parts])) if moving else None,
    )


def simulate(cell: Cell, plan_id: str, samples: Samples, truth: Truth, seed: int) -> SimulatedRun:
    """Measure the samples on the robot as it truly is.

    The encoders read where the arm is told to stand; repeatability is what the joints are off by.
    """
    moving = is_continuous(cell)
    model, errors = truth.complete()
    rng = np.random.default_rng([seed, 1])
    off = model.joint_sigma * _repeatability_noise(rng, samples, moving)
    if not cell.gauge.is_bar:
        samples, readings = simulate_points(cell, model, errors, samples, off, rng)
        balls = tuple(b.name for b in cell.balls) if readings.ball is not None else ()
        return SimulatedRun(
            name=f"simulated run of {plan_id}",
            samples=samples,
            readings=readings,
            balls=balls,
            plan_id=plan_id,
            robot=cell.robot.name,
            truth=truth.lines(),
            beside=simulate_reference_readings(cell, np.random.default_rng([seed, 2])),
        )
    nothing = Targets(length=np.zeros(len(samples)))
    stood = replace(samples, q=samples.q + off)
    if samples.force is not None:  # a loaded bar turns as the arm yields, and its moments with it
        model, stood = solve_equilibrium(model, stood, errors)
    exact = -model.residual(stood, nothing, errors)[:, 0]
    length = exact + model.setup.noise * rng.standard_normal(len(samples))
    return SimulatedRun(
        name=f"simulated run of {plan_id}",
        samples=samples,
        readings=Readings(length=read_only(length)),
        places=model.setup.place_names,
        points=model.setup.point_names,
        continuous=moving,
        plan_id=plan_id,
        robot=cell.robot.name,
        warnings=_unreachable_lengths(cell, length),
        truth=truth.lines(),
    )


@dataclass(frozen=True)
class _FixtureSamples:
    """Samples of one fixture: t (n,) [s], q, speed (n, N) [rad, rad/s], pose (n,), direction (n, N) of −1, 0, 1."""

    t: Array
    q: Array
    speed: Array
    pose: np.ndarray
    direction: Array


def _samples_at_rest(cell: Cell, plan: PlanFile, course: Course) -> _FixtureSamples:
    """Every visit in the middle of its dwell."""
    poses = {p.id: p for p in plan.poses if p.role != "mount"}
    visit = course.measuring.visit
    at = np.flatnonzero(np.isin(visit, list(poses)))
    visited: list[PoseFile] = [poses[int(k)] for k in visit[at]]
    t = course.trajectory.waypoint_time[at] + cell.motion.settle + cell.motion.dwell / 2
    q = course.measuring.q[at]
    none = (0,) * q.shape[1]
    return _FixtureSamples(
        t, q, np.zeros_like(q), visit[at], np.array([p.approach or none for p in visited], dtype=float)
    )


def _samples_driven(course: Course) -> _FixtureSamples:
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
    stay = np.exp(-1.0 / (SAMPLE_RATE * CORRELATION_TIME))
    follows = np.diff(samples.session, prepend=-1) == 0
    fresh[follows] *= np.sqrt(1.0 - stay**2)
    for part in np.split(np.arange(len(fresh)), np.flatnonzero(~follows)[1:]):
        fresh[part] = lfilter([1.0], [1.0, -stay], fresh[part], axis=0)
    return fresh


def _unreachable_lengths(cell: Cell, length: Array) -> tuple[str, ...]:
    out = (length < cell.gauge.length_min) | (length > cell.gauge.length_max)
    if not out.any():
        return ()
    low, high = cell.gauge.length_min * 1e3, cell.gauge.length_max * 1e3
    return (
        f"{out.sum()} of {len(length)} lengths lie outside the bar's {low:g} … {high:g} mm: with these errors it "
        "would be pulled off there",
    )


def warn_uncentred_balls(cell: Cell, run: SimulatedRun, planned: Samples) -> SimulatedRun:
    """Return the run, warned of balls that were met too far off centre; ``planned`` is where the arm was sent."""
    head = cell.gauge.head
    if run.readings.ball is None or head is None:
        return run
    apart = np.linalg.norm(cell.map_position(run.samples.q) - cell.map_position(planned.q), axis=1)
    far = int((apart > head.usable).sum())
    if not far:
        return run
    said = (
        f"{far} of {len(run)} balls were met more than {head.usable / MM:g} mm off centre (largest "
        f"{apart.max() / MM:.1f}), where the head does not measure: this robot is further off than "
        f"gauge.head.uncalibrated_mm = {head.uncalibrated / MM:g} says; give smaller errors with --truth"
    )
    return replace(run, warnings=(*run.warnings, said))
