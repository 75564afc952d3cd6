"""The two engines against each other, and both against a plain numeric minimisation."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from planner.cell.cell import Cell
from planner.cell.reading import load_cell
from planner.common.units import Array
from planner.motion.collision.engines import CollisionWorld
from planner.motion.collision.fcl_world import FclWorld, RoundBounds, ScreenedDistances
from tests.not_everywhere import fcl
from tests.workflow.test_lift import LIFT
from tests.workflow.test_unchecked_links import cell_of, whole_arm

CELLS = ["comau-nj130/edbb", "kuka-kr6-r700/edbb", "ur10/edbb"]


@cache
def world(name: str) -> CollisionWorld:
    return CollisionWorld.from_cell(load_cell(name))


@cache
def states(name: str, count: int) -> Array:
    robot = world(name).cell.robot
    low, high = np.maximum(robot.q_lower, -np.pi), np.minimum(robot.q_upper, np.pi)
    return np.random.default_rng(11).uniform(low, high, (count, robot.n_joints))


def round_pairs(w: CollisionWorld) -> np.ndarray:
    kinds = [p.body.kind in ("capsule", "sphere") for p in w.scene.pieces]
    return np.array([kinds[a] and kinds[b] for a, b in w.scene.pairs])


def two_boxes(w: CollisionWorld) -> list[int]:
    kinds = [p.body.kind for p in w.scene.pieces]
    return [k for k, (a, b) in enumerate(w.scene.pairs) if kinds[a] == kinds[b] == "box"]


def segments(w: CollisionWorld, q: Array) -> tuple[Array, Array]:
    """Ends of every capsule's segment in the base frame (n, pieces, 2, 3) and the radii, by single joint rotations."""
    cell, n = w.cell, len(q)
    frames = np.array([_link_frames(cell, row) for row in q])
    x = cell.map_position(q)
    d = (x - w.scene.p_BX) / np.linalg.norm(x - w.scene.p_BX, axis=1)[:, None]
    ends, radii = np.full((n, len(w.scene.pieces), 2, 3), np.nan), np.zeros(len(w.scene.pieces))
    for k, piece in enumerate(w.scene.pieces):
        if piece.body.kind != "capsule":
            continue
        radii[k] = piece.body.size[0]
        for e, s in enumerate((-0.5, 0.5)):
            p = piece.body.T[:3, 3] + s * piece.body.size[1] * piece.body.T[:3, 2]
            if piece.of_bar:  # along z of the bar only
                ends[:, k, e] = (w.scene.p_BX if piece.carrier == "housing" else x) + p[2] * d
            elif piece.carrier == "world":
                ends[:, k, e] = p
            else:
                T = frames[:, piece.link]
                ends[:, k, e] = T[:, :3, :3] @ p + T[:, :3, 3]
    return ends, radii


def _link_frames(cell: Cell, q: Array) -> list[Array]:
    """Pose of every link frame at one state, transform by transform with scipy's rotations."""
    robot = cell.robot
    theta, T, out = robot.coupling_matrix @ q + robot.theta_zero, np.eye(4), []
    for k in range(len(robot.transforms) + 1):
        out += [T.copy() for end in robot.link_end if end == k]
        if k == len(robot.transforms):
            break
        t = robot.transforms[k]
        value = t.nominal + (0.0 if t.joint is None else theta[t.joint])
        step = np.eye(4)
        if t.kind == "translation":
            step[t.axis, 3] = value
        else:
            step[:3, :3] = Rotation.from_euler("xyz"[t.axis], value).as_matrix()
        T = T @ step
    return out


def closest(a: Array, b: Array) -> float:
    """Distance of two segments (2, 3) by bounded minimisation from several starts."""

    def square(s: Array) -> float:
        return float(np.sum((a[0] + s[0] * (a[1] - a[0]) - b[0] - s[1] * (b[1] - b[0])) ** 2))

    starts = [(0.5, 0.5), (0.0, 1.0), (1.0, 0.0)]
    found = [minimize(square, s, bounds=[(0, 1), (0, 1)], tol=1e-14) for s in starts]
    return float(np.sqrt(min(f.fun for f in found)))


@pytest.mark.parametrize("name", CELLS)
def test_capsule_distances_are_those_of_numeric_minimisation(name: str) -> None:
    w, q = world(name), states(name, 6)
    ends, radii = segments(w, q)
    coal, fcl = w.distances(q), FclWorld(w.scene).distances(q)
    pairs = [k for k, (a, b) in enumerate(w.scene.pairs) if not np.isnan(ends[0, [a, b]]).any()]
    rng, compared = np.random.default_rng(0), 0
    for i in range(len(q)):
        for k in rng.choice(pairs, 12, replace=False):
            a, b = w.scene.pairs[k]
            wanted = closest(ends[i, a], ends[i, b]) - radii[a] - radii[b]
            if wanted > 0.0:
                assert abs(coal[i, k] - wanted) < 2e-6, w.scene.pair_name(k)
                assert abs(fcl[i, k] - wanted) < 2e-6, w.scene.pair_name(k)
                compared += 1
            else:
                assert coal[i, k] <= 0.0
                assert fcl[i, k] <= 0.0
    assert compared > 30


@pytest.mark.slow
@pytest.mark.parametrize("name", CELLS)
def test_engines_agree_on_random_states(name: str) -> None:
    w, q = world(name), states(name, 500)
    coal, fcl = w.distances(q), FclWorld(w.scene).distances(q)
    clear = np.abs(coal) > 1e-5
    np.testing.assert_array_equal((coal > 0.0)[clear], (fcl > 0.0)[clear])
    round_ = np.broadcast_to(round_pairs(w), coal.shape) & (coal > 0.0)
    assert np.abs(coal - fcl)[round_].max() < 5e-6


@pytest.mark.slow
@pytest.mark.parametrize("name", CELLS)
def test_safe_distances_of_fcl_never_exceed_those_of_coal(name: str) -> None:
    """Plain fcl distances do, for boxes: this is why the second judge grows a body before it believes them."""
    w, q = world(name), states(name, 500)
    coal, safe = w.distances(q), FclWorld(w.scene).distances(q)
    apart = coal > 2e-5
    assert (safe - coal)[apart].max() < 2e-6
    assert (safe[apart] > 0.0).all()
    assert (safe[coal < -1e-5] <= 0.0).all()
    with_box = ~np.broadcast_to(round_pairs(w), coal.shape) & apart & (coal < 0.05)
    with_box &= ~np.isin(np.arange(coal.shape[1]), two_boxes(w))  # a box grows by more than the distance at its corners
    assert (safe > coal * (1 - 2e-3) - 2e-4)[with_box].mean() > 0.999


@pytest.mark.parametrize("name", CELLS)
def test_where_a_bound_will_do_the_second_judge_still_finds_the_nearest_pair(name: str) -> None:
    w, q = world(name), states(name, 200)
    judge, enough = FclWorld(w.scene), np.full((200, len(w.scene.pairs)), 0.05)
    whole, some = judge.distances(q), judge.distances(q, enough=enough)
    np.testing.assert_allclose(some.min(axis=1), whole.min(axis=1), atol=1e-12)
    less = some < whole - 1e-9
    assert less.any()
    assert (some[less] > 0.05).all()
    assert (some <= w.distances(q) + 1e-5)[whole > 0.0].all()


def test_a_distance_of_fcl_that_is_too_large_is_not_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    w, q = world(CELLS[0]), states(CELLS[0], 60)
    coal, ask = w.distances(q), fcl.distance
    solids = np.broadcast_to(~round_pairs(w), coal.shape) & (coal > 1e-4)
    monkeypatch.setattr(fcl, "distance", lambda *args: ask(*args) + 0.1)
    assert (FclWorld(w.scene).distances(q) - coal)[solids].max() < 2e-5


@pytest.mark.parametrize("name", CELLS)
@pytest.mark.parametrize("clearance", [0.0, 0.005, 0.01])
def test_bulk_answers_are_those_of_the_distances(name: str, clearance: float) -> None:
    w, q = world(name), states(name, 400)
    nearest = w.distances(q).min(axis=1)
    sure = np.abs(nearest - clearance) > 1e-5
    assert 0.02 < (nearest < clearance).mean() < 0.999
    np.testing.assert_array_equal(w.collides(q, clearance)[sure], (nearest < clearance)[sure])
    np.testing.assert_array_equal(CollisionWorld(w.scene).find_near(q, clearance)[sure], (nearest < clearance)[sure])


def test_pairs_that_were_not_asked_for_stay_unknown() -> None:
    w, q = world(CELLS[0]), states(CELLS[0], 40)
    mask = np.random.default_rng(0).random((40, len(w.scene.pairs))) < 0.3
    for engine in (CollisionWorld(w.scene), FclWorld(w.scene)):
        found = engine.distances(q, mask)
        assert np.isinf(found[~mask]).all()
        assert np.isfinite(found[mask]).all()
        whole = engine.distances(q, np.ones_like(mask))
        np.testing.assert_allclose(found[mask], whole[mask], atol=1e-9)


@pytest.mark.parametrize("name", CELLS)
def test_closed_forms_are_coals_distances_and_bounds_never_exceed_them(name: str) -> None:
    w, q = world(name), states(name, 300)
    coal, bounds = w.distances(q), RoundBounds(w.scene)
    closed = bounds.distances(q, *np.nonzero(np.ones(coal.shape, dtype=bool))).reshape(coal.shape)
    apart = coal > 0.0
    assert np.abs(closed - coal)[apart & bounds.exact].max() < 1e-9
    assert (closed - coal)[apart].max() < 1e-9
    assert (closed[~apart] <= 1e-9).all()
    enough = np.random.default_rng(1).uniform(0.0, 0.5, coal.shape)
    screened = ScreenedDistances(w).distances(q, None, enough)
    np.testing.assert_array_equal((screened >= enough)[apart], (coal >= enough)[apart])


def test_bar_spans_from_ball_to_ball() -> None:
    """Housing and rod together cover the bar but for the trim at both balls, at every length."""
    w = world(CELLS[0])
    gauge, q = w.cell.gauge, states(CELLS[0], 20_000)
    length = np.linalg.norm(w.cell.map_position(q) - w.scene.p_BX, axis=1)
    q = q[(length > gauge.length_min) & (length < gauge.length_max)]
    ends, radii = segments(w, q)
    housing, rod = (next(k for k, p in enumerate(w.scene.pieces) if p.carrier == c) for c in ("housing", "rod"))
    x_X, x = w.scene.p_BX, w.cell.map_position(q)
    d = (x - x_X) / np.linalg.norm(x - x_X, axis=1)[:, None]
    reach = [np.einsum("nei,ni->ne", ends[:, k] - x_X, d) for k in (housing, rod)]
    assert len(q) > 20
    np.testing.assert_allclose(reach[0].min(axis=1) - radii[housing], gauge.trim, atol=1e-9)
    np.testing.assert_allclose(
        np.linalg.norm(x - x_X, axis=1) - reach[1].max(axis=1) - radii[rod], gauge.trim, atol=1e-9
    )
    overlap = reach[0].max(axis=1) + radii[housing] - (reach[1].min(axis=1) - radii[rod])
    assert (overlap > -1e-9).all()
    assert (reach[1].min(axis=1) - radii[rod] > 0.0).all()


def test_a_box_that_a_lift_carries_moves_and_does_not_turn(tmp_path: Path) -> None:
    """Its orientation is one for all states, its place is not."""
    shape = '<collision><geometry><box size="0.3 0.2 0.1"/></geometry></collision>'
    text = whole_arm()
    assert '<link name="l0"/>' in text
    text = text.replace('<link name="l0"/>', f'<link name="l0">{shape}</link>')
    file = cell_of(tmp_path, text.replace("</robot>", LIFT + "</robot>"))
    changed = file.read_text().replace("home_deg", "home_mm = [200]\nhome_deg", 1)
    file.write_text(changed.replace("floor_mm = -100", "floor_mm = -600"))
    w = CollisionWorld.from_cell(load_cell(str(file)))
    robot = w.cell.robot
    assert robot.slides[0]
    q = np.random.default_rng(5).uniform(*robot.one_turn, (200, robot.n_joints))
    coal, bounds = w.distances(q), RoundBounds(w.scene)
    apart = coal > 1e-6
    assert any(p.body.kind == "box" and p.link == 1 for p in w.scene.pieces)
    closed = bounds.distances(q, *np.nonzero(np.ones(coal.shape, dtype=bool))).reshape(coal.shape)
    assert (closed - coal)[apart].max() < 1e-9
    assert np.abs(FclWorld(w.scene).distances(q) - coal)[apart].max() < 1e-4
