"""How many fixtures it takes, and what else would show what stays unseen with any number of them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.cell.cell import Cell
from planner.common.units import Array, read_only
from planner.design.fixtures.places import move_fixture, reach_poses
from planner.design.observability.identifiability import DroppedParameter, Identifiability, find_identifiable
from planner.design.observability.information import find_rule, r_factor
from planner.model.model import Model
from planner.runs.run import Samples
from planner.studies.fixture_places import CANDIDATES, FixtureMap, FixturePlace

GAUGE = ("fixture_", "map_", "zero")


@dataclass(frozen=True)
class FixtureStep:
    """What a number of fixtures sees.

    Attributes:
        fixtures: how many; ``place`` (3,) [m] of the last one.
        parameters, seen: of all, each fixture's own place included; ``robot_seen`` of the robot's own.
        becomes: names that one fixture fewer could not tell apart; ``dropped`` what is still unseen, and why.
        value: index of the robot's own parameters that one fixture sees, all others unknown, for as many poses as
            the plan takes, spread evenly over the fixtures and over their candidates.
    """

    fixtures: int
    place: Array
    parameters: int
    seen: int
    robot_seen: int
    becomes: tuple[str, ...]
    dropped: tuple[DroppedParameter, ...]
    value: float


@dataclass(frozen=True)
class UnseenRemedy:
    """Something other than a further fixture: what it makes visible of the unseen, and what stays unseen, and why."""

    name: str
    shows: tuple[str, ...]
    dropped: tuple[DroppedParameter, ...]


@dataclass(frozen=True)
class FixtureCount:
    """Fixtures one by one, and the remedies in the order of their effort; ``never`` is what none of them shows."""

    steps: tuple[FixtureStep, ...]
    remedies: tuple[UnseenRemedy, ...]

    @property
    def fewest_fixtures(self) -> int:
        """The fewest fixtures that see as many of the robot's parameters as any number that was tried."""
        return next(s.fixtures for s in self.steps if s.robot_seen == self.steps[-1].robot_seen)

    @property
    def lost_parameters(self) -> tuple[DroppedParameter, ...]:
        """The parameters that stay unseen with any number of fixtures and with any remedy."""
        left = [{d.name for d in r.dropped} for r in self.remedies] + [{d.name for d in self.steps[-1].dropped}]
        last = self.remedies[-1].dropped if self.remedies else self.steps[-1].dropped
        return tuple(d for d in last if all(d.name in names for names in left))

    def find_remedy(self, name: str) -> UnseenRemedy | None:
        """Return the least effort that shows a parameter."""
        return next((r for r in self.remedies if name in r.shows), None)


@dataclass(frozen=True)
class CombinedReadings:
    """Readings from several places, as far as they decide what is seen.

    Attributes:
        rows: (n, 1, P), whose mean square is that of a reading.
        names, prior: of the parameters, (P,).
        noise: of a reading [m].
        sources: how many places' candidates they stand for.
    """

    rows: Array
    names: tuple[str, ...]
    prior: Array
    noise: float
    sources: int

    @cached_property
    def identifiability(self) -> Identifiability:
        """Which parameters they tell apart."""
        order, count = range(len(self.names)), self.sources * CANDIDATES
        return find_identifiable(self.rows, self.names, self.prior, order, self.noise, count)

    def newly_seen_parameters(self, unseen: Sequence[DroppedParameter]) -> tuple[str, ...]:
        """Return the names of ``unseen`` parameters that these readings show."""
        return tuple(d.name for d in unseen if d.name in self.identifiability.names)

    def drop_parameters(self, *prefixes: str) -> "CombinedReadings":
        """Return the readings without the parameters named by one of ``prefixes``, which were measured."""
        left = [k for k, n in enumerate(self.names) if not n.startswith(prefixes)]
        names = tuple(self.names[k] for k in left)
        return replace(self, rows=self.rows[:, :, left], names=names, prior=self.prior[left])


def count_fixtures(cell: Cell, map_: FixtureMap, noise: float, seed: int) -> FixtureCount:
    """Add fixtures one by one, each where it shows most, then where it betters the index most.

    Args:
        cell: the cell; its first fixture stays where it is.
        map_: the places that further fixtures may take.
        noise: of a reading [m].
        seed: of the candidates of the imagined second tool point.
    """
    rule = find_rule(map_.index)

    def step(places: list[FixturePlace], before: Sequence[DroppedParameter] = ()) -> FixtureStep:
        """Return the step with fixtures at these places."""
        return _make_step(map_, places, combine_places(map_, places, noise), before)

    def merit(places: list[FixturePlace]) -> tuple[int, float]:
        """Return the merit of fixtures at these places: first the number of parameters seen, then the index."""
        tried = step(places)
        return tried.robot_seen, rule.merit(tried.value)

    places = [map_.present]
    steps = [step(places)]
    while len(places) < 3:  # fixtures that are tried
        tried = [[*places, p] for p in map_.usable_places if all(p is not q for q in places)]
        if not tried:
            break
        places = max(tried, key=merit)
        steps.append(step(places, steps[-1].dropped))
    return FixtureCount(tuple(steps), _find_remedies(cell, map_, places, steps[0].dropped, noise, seed))


def combine_places(map_: FixtureMap, places: Sequence[FixturePlace], noise: float) -> CombinedReadings:
    """Return the readings of a measurement with one fixture at each of ``places``.

    Robot, tool and zero are common to all; each fixture has its own place as parameters where that is free.
    """
    own = [k for k, name in enumerate(map_.names) if name.startswith("fixture_")]
    common = [k for k in range(len(map_.names)) if k not in own]
    count, size = len(places), len(map_.names)
    rows = np.zeros((count, size, count * len(own) + len(common)))
    for k, place in enumerate(places):
        assert place.information is not None
        factor = place.information * np.sqrt(size)  # so that the rows' mean square stays that of a reading
        rows[k][:, k * len(own) : (k + 1) * len(own)] = factor[:, own]
        rows[k][:, count * len(own) :] = factor[:, common]
    further = [f"fixture_{k + 1}_{map_.names[j][-1]}" for k in range(1, count) for j in own]
    names = (*(map_.names[j] for j in own), *further, *(map_.names[k] for k in common))
    prior = np.concatenate([*[map_.prior[own]] * count, map_.prior[common]])
    return CombinedReadings(rows.reshape(count * size, 1, -1), names, prior, noise, count)


def _robot_names(names: Sequence[str]) -> list[str]:
    return [n for n in names if not n.startswith(GAUGE)]


def _make_step(
    map_: FixtureMap, places: list[FixturePlace], readings: CombinedReadings, before: Sequence[DroppedParameter]
) -> FixtureStep:
    seen = readings.identifiability
    return FixtureStep(
        fixtures=len(places),
        place=places[-1].p_BX,
        parameters=len(readings.names),
        seen=seen.rank,
        robot_seen=len(_robot_names(seen.names)),
        becomes=readings.newly_seen_parameters(before),
        dropped=seen.dropped,
        value=_robot_index(map_, readings),
    )


def _robot_index(map_: FixtureMap, readings: CombinedReadings) -> float:
    """Index of the robot's parameters that the present fixture alone sees, the gauge's eliminated by QR."""
    rule, names, kept = find_rule(map_.index), readings.names, readings.identifiability.kept
    wanted = set(_robot_names([map_.names[k] for k in map_.kept]))
    robot = [k for k in kept if names[k] in wanted]
    if len(robot) < len(wanted):
        return 0.0 if rule.maximise else float("inf")
    gauge = [k for k in kept if names[k] not in wanted]
    factor = r_factor(readings.rows[:, :, [*gauge, *robot]] / np.sqrt(len(readings.rows)))
    own: Array = factor[len(gauge) :, len(gauge) :]
    mu = np.linalg.svd(own, compute_uv=False) * np.sqrt(map_.poses)
    return float(rule.of(mu, map_.poses))


def _find_remedies(
    cell: Cell,
    map_: FixtureMap,
    places: list[FixturePlace],
    unseen: Sequence[DroppedParameter],
    noise: float,
    seed: int,
) -> tuple[UnseenRemedy, ...]:
    """Measure one fixture's place, those of as few as show most, the tool point, all these; add a second tool point.

    One known point leaves the base free to turn about it; several known points hold it.
    """
    free = {prefix for prefix in ("fixture_", "map_") if any(n.startswith(prefix) for n in map_.names)}
    sets = [combine_places(map_, places[: k + 1], noise) for k in range(len(places))]
    one, all_ = sets[0], sets[-1]
    tried: list[tuple[str, Sequence[CombinedReadings], tuple[str, ...]]] = [
        ("the fixture's place measured", sets[:1], ("fixture_",)),
        *([("the places of {} fixtures measured", sets[1:], ("fixture_",))] if sets[1:] else []),
        ("the tool point measured", [one], ("map_",)),
        ("the tool point and the place of the fixture measured", sets[:1], ("fixture_", "map_")),
        *(
            [("the tool point and the places of {} fixtures measured", sets[1:], ("fixture_", "map_"))]
            * (len(sets) > 1)
        ),
    ]
    out = [_fewest_places(says, some, known, unseen) for says, some, known in tried if free.issuperset(known)]
    measured = all_.drop_parameters("fixture_", "map_")
    both = np.concatenate([measured.rows, _second_tool_rows(cell, map_, seed)])
    says = "all measured, and a second tool point" if free else "a second tool point, measured"
    out.append((says, replace(measured, rows=both, sources=len(places) + 1)))
    return tuple(
        UnseenRemedy(says, readings.newly_seen_parameters(unseen), readings.identifiability.dropped)
        for says, readings in out
    )


def _fewest_places(
    says: str, sets: Sequence[CombinedReadings], known: tuple[str, ...], unseen: Sequence[DroppedParameter]
) -> tuple[str, CombinedReadings]:
    """Return the first of ``sets`` of places that shows as much as the last, and what is said of it."""
    each = [readings.drop_parameters(*known) for readings in sets]
    shown = [len(readings.newly_seen_parameters(unseen)) for readings in each]
    first = each[shown.index(max(shown))]
    return says.format(first.sources), first


def _second_tool_rows(cell: Cell, map_: FixtureMap, seed: int) -> Array:
    """Rows (P, 1, p) of robot and zero for a tool point beside the present one."""
    tool = cell.tool
    across = np.cross(tool.axis_F, tool.p_FM)
    if np.linalg.norm(across) < 1e-6:
        across = np.cross(tool.axis_F, np.eye(3)[int(np.argmin(np.abs(tool.axis_F)))])
    # 0.1: [m] from the tool point to the second one that is imagined beside it
    point = read_only(tool.p_FM + 0.1 * across / np.linalg.norm(across))
    aside = replace(cell, tool=replace(tool, points=(replace(tool.points[0], p_FM=point),)))
    q = reach_poses(aside, map_.present.p_BX, CANDIDATES, seed).q
    if len(q) == 0:  # the rank is that of the geometry: any states will do
        q = np.random.default_rng(seed).uniform(
            cell.robot.q_lower, cell.robot.q_upper, (CANDIDATES, cell.robot.n_joints)
        )
    there = move_fixture(aside, map_.present.p_BX)
    model = Model.from_cell(there, cell.plan.free - {"fixture", "tool"})
    rows = model.rows(Samples.at(q))
    size = len(map_.names)
    factor = np.zeros((size, 1, len(model.names)))
    factor[: len(model.names), 0] = r_factor(rows) * np.sqrt(size / rows[..., 0].size)
    return factor
