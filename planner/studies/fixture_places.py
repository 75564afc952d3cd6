"""The index over a grid of fixture places: level with the fixture, and in the upright plane through it and axis 1."""

from dataclasses import dataclass, replace

import numpy as np

from planner.cell.cell import Cell
from planner.common.errors import NoSolutionError
from planner.common.progress import Progress
from planner.common.units import Array, read_only
from planner.design.assumptions import STRUCTURAL_ZERO_SHARE
from planner.design.candidates.pool import PoseSet
from planner.design.fixtures.places import FixtureReach, GridPlace, Status, move_fixture, place_grid, reach_poses
from planner.design.observability.identifiability import find_identifiable
from planner.design.observability.information import find_rule, index_value, r_factor
from planner.design.selection.index_search import improve_poses
from planner.design.selection.pruning import prune_poses
from planner.model.model import Model
from planner.runs.run import FIRST_MOUNTING, Samples

CANDIDATES = 1000  # at each place: as many everywhere, so that the places compare


@dataclass(frozen=True)
class FixturePlace(GridPlace):
    """One place of the fixture, judged.

    Attributes:
        status: whether it can be used, and if not, why.
        candidates: how many poses it was judged by.
        rank: how many parameters are seen from there.
        value: index of the poses selected there, on the parameters seen from the present place; nan if unusable.
        information: triangular factor of all its rows, each divided by the root of their number, (P, P).
    """

    status: Status = "usable"
    candidates: int = 0
    rank: int = 0
    value: float = float("nan")
    information: Array | None = None


@dataclass(frozen=True)
class FixtureMap:
    """All places, the present one first.

    Attributes:
        index, poses: what was compared, and for how many poses.
        reach: how far out the tool point gets from axis 1 [m]; ``half`` (2,) half sizes of a grid cell [m].
        kept: columns of the model that are compared, those seen from the present place.
        names, prior: of all parameters of the model with one fixture.
    """

    index: str
    poses: int
    reach: float
    half: tuple[float, float]
    kept: tuple[int, ...]
    names: tuple[str, ...]
    prior: Array
    places: tuple[FixturePlace, ...]

    def ratio(self, place: FixturePlace) -> float:
        """Return the index at a place over that at the present one."""
        return place.value / self.present.value

    @property
    def present(self) -> FixturePlace:
        """Where the fixture stands now."""
        return self.places[0]

    @property
    def usable_places(self) -> tuple[FixturePlace, ...]:
        """Places with a value."""
        return tuple(p for p in self.places if p.status == "usable")

    @property
    def best_place(self) -> FixturePlace:
        """The usable place with the best index."""
        rule = find_rule(self.index)
        return max(self.usable_places, key=lambda p: rule.merit(p.value))


def map_fixture_places(
    cell: Cell, pool: PoseSet, index: str, poses: int, seed: int, say: Progress, across: int = 9, up: int = 6
) -> FixtureMap:
    """Judge a grid of places for the cell's first fixture, with ``poses`` poses selected for ``index`` at each.

    The arm is the same all round axis 1, so height and distance matter most: they are the upright grid. Places
    differ in what they see at all; they are compared on the parameters that the present place sees.

    Raises:
        NoSolutionError: the present place itself leaves too few candidates to be judged.
    """
    start = cell.fixtures[0].p_BX
    model = Model.from_cell(move_fixture(cell, start))
    here = _present_reach(cell, pool, seed)
    rows = model.rows(Samples.at(here.q))
    noise = float(np.median(model.noise(Samples.at(here.q))))
    kept = find_identifiable(rows, model.names, model.prior, range(len(model.names)), noise).kept
    poses = max(poses, len(kept))
    grid = place_grid(cell, across, up)
    out: list[FixturePlace] = []
    for place in grid.places:
        say("fixture places", len(out), len(grid.places))
        there = move_fixture(cell, place.p_BX)
        found = here if place.plane == "present" else reach_poses(cell, place.p_BX, CANDIDATES, seed)
        out.append(_judge_place(place, there, found, kept, index, poses))
    if out[0].status != "usable":
        raise NoSolutionError(
            f"fixture {cell.fixtures[0].name} leaves {len(here.q)} candidates for {len(kept)} parameters and {poses} "
            "poses, too few to compare it with other places: widen the cones, the cable's budget or the clearance"
        )
    return FixtureMap(index, poses, grid.reach, grid.half, kept, model.names, read_only(model.prior), tuple(out))


def _present_reach(cell: Cell, pool: PoseSet, seed: int) -> FixtureReach:
    """Drawn as at all other places; where that is meagre, the cell's own candidates."""
    here = reach_poses(cell, cell.fixtures[0].p_BX, CANDIDATES, seed)
    own = pool.q[pool.samples.at_mounting(FIRST_MOUNTING)][:CANDIDATES]
    return here if len(here.q) >= len(own) else FixtureReach(read_only(own), "usable")


def _judge_place(
    place: GridPlace, cell: Cell, found: FixtureReach, kept: tuple[int, ...], index: str, poses: int
) -> FixturePlace:
    count = len(found.q)
    judged = FixturePlace(**vars(place), candidates=count)
    # 3: candidates a parameter, below which a place is not judged
    if found.status != "usable" or count < max(poses, 3 * len(kept)):
        status: Status = "few" if found.status == "usable" else found.status
        return replace(judged, status=status)
    model = Model.from_cell(cell)
    samples = Samples.at(found.q)
    rows, noise = model.rows(samples), float(np.median(model.noise(samples)))
    rank = find_identifiable(rows, model.names, model.prior, range(len(model.names)), noise).rank
    own = np.ascontiguousarray(rows[:, :, list(kept)])
    mu = np.linalg.svd(r_factor(own * model.prior[list(kept)]), compute_uv=False)
    blind = mu[-1] <= STRUCTURAL_ZERO_SHARE * mu[0]
    factor = read_only(r_factor(rows) / np.sqrt(rows[..., 0].size))
    judged = replace(judged, rank=rank, information=factor)
    return replace(judged, status="blind") if blind else replace(judged, value=exchanged_index(own, index, poses))


def exchanged_index(rows: Array, index: str, poses: int) -> float:
    """Return the index of the poses that exchange leads to, from what pruning leaves of ``rows`` (n, r, p)."""
    # 200: candidates from which pruning takes one away at a time; before, a twelfth at once
    pruned = prune_poses(rows, poses, index, 200)
    return index_value(index, rows[improve_poses(rows, np.asarray(pruned), index)])
