"""What a finished plan tells apart: its visits in the order, and from the sides, in which the tour comes to them."""

from dataclasses import replace

import numpy as np

from planner.cell import Cell
from planner.choice import Choice
from planner.observability import RULES
from planner.plan import Drive, is_continuous
from planner.rig import rig_of
from planner.run import Samples
from planner.run.reversals import reversals
from planner.separating import UNSURE, Separated, Separation, scarce
from planner.units import Array

STEP = 0.05  # [s] along the path in which reversals are looked for
MEASURED = ("calibrate", "repeat")
MUCH = 1.5  # times worse that the index may be before a person is told


def separation_driven(cell: Cell, parted: Separated, drives: tuple[Drive, ...]) -> Separation:
    """Return how surely the plan tells findings from rivals, as it is driven."""
    parts = [_moving(cell, d) if is_continuous(cell) else _resting(cell, d) for d in drives]
    ways = min(len(p) for p in parts)
    return parted.as_driven(tuple(_joined([p[k] for p in parts]) for k in range(ways)))


def separation_notes(
    cell: Cell, separation: Separation | None, choice: Choice, drives: tuple[Drive, ...]
) -> tuple[str, ...]:
    """Return what a person should know of it."""
    if separation is None:
        return ()
    missed, few = _missed(choice, drives), _few(cell, choice, drives)
    sides = (f"{missed} of {len(choice.q)} poses cannot be come to from the side that was wanted",) if missed else ()
    unsure = (
        f"{t.finding} and {t.rival} are told apart with a power of {t.sureness} only; what would help: "
        + "; or ".join(("more --poses", *t.help))
        for t in separation.told
        if t.power < UNSURE and t.named
    )
    return (
        *(f"not told apart: {s}" for s in separation.inseparable),
        *unsure,
        *sides,
        *few,
        *_blunter(separation, choice),
    )


def _blunter(separation: Separation, choice: Choice) -> tuple[str, ...]:
    """Tell that poses which tell effects apart see the robot's own parameters much worse."""
    times = 1.0 + RULES[choice.index].gap(choice.value, separation.alone)
    if times < MUCH:
        return ()
    return (
        f"these poses see the robot's own parameters {times:.1f} times worse than poses chosen by {choice.index} alone "
        f"({choice.index} {choice.value:.4g} instead of {separation.alone:.4g}): identify their run together with the "
        "one before",
    )


def _few(cell: Cell, choice: Choice, drives: tuple[Drive, ...]) -> tuple[str, ...]:
    """Tell that a run at rest has too few readings to be traced."""
    visits = sum(v.role in MEASURED for d in drives for v in d.visits)
    said = None if is_continuous(cell) else scarce(visits * choice.model.width, choice.seen.rank)
    return () if said is None else (said,)


def _missed(choice: Choice, drives: tuple[Drive, ...]) -> int:
    """Number of chosen poses that are come to from another side than wanted."""
    if choice.approach is None:
        return 0
    wanted = {q.tobytes(): side for q, side in zip(choice.q, choice.approach, strict=True)}
    visits = [v for d in drives for v in d.visits if v.role == "calibrate" and v.q.tobytes() in wanted]
    sides = [(wanted[v.q.tobytes()], np.array(v.approach)) for v in visits]
    return sum(bool(((want != 0) & (want != is_)).any()) for want, is_ in sides)


def _resting(cell: Cell, drive: Drive) -> tuple[Samples, ...]:
    """Every visit in the middle of its dwell."""
    at, visits = _at(drive), [v for v in drive.visits if v.role in MEASURED]
    t = drive.trajectory.waypoint_time[at] + cell.motion.settle + cell.motion.dwell / 2
    approach = np.array([v.approach for v in visits], dtype=float)
    q = np.array([v.q for v in visits])
    return (replace(rig_of(cell).visits(q, drive.fixture), t=t, direction=approach),)


def _moving(cell: Cell, drive: Drive) -> tuple[Samples, ...]:
    """Every visit in passing, for each way driven."""
    ways: dict[int, list[int]] = {}
    for k in _at(drive):
        ways.setdefault(int(drive.course.measuring.visit[k]), []).append(int(k))
    count = min(len(way) for way in ways.values())
    return tuple(_passed(cell, drive, np.array([way[j] for way in ways.values()])) for j in range(count))


def _passed(cell: Cell, drive: Drive, at: np.ndarray) -> Samples:
    t: Array = drive.trajectory.waypoint_time[at]
    motion, whole = drive.trajectory.at(t), drive.trajectory.sample(STEP)
    turned = reversals(whole.q)[np.minimum(np.searchsorted(whole.t, t), len(whole.t) - 1)]
    return replace(rig_of(cell).visits(motion.q, drive.fixture), t=t, speed=motion.dq, reversals=turned)


def _at(drive: Drive) -> np.ndarray:
    """Waypoints of the measuring path that are visits which count."""
    ids = [v.id for v in drive.visits if v.role in MEASURED]
    return np.flatnonzero(np.isin(drive.course.measuring.visit, ids))


def _joined(parts: list[Samples]) -> Samples:
    """The samples of every fixture, one after the other."""
    first = parts[0]
    names = ("q", "place", "point", "t", "direction", "speed", "reversals")
    columns = [k for k in names if getattr(first, k) is not None]
    return Samples(**{k: np.concatenate([getattr(p, k) for p in parts]) for k in columns})
