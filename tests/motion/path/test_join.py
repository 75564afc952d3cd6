"""Joined paths keep every constraint at every densely sampled state, judged by modules that the search does not use."""

import hashlib
from itertools import pairwise

import numpy as np
import pytest

from planner.cell.workspace import Workspace
from planner.common.units import Array, round_angles
from planner.motion.collision.engines import CollisionWorld
from planner.motion.collision.fcl_world import FclWorld
from planner.motion.path.connection import connect_poses
from planner.motion.path.constraints import Constraints
from planner.motion.path.parts import connected_parts
from planner.motion.path.proof import Prover
from planner.motion.path.verdict import PathGaps, ProvenPath, judge_path
from tests.motion.path.poses import cell_and_world, dense, valid_poses

COUNT = 12


def constraints() -> Constraints:
    cell, world = cell_and_world()
    return Constraints(cell, scene=world.scene)


@pytest.fixture(scope="module")
def labelled() -> tuple[Array, np.ndarray]:
    q = valid_poses(700)
    return q, connected_parts(constraints(), q)


@pytest.fixture(scope="module")
def tour(labelled: tuple[Array, np.ndarray]) -> tuple[Array, list[int], Array]:
    """Poses of the largest part in no good order, so that many legs need a detour; and the rest as a pool."""
    q, part = labelled
    q = q[part == 0]
    return q[:COUNT], [*range(COUNT), 0], q[COUNT:]


@pytest.fixture(scope="module")
def path(tour: tuple[Array, list[int], Array]) -> ProvenPath:
    q, order, pool = tour
    found = connect_poses(constraints(), q, order, seed=4, pool=pool)
    assert isinstance(found, ProvenPath)
    return found


def digest(path: ProvenPath) -> str:
    return hashlib.sha256(path.q.tobytes() + path.node.tobytes()).hexdigest()


@pytest.mark.slow
def test_path_visits_the_poses_in_order_over_its_legs(path: ProvenPath, tour: tuple[Array, list[int], Array]) -> None:
    q, order, _ = tour
    assert path.node[path.node >= 0].tolist() == order
    np.testing.assert_array_equal(path.q[path.node >= 0], round_angles(q[order]))
    assert [(leg.start, leg.end) for leg in path.legs] == list(pairwise(order))
    np.testing.assert_array_equal(np.concatenate([leg.supports for leg in path.legs]), path.q[path.node < 0])
    assert len(path.legs) == len(order) - 1
    assert sum(not leg.direct for leg in path.legs) >= 3
    assert not path.q.flags.writeable


@pytest.mark.slow
def test_path_holds_when_sampled_densely(path: ProvenPath) -> None:
    cell, world = cell_and_world()
    sampled = dense(path.q[:-1], path.q[1:], 150)
    assert (Workspace(cell).margins(sampled) > 0.0).all()
    assert not world.collides(sampled).any()
    distance = FclWorld(world.scene).distances(sampled[::20])
    assert distance.min() > cell.motion.clearance
    assert path.clearance <= distance.min() + 5e-4
    length = np.linalg.norm(cell.map_position(sampled) - cell.fixtures[0].p_BX, axis=1)
    assert abs(path.length_min - length.min()) < 6e-4
    assert abs(path.length_max - length.max()) < 6e-4
    assert path.clear


@pytest.mark.slow
def test_direct_legs_are_those_whose_straight_motion_is_proven(path: ProvenPath) -> None:
    q = path.q[path.node >= 0]
    np.testing.assert_array_equal(constraints().prove(q[:-1], q[1:]).proven, [leg.direct for leg in path.legs])


@pytest.mark.slow
def test_detours_are_short_and_have_few_supports(path: ProvenPath) -> None:
    cell, _ = cell_and_world()
    seconds = (np.abs(np.diff(path.q, axis=0)) / cell.robot.speed).max(axis=1).sum()
    straight = (np.abs(np.diff(path.q[path.node >= 0], axis=0)) / cell.robot.speed).max(axis=1).sum()
    assert seconds < 1.8 * straight
    assert np.mean([len(leg.supports) for leg in path.legs if not leg.direct]) < 4.0


@pytest.mark.slow
def test_detours_are_quick_by_the_limits_that_hold_while_the_bar_is_attached(
    path: ProvenPath, tour: tuple[Array, list[int], Array]
) -> None:
    class BySlowestAxis(Constraints):
        def driven_times(self, q_from: Array, q_to: Array) -> Array:
            return np.asarray((np.abs(q_to - q_from) / self.cell.robot.speed).max(axis=1))

        def with_room(self, room: float) -> Constraints:
            return BySlowestAxis(self.cell, self.workspace.mounting, scene=self.scene, room=room)

    def seconds(found: ProvenPath) -> float:
        x = cell.map_position(dense(found.q[:-1], found.q[1:], 60)).reshape(-1, 61, 3)
        travel = np.linalg.norm(np.diff(x, axis=1), axis=2) / cell.motion.tool_speed
        change = np.abs(np.diff(np.linalg.norm(x - cell.fixtures[0].p_BX, axis=2), axis=1)) / cell.gauge.rate
        return float(np.maximum(travel, change).sum())

    cell, world = cell_and_world()
    q, order, pool = tour
    other = connect_poses(BySlowestAxis(cell, scene=world.scene), q, order, seed=4, pool=pool)
    assert isinstance(other, ProvenPath)
    assert [leg.direct for leg in path.legs] == [leg.direct for leg in other.legs]
    assert seconds(path) < 0.95 * seconds(other)


@pytest.mark.slow
def test_same_seed_same_path(path: ProvenPath, tour: tuple[Array, list[int], Array]) -> None:
    q, order, pool = tour
    again = connect_poses(constraints(), q, order, seed=4, pool=pool)
    assert isinstance(again, ProvenPath)
    assert digest(again) == digest(path)


@pytest.mark.slow
@pytest.mark.parametrize("first", [False, pytest.param(True, marks=pytest.mark.long)])
def test_poses_of_another_part_are_reported(labelled: tuple[Array, np.ndarray], first: bool) -> None:
    q, part = labelled
    main, other = q[part == 0], q[part == 1]
    nodes = np.vstack([main[:3], other[:1]])[:: -1 if first else 1]
    pool = np.vstack([main[3:150], other[1:]])
    found = connect_poses(constraints(), nodes, [0, 1, 2, 3, 0] if first else [0, 1, 3, 2, 0], seed=1, pool=pool)
    assert isinstance(found, PathGaps)
    assert found.unreachable == ((0,) if first else (3,))
    if not first:
        assert set(found.failed) == {(1, 3), (2, 3)}
        assert len(found.reasons) == 2


@pytest.mark.slow
def test_pose_that_breaks_a_constraint_cannot_be_reached(tour: tuple[Array, list[int], Array]) -> None:
    q, _, pool = tour
    broken = q[:4].copy()
    broken[2, 0] += 1.5
    found = connect_poses(constraints(), broken, [0, 1, 2, 3], seed=1, pool=pool)
    assert isinstance(found, PathGaps)
    assert found.unreachable == (2,)


@pytest.mark.slow
def test_leg_through_the_fixture_stand_goes_round_it() -> None:
    cell, world = cell_and_world()
    free, q = Constraints(cell, bar=False, scene=world.scene), valid_poses(700)
    legs = np.concatenate([np.column_stack([np.arange(step, 700), np.arange(700 - step)]) for step in range(1, 5)])
    proof = free.prove(*q[legs.T])
    through = [leg for k, leg in enumerate(legs) if "fixture stand" in (free.failure(proof, k) or "")][:4]
    assert len(through) == 4
    used = np.concatenate(through)
    found = connect_poses(free, q[used], [*range(8)], seed=2, pool=np.delete(q, used, axis=0))
    assert isinstance(found, ProvenPath)
    assert found.clear
    assert not any(leg.direct for leg in found.legs[::2])
    distance = FclWorld(free.scene).distances(dense(found.q[:-1], found.q[1:], 30))
    assert distance.min() > cell.motion.clearance


@pytest.mark.slow
def test_both_judges_refuse_a_path_that_collides(path: ProvenPath) -> None:
    free = constraints()
    straight = path.q[path.node >= 0]
    first, second = judge_path(free, straight)
    assert not first.clear
    assert not second.clear
    assert len(first.failures) == sum(not leg.direct for leg in path.legs)
    assert first.failures[0].startswith("motion ")


@pytest.mark.slow
def test_blends_are_judged_with_the_path(path: ProvenPath) -> None:
    free = constraints()
    corner = path.q[1:2]
    wild = np.stack([corner, corner + 1.0, corner - 1.0], axis=1)
    verdict, _ = judge_path(free, path.q, wild)
    assert [f[:7] for f in verdict.failures] == ["blend 1"]


@pytest.mark.slow
def test_travel_without_the_bar(labelled: tuple[Array, np.ndarray]) -> None:
    cell, world = cell_and_world()
    q, _ = labelled
    free = Constraints(cell, bar=False, scene=world.scene)
    found = connect_poses(free, np.vstack([cell.home, q[:3]]), [0, 1, 2, 3, 0], seed=0)
    assert isinstance(found, ProvenPath)
    assert found.clear
    sampled = dense(found.q[:-1], found.q[1:], 200)
    assert (Workspace(cell, bar=False).margins(sampled) > 0.0).all()
    assert not CollisionWorld(world.scene.without_bar()).collides(sampled).any()


@pytest.mark.slow
def test_repeated_and_duplicate_poses(tour: tuple[Array, list[int], Array]) -> None:
    q, _, pool = tour
    nodes = np.vstack([q[:3], q[1:2]])
    found = connect_poses(constraints(), nodes, [0, 1, 3, 1, 2, 0], seed=0, pool=np.vstack([pool, nodes]))
    assert isinstance(found, ProvenPath)
    assert found.node[found.node >= 0].tolist() == [0, 1, 3, 1, 2, 0]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["kuka-kr6-r700/edbb", pytest.param("ur10/edbb", marks=pytest.mark.long)])
def test_both_judges_release_the_path_of_other_robots(name: str) -> None:
    cell, world = cell_and_world(name)
    other, q = Constraints(cell, scene=world.scene), valid_poses(500, name)
    q = q[connected_parts(other, q) == 0]
    found = connect_poses(other, q[:8], [*range(8), 0], seed=0, pool=q[8:])
    assert isinstance(found, ProvenPath)
    assert found.clear, found.second.failures
    assert not world.collides(dense(found.q[:-1], found.q[1:], 200)).any()


class Strict:
    """Fcl's distances, but none left within ``reach`` [rad] of a state: a judge that sees more than coal does."""

    def __init__(self, judge: FclWorld, state: Array, reach: float) -> None:
        self.judge, self.state, self.reach = judge, state, reach

    def pair_distances(self, q: Array, rows: np.ndarray, columns: np.ndarray, enough: Array | None = None) -> Array:
        """Distances as fcl gives them, shortened near the state."""
        out = self.judge.pair_distances(q, rows, columns)
        out[np.abs(q[rows] - self.state).max(axis=1) <= self.reach] -= 1.0
        return out


def judged_strictly(state: Array, reach: float, monkeypatch: pytest.MonkeyPatch) -> Constraints:
    free = constraints()
    strict = Prover(free.bounds, free.pairs, Strict(FclWorld(free.scene), state, reach), free.clearance)
    monkeypatch.setitem(free.__dict__, "_judge", strict)
    return free


@pytest.mark.slow
def test_a_leg_that_the_second_judge_does_not_prove_is_led_round(
    path: ProvenPath, tour: tuple[Array, list[int], Array], monkeypatch: pytest.MonkeyPatch
) -> None:
    q, order, pool = tour
    straight = next(leg for leg in path.legs if leg.direct)
    free = judged_strictly((q[straight.start] + q[straight.end]) / 2, 1e-3, monkeypatch)
    assert len(judge_path(free, path.q)[1].unproven) == 1
    found = connect_poses(free, q, order, seed=4, pool=pool)
    assert isinstance(found, ProvenPath), found.reasons
    assert found.clear
    again = next(leg for leg in found.legs if (leg.start, leg.end) == (straight.start, straight.end))
    assert not again.direct
    assert all(v.clear for v in judge_path(constraints(), found.q))


@pytest.mark.slow
def test_legs_that_no_detour_makes_right_for_the_second_judge_are_named(
    path: ProvenPath, tour: tuple[Array, list[int], Array], monkeypatch: pytest.MonkeyPatch
) -> None:
    """All about one pose is what it refuses: the legs to it come back, with the judge's words."""
    q, order, pool = tour
    free = judged_strictly(q[3], 0.3, monkeypatch)
    refused = judge_path(free, path.q)[1]
    assert 0 < len(refused.unproven) == len(refused.failures)
    found = connect_poses(free, q, order, seed=4, pool=pool)
    assert isinstance(found, PathGaps)
    assert found.unreachable == ()
    assert set(found.failed) >= {(2, 3), (3, 4)}
    assert len(found.reasons) == len(found.failed) < 10
    assert all("python-fcl does not prove motion" in reason for reason in found.reasons)
