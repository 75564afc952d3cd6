"""The circle through points in space, against circles that were drawn."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planner.kinematics.geometry import fit_circle_in_space, points_on_arc


@pytest.mark.parametrize("n", [3, 4, 40, 200_000])
def test_a_drawn_circle_is_found(n):
    rng = np.random.default_rng(n)
    turn, middle, radius = Rotation.random(rng=rng), rng.normal(size=3), rng.uniform(0.05, 0.9)
    angle = rng.uniform(0, 2 * np.pi, n) if n > 3 else np.array([0.1, 2.0, 4.5])
    x = middle + radius * turn.apply(np.column_stack([np.cos(angle), np.sin(angle), np.zeros(n)]))
    centre, axes, found = fit_circle_in_space(x)
    assert centre == pytest.approx(middle, abs=1e-9)
    assert found == pytest.approx(radius, abs=1e-9)
    assert abs(axes[2] @ turn.apply([0, 0, 1])) == pytest.approx(1, abs=1e-12)
    assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-12)


@pytest.mark.parametrize("order", [(0.2, 1.0, 3.0), (3.0, 1.0, 0.2), (5.5, 0.3, 2.0)])
def test_an_arc_passes_its_middle_point(order):
    radius = 0.3
    x = radius * np.column_stack([np.cos(order), np.sin(order), np.zeros(3)]) + [1, 2, 3]
    share = np.linspace(0, 1, 20_001)
    points, length = points_on_arc(x, share)
    assert points[[0, -1]] == pytest.approx(x[[0, 2]], abs=1e-9)
    assert np.linalg.norm(points - x[1], axis=1).min() < 1e-4
    assert length == pytest.approx(np.linalg.norm(np.diff(points, axis=0), axis=1).sum(), rel=1e-6)
