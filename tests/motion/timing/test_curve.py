import numpy as np
import pytest
from scipy.interpolate import BPoly

from planner.motion.timing.curve import PathCurve, build_curve, check_request, closest_passages, round_corners
from planner.motion.tolerances import PACE_RATIO
from tests.motion.timing.arm import random_arm, random_tour

SEEDS = range(40)


def made(seed, kind=None):
    rng = np.random.default_rng(seed)
    arm = random_arm(rng)
    tour = random_tour(rng, len(arm.a), kind)
    request = check_request(**tour, n_joints=len(arm.a))
    corners = round_corners(request, arm.position, arm.speed)
    return arm, request, corners, build_curve(corners)


def test_a_blend_is_the_degree_seven_bezier_with_equally_spaced_points_on_both_legs():
    rng = np.random.default_rng(0)
    back, corner, forth = rng.normal(size=(3, 6))
    one = np.ones(1)
    zero = np.zeros(1, dtype=int)
    curve = PathCurve(0.0 * one, one, corner[None], back[None], forth[None], one, one, zero, np.ones(1, dtype=bool))
    share = 1.0 - 2.0 * np.arange(4) / 7.0  # of the way from the corner
    points = np.concatenate([corner - share[:, None] * back, corner + share[::-1, None] * forth])
    bezier = BPoly(points[:, None, :], [0.0, 1.0])
    s = np.linspace(0.0, 1.0, 101)
    for order, mine in enumerate(curve.derivatives(s)):
        assert np.allclose(mine, bezier.derivative(order)(s) if order else bezier(s), atol=1e-11)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_path_stays_in_the_triangles_and_on_the_legs(seed):
    _, _, corners, curve = made(seed)
    for k in range(len(curve.start)):
        q = curve.derivatives(curve.start[k] + curve.span[k] * np.linspace(0.0, 1.0 - 1e-12, 50))[0]
        i = curve.point[k]
        if curve.blend[k]:
            ends = corners.entry[i], corners.q[i], corners.exit[i]
        else:
            ends = corners.exit[i - 1], corners.exit[i - 1], corners.entry[i]
        # barycentric coordinates, from the edges that leave the middle corner
        edges = np.stack([ends[0] - ends[1], ends[2] - ends[1]], axis=1)
        weight = np.linalg.lstsq(edges, (q - ends[1]).T, rcond=1e-14)[0]
        size = np.linalg.norm(edges, axis=0).max()
        assert np.abs(edges @ weight - (q - ends[1]).T).max() <= 1e-9 * size + 1e-14
        if np.linalg.matrix_rank(edges, tol=1e-6 * size) == 2:
            assert weight.min() >= -1e-6
            assert weight.sum(axis=0).max() <= 1.0 + 1e-6
        else:  # a thin triangle: between its ends along it
            along = edges[:, np.argmax(np.linalg.norm(edges, axis=0))] / size
            reach = np.append(along @ edges, 0.0)
            assert ((q - ends[1]) @ along).min() >= reach.min() - 1e-9
            assert ((q - ends[1]) @ along).max() <= reach.max() + 1e-9


@pytest.mark.parametrize("seed", SEEDS)
def test_derivatives_agree_with_finite_differences(seed):
    _, _, _, curve = made(seed)
    rng = np.random.default_rng(seed)
    k = rng.integers(len(curve.start), size=40)
    h = 1e-4 * curve.span[k]
    s = curve.start[k] + curve.span[k] * rng.uniform(0.01, 0.99, len(k))
    here, after, before = curve.derivatives(s), curve.derivatives(s + h), curve.derivatives(s - h)
    for order in range(3):
        slope = (after[order] - before[order]) / (2.0 * h)[:, None]
        scale = np.abs(here[1]).max(axis=1) / curve.span[k] ** order
        assert np.all(
            np.abs(slope - here[order + 1]).max(axis=1) <= 1e-4 * scale + 1e-10 / curve.span[k] ** (order + 1)
        )


@pytest.mark.parametrize("seed", SEEDS)
def test_three_derivatives_are_continuous_from_piece_to_piece(seed):
    curve = made(seed)[3]
    inner = np.flatnonzero(curve.blend[1:] | curve.blend[:-1]) + 1  # joints that are no stops
    for k in inner:
        near = 1e-6 * min(curve.span[k - 1], curve.span[k])
        s = curve.start[k]
        left, right = curve.derivatives(np.array([s - near])), curve.derivatives(np.array([s + near]))
        speed = np.abs(right[1]).max()
        short = min(curve.span[k - 1], curve.span[k])
        assert np.abs(left[0] - right[0]).max() <= 4e-6 * speed * short + 1e-14
        for order in (1, 2, 3):
            gap = np.abs(left[order] - right[order]).max() * short ** (order - 1)
            assert gap <= 1e-2 * speed, f"derivative {order} jumps by {gap} at piece {k}"


@pytest.mark.parametrize("seed", SEEDS)
def test_blends_begin_where_the_tool_point_is_one_radius_away(seed):
    arm, request, corners, _ = made(seed)
    at = arm.position(corners.q)
    legs = np.diff(corners.q, axis=0)
    for node in np.flatnonzero(~corners.stop):
        radius = request.blend_m[corners.node == node].min()
        for end, leg in ((corners.entry, -legs[node - 1]), (corners.exit, legs[node])):
            share = (end[node] - corners.q[node]) @ leg / (leg @ leg)
            away = np.linalg.norm(arm.position(end[node : node + 1])[0] - at[node])
            assert 0.0 < share <= 0.5 + 1e-15 / np.linalg.norm(leg)
            full = np.isclose(away, radius, rtol=1e-6) or np.isclose(share, 0.5, rtol=1e-6)
            other = corners.exit if end is corners.entry else corners.entry
            pace = corners.pace[[node - 1, node]]
            even = np.linalg.norm(end[node] - corners.q[node]) / pace[int(end is corners.exit)]
            other_even = np.linalg.norm(other[node] - corners.q[node]) / pace[int(end is corners.entry)]
            assert away <= radius * (1.0 + 1e-6)
            assert full or np.isclose(even, PACE_RATIO * other_even, rtol=1e-6)
            before = corners.q[node] + np.linspace(0.0, share, 50)[:, None] * leg
            assert np.linalg.norm(arm.position(before) - at[node], axis=1).max() <= radius * (1.0 + 1e-3)


@pytest.mark.parametrize("seed", SEEDS)
def test_closest_passage_is_the_closest(seed):
    _, _, corners, curve = made(seed)
    passage = closest_passages(curve, len(corners.q))
    assert np.all(np.diff(passage) > 0.0)
    q = curve.derivatives(passage)[0]
    assert np.abs((q - corners.q)[corners.stop]).max() <= 1e-12
    for k in np.flatnonzero(curve.blend):
        i = curve.point[k]
        dense = curve.derivatives(curve.start[k] + curve.span[k] * np.linspace(0, 1, 2001))[0]
        nearest = np.linalg.norm(dense - corners.q[i], axis=1).min()
        assert np.linalg.norm(q[i] - corners.q[i]) <= nearest * (1.0 + 1e-9) + 1e-15


def test_reversals_and_corners_without_a_radius_become_stops():
    arm = random_arm(np.random.default_rng(1))
    q = np.zeros((5, len(arm.a)))
    q[:, 0] = [0.0, 0.5, 0.2, 0.6, 0.9]
    q[4, 1] = 0.3
    request = check_request(q, np.zeros(5, dtype=bool), [0.01, 0.01, 0.01, 0.0, 0.01], np.inf, 0.0, len(arm.a))
    assert round_corners(request, arm.position, arm.speed).stop.tolist() == [True] * 5


def test_runs_of_equal_points_become_one_and_stop_if_any_of_them_does():
    arm = random_arm(np.random.default_rng(2))
    q = np.repeat(np.random.default_rng(0).normal(size=(4, len(arm.a))), [1, 2, 2, 1], axis=0)
    request = check_request(q, [True, False, False, False, True, True], 0.01, np.inf, 0.0, len(arm.a))
    corners = round_corners(request, arm.position, arm.speed)
    assert corners.node.tolist() == [0, 1, 1, 2, 2, 3]
    assert corners.stop.tolist() == [True, False, True, True]


@pytest.mark.parametrize("radius", [1e-12, 1e-15, 1e-300])
def test_a_radius_of_no_size_is_a_stop_and_the_rest_is_driven_as_planned(radius):
    """Such a blend would have no length, and a curve through it no numbers."""
    rng = np.random.default_rng(3)
    arm = random_arm(rng)
    q = np.cumsum(0.3 * rng.normal(size=(4, len(arm.a))), axis=0)
    request = check_request(q, [True, False, False, True], [0.0, radius, 0.01, 0.0], 1.0, 0.0, len(arm.a))
    with np.errstate(all="raise"):
        corners = round_corners(request, arm.position, arm.speed)
        curve = build_curve(corners)
    assert corners.stop.tolist() == [True, True, False, True]
    s = np.linspace(0.0, curve.start[-1] + curve.span[-1], 400)
    assert all(np.isfinite(d).all() for d in curve.derivatives(s))
    assert np.array_equal(corners.entry[1], q[1])
