"""What a person must know of a planned session: its programs, its bar lengths, and which effects it tells apart."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from planner.cell.cell import Cell, setup_of
from planner.common.summary import Aside
from planner.common.units import Array, to_mm
from planner.design.assumptions import UNSURE_POWER
from planner.design.discrimination.power import Discrimination
from planner.design.discrimination.selection import DiscriminatingChoice
from planner.design.observability.information import INDEX_RULES
from planner.design.pose_selection import PoseChoice, warn_too_few_readings
from planner.effects.compliance import LEAST_LOAD
from planner.effects.context import Context
from planner.model.tool_error import uniform_states
from planner.motion.collision.body_gaps import describe_body_gaps
from planner.motion.collision.surroundings import (
    describe_parked_joints,
    describe_polytopes,
    describe_unchecked_links,
    unchecked_links_text,
)
from planner.runs.joint_motion import last_reversals
from planner.runs.run import Samples
from planner.session.plan_types import Drive
from planner.session.tolerances import MUCH_WORSE

MEASURED = ("calibrate", "repeat")


def session_notes(cell: Cell) -> tuple[str, ...]:
    """Return notes about everything in a session that differs from what was asked for."""
    collision = (
        *describe_body_gaps(cell),
        *describe_unchecked_links(cell),
        *describe_parked_joints(cell),
        *unchecked_links_text(cell),
        *describe_polytopes(cell),
    )
    return (*_home_notes(cell), *_repeat_notes(cell), *_speed_notes(cell), *collision)


def load_notes(cell: Cell, samples: Samples) -> tuple[str, ...]:
    """Say which joints most of the workspace loads otherwise than the poses that are measured; none where few."""
    setup, few = setup_of(cell), 0.1  # share of the workspace
    if not setup.weighs:
        return ()
    states = Samples.at(uniform_states(cell, 1000, 0))
    here, anywhere = (Context(setup, s).load_torque for s in (samples, states))
    low, high = here.min(axis=0), here.max(axis=0)
    beyond = np.where(np.abs(anywhere).max(axis=0) > LEAST_LOAD, ((anywhere < low) | (anywhere > high)).mean(axis=0), 0)
    said = [
        f"joint {k + 1} ({beyond[k]:.0%}; measured {low[k]:.3g} to {high[k]:.3g} Nm, there "
        f"{anywhere[:, k].min():.3g} to {anywhere[:, k].max():.3g} Nm)"
        for k in np.flatnonzero((beyond > few) & ~cell.robot.slides).tolist()
    ]
    if not said:
        return ()
    return (
        Aside(
            f"parts of the workspace load joints otherwise than these poses do: {', '.join(said)}. How they turn there "
            "no reading says"
        ),
    )


def _home_notes(cell: Cell) -> list[str]:
    """Angles within one turn in radians, none of them whole, may be radians; multiples of 45° are refused before."""
    said = cell.file.home_deg or ()
    turned = [v for v in said if v != 0.0]
    # 0.3: [rad] about which a robot that waits has turned a joint at least; 2 of them: one alone may be a trim
    may_be = len(turned) >= 2 and 0.3 < max(map(abs, turned)) < 2 * np.pi and not any(v.is_integer() for v in turned)
    if not may_be:
        return []
    meant = ", ".join(f"{v:.1f}" for v in np.rad2deg(said))
    return [f"home_deg = {list(said)} looks like radians, and is taken for degrees; if radians are meant: [{meant}]"]


def bar_notes(cell: Cell, drives: Iterable[Drive]) -> tuple[str, ...]:
    """Return what is to be told of poses nearer to the bar's ends than is known where it hangs."""
    low, high, noun = cell.gauge.length_min, cell.gauge.length_max, cell.gauge.noun
    out = []
    if free := cell.gauge.unchecked_length:
        out.append(
            f"up to {to_mm(free):.0f} mm in the middle of the {noun} are not checked for collisions: a gauge.length_mm "
            "whose longest is at most twice the shortest checks all of it"
        )
    for drive in drives:
        prior = float(np.hypot(cell.fixtures[drive.mounting.fixture].prior, cell.tool.prior))
        room = [min(v.length - low, high - v.length) for v in drive.visits if v.role != "mount"]
        near = sum(r < prior for r in room)
        if near:
            out.append(
                f"{near} of {len(room)} poses at fixture {cell.place_name(drive.mounting)} come within "
                f"{to_mm(prior):.2g} mm of the {noun}'s ends, and it is known no better where fixture and tool point "
                f"are (their prior_mm): measure both first, or narrow gauge.length_mm, so that the {noun} meets no stop"
            )
    return tuple(out)


def _speed_notes(cell: Cell) -> list[str]:
    """Programs name one tool; who measures at several points of it is told which one."""
    if len(cell.tool.points) == 1:
        return []
    first = cell.tool.points[0].name
    return [f"the tool's point in a program, and its speed, are those of tool point {first} at all places of the bar"]


def _repeat_notes(cell: Cell) -> list[str]:
    """Repeats are visits at rest; who asked for them is told what stands in for them while moving."""
    asked = cell.plan.repeat and "repeat" in cell.file.plan.model_fields_set
    if not asked or not cell.motion.is_continuous:
        return []
    instead = "every pose is passed twice, there and back" if cell.motion.both_ways else "no pose is visited twice"
    return [f"plan.repeat = {cell.plan.repeat} is for poses at rest: in this continuous session {instead}"]


def driven_discrimination(cell: Cell, parted: DiscriminatingChoice, drives: tuple[Drive, ...]) -> Discrimination:
    """Return how surely the plan tells findings from rivals, as it is driven."""
    parts = [_samples_in_passing(d) if cell.motion.is_continuous else _samples_at_rest(cell, d) for d in drives]
    ways = min(len(p) for p in parts)
    return parted.judge_driven_visits(tuple(Samples.concatenate([p[k] for p in parts]) for k in range(ways)))


def discrimination_notes(
    cell: Cell, separation: Discrimination | None, choice: PoseChoice, drives: tuple[Drive, ...]
) -> tuple[str, ...]:
    """Return what a person should know of it."""
    if separation is None:
        return ()
    missed, few = _count_missed_sides(choice, drives), _scarcity_notes(cell, choice, drives)
    sides = (f"{missed} of {len(choice.q)} poses cannot be come to from the side that was wanted",) if missed else ()
    unsure = (
        f"{t.finding} and {t.rival} are told apart with a power of {t.power_text} only; what would help: "
        + "; or ".join(("more --poses", *t.help))
        for t in separation.told
        if t.power < UNSURE_POWER and t.named
    )
    return (
        *(f"not told apart: {s}" for s in separation.inseparable),
        *unsure,
        *sides,
        *few,
        *_index_notes(separation, choice),
    )


def _index_notes(separation: Discrimination, choice: PoseChoice) -> tuple[str, ...]:
    """Tell that poses which tell effects apart see the robot's own parameters much worse."""
    times = 1.0 + INDEX_RULES[choice.index].gap(choice.value, separation.alone)
    if times < MUCH_WORSE:
        return ()
    return (
        f"these poses see the robot's own parameters {times:.1f} times worse than poses chosen by {choice.index} alone "
        f"({choice.index} {choice.value:.4g} instead of {separation.alone:.4g} in m, rad): identify their run "
        "together with the one before",
    )


def _scarcity_notes(cell: Cell, choice: PoseChoice, drives: tuple[Drive, ...]) -> tuple[str, ...]:
    """Tell that a run at rest has too few readings to be traced."""
    visits = sum(v.role in MEASURED for d in drives for v in d.visits)
    said = None if cell.motion.is_continuous else warn_too_few_readings(visits * choice.model.width, choice.seen.rank)
    return () if said is None else (said,)


def _count_missed_sides(choice: PoseChoice, drives: tuple[Drive, ...]) -> int:
    """Number of chosen poses that are come to from another side than wanted."""
    if choice.approach is None:
        return 0
    wanted = {q.tobytes(): side for q, side in zip(choice.q, choice.approach, strict=True)}
    visits = [v for d in drives for v in d.visits if v.role == "calibrate" and v.q.tobytes() in wanted]
    sides = [(wanted[v.q.tobytes()], np.array(v.approach)) for v in visits]
    return sum(bool(((want != 0) & (want != is_)).any()) for want, is_ in sides)


def _samples_at_rest(cell: Cell, drive: Drive) -> tuple[Samples, ...]:
    """Every visit in the middle of its reading."""
    at, visits = _measured_waypoints(drive), [v for v in drive.visits if v.role in MEASURED]
    t = drive.trajectory.waypoint_time[at] + cell.seconds_until_read
    approach = np.array([v.approach for v in visits], dtype=float)
    q = np.array([v.q for v in visits])
    return (replace(Samples.at(q, drive.mounting), t=t, direction=approach),)


def _samples_in_passing(drive: Drive) -> tuple[Samples, ...]:
    """Every visit in passing, for each way driven."""
    ways: dict[int, list[int]] = {}
    for k in _measured_waypoints(drive):
        ways.setdefault(int(drive.course.measuring.visit[k]), []).append(int(k))
    count = min(len(way) for way in ways.values())
    return tuple(_sample_passage(drive, np.array([way[j] for way in ways.values()])) for j in range(count))


def _sample_passage(drive: Drive, at: np.ndarray) -> Samples:
    t: Array = drive.trajectory.waypoint_time[at]
    # 0.05: [s] along the path in which reversals are looked for
    motion, whole = drive.trajectory.at(t), drive.trajectory.sample(0.05)
    turned = last_reversals(whole.q)[np.minimum(np.searchsorted(whole.t, t), len(whole.t) - 1)]
    return replace(Samples.at(motion.q, drive.mounting), t=t, speed=motion.dq, reversals=turned)


def _measured_waypoints(drive: Drive) -> np.ndarray:
    """Waypoints of the measuring path that are visits which count."""
    ids = [v.id for v in drive.visits if v.role in MEASURED]
    return np.flatnonzero(np.isin(drive.course.measuring.visit, ids))
