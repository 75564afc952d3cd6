"""The figures of ISO 230-4 on paths whose errors are known in closed form."""

import numpy as np
import pytest
from scipy.optimize import minimize

from planner.circular.figures import circle_figures, find_reversals, fit_circle, minimum_zone
from planner.circular.plan import Circle
from planner.circular.sweeps import MeasuredCircle, Sweep

R = 0.350
UM = 1e-6


def ring(sweep=2 * np.pi, start=0.0, fixture=(0.0, 0.0, 0.0)):
    circle = Circle("XY", "XY", 0, np.zeros(3), R, start, sweep, 0.0, ("ccw",), 0.01, False, None, (), 1)
    return MeasuredCircle.of(circle, np.array(fixture))


def joints(angle):
    return np.column_stack([np.cos(angle - 1.0), np.zeros_like(angle)])


def trace(radial, direction=1, sweep=2 * np.pi, offset=(0.0, 0.0), n=4000, start=0.0, height=0.0):
    """A sweep of a bar on a fixture beside the circle's centre: radial (φ) is what is left when that is taken off."""
    angle = start + np.linspace(0.0, sweep, n)[::direction]
    unit = np.column_stack([np.cos(angle), np.sin(angle)])
    # a bar along a planned angle meets the path about the shifted centre: solve the triangle exactly
    shift = unit @ np.array(offset)
    across = np.hypot(*offset) ** 2 - shift**2
    wanted = R + radial(angle)
    length = np.hypot(shift + np.sqrt(wanted**2 - across), height)
    return Sweep(0, direction, angle, length, np.full(n, np.hypot(R, height)), joints(angle), None)


@pytest.mark.parametrize("offset", [(0.0, 0.0), (8e-4, -5e-4)])
def test_squareness_makes_an_ellipse(offset):
    """Axes out of square by s: r = R (1 + s/2 sin 2φ), so G = R s whatever the centring."""
    s = 2e-4
    found = circle_figures(ring(), None, [trace(lambda a: R * s / 2 * np.sin(2 * a), offset=offset)])
    (path,) = found.paths
    assert pytest.approx(R * s, rel=5e-3) == path.G
    assert path.G_ls == pytest.approx(R * s, rel=5e-3)
    assert path.F_max == pytest.approx(R * s / 2, abs=0.4 * UM)
    assert path.F_min == pytest.approx(-R * s / 2, abs=0.4 * UM)
    assert found.centre.centre == pytest.approx(offset, abs=0.2 * UM)
    assert pytest.approx(0.0, abs=0.2 * UM) == found.D
    assert found.G_b is None
    assert found.H is None


def test_a_circle_beside_the_fixtures_plane():
    """The bar stands on a cone: its length changes by less than the radius does."""
    height = 0.12
    seen = trace(lambda a: 40 * UM * np.cos(3 * a), height=height)
    found = circle_figures(ring(fixture=(0.0, 0.0, -height)), None, [seen])
    assert pytest.approx(80 * UM, rel=5e-3) == found.paths[0].G
    assert np.ptp(seen.length) < 0.96 * 80 * UM


def test_two_directions():
    """The two paths lie h apart everywhere: neither shows it alone."""
    h = 15 * UM
    ways = [trace(lambda a, d=d: d * h / 2 + 20 * UM * np.cos(2 * a), d) for d in (1, -1)]
    found = circle_figures(ring(), None, ways)
    ccw, cw = found.paths
    assert (ccw.direction, cw.direction) == ("ccw", "cw")
    assert pytest.approx(40 * UM, rel=1e-3) == ccw.G
    assert pytest.approx(40 * UM, rel=1e-3) == cw.G
    assert found.G_b == pytest.approx(40 * UM + h, rel=1e-3)
    assert pytest.approx(h, rel=1e-3) == found.H
    assert found.H_mean == pytest.approx(h, rel=1e-3)
    assert ccw.mean - cw.mean == pytest.approx(h, rel=1e-3)
    assert ccw.F_max == pytest.approx(20 * UM + h / 2, rel=1e-2)


def test_a_radius_that_is_off():
    found = circle_figures(ring(), None, [trace(lambda a: np.full_like(a, 120 * UM), offset=(1e-3, 0.0))])
    assert pytest.approx(120 * UM, abs=0.1 * UM) == found.D
    assert found.paths[0].G < 0.5 * UM


def test_half_a_circle_finds_its_centre_less_well_but_right():
    rng = np.random.default_rng(1)
    noise = rng.normal(scale=1 * UM, size=4000)
    half = trace(lambda a: 10 * UM * np.cos(4 * a) + noise, sweep=np.pi, offset=(3e-4, 2e-4))
    found = circle_figures(ring(np.pi), None, [half])
    assert found.centre.centre == pytest.approx((3e-4, 2e-4), abs=6 * UM)
    assert found.centre.std[1] > 2 * found.centre.std[0]


def test_minimum_zone_against_brute_force():
    rng = np.random.default_rng(3)
    angle = np.linspace(0, 2 * np.pi, 900, endpoint=False)
    bump = 30 * UM * np.exp(-(((angle - 1.0) / 0.2) ** 2))
    r = R + 12 * UM * np.cos(3 * angle + 0.3) + bump + rng.normal(scale=2 * UM, size=len(angle))
    points = r[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]) + [2e-4, 1e-4]
    about = fit_circle(points)

    def zone(shift):
        return np.ptp(np.linalg.norm(points - about.centre - shift * UM, axis=1)) / UM

    best = min(
        (minimize(zone, s, method="Nelder-Mead", options={"xatol": 1e-5, "fatol": 1e-6, "maxiter": 4000}).fun)
        for s in rng.normal(scale=5.0, size=(6, 2))
    )
    assert minimum_zone(points, about) / UM == pytest.approx(best, abs=0.02)
    assert best < zone(np.zeros(2)) - 0.2  # the least-squares centre is not the best one


@pytest.mark.parametrize("direction", [1, -1])
def test_a_reversal_and_its_jump(direction):
    """A joint that turns at 1 rad: after it the bar reads 8 µm more in the direction of driving."""
    rng = np.random.default_rng(5)
    angle = np.linspace(0.0, np.pi, 9000)[::direction]
    after = (angle > 1.0) if direction == 1 else (angle < 1.0)
    radial = 200 * UM * np.sin(2 * angle) + 8 * UM * after + rng.normal(scale=0.3 * UM, size=len(angle))
    (found,) = find_reversals(angle, joints(angle), radial, direction)
    assert found.joints == (0,)  # the other joint stands still
    assert found.angle == pytest.approx(1.0, abs=np.deg2rad(0.3))
    assert found.step == pytest.approx(8 * UM, abs=0.6 * UM)
    assert 0.0 < found.std < 1.0 * UM


def test_where_nothing_jumps_the_reversal_says_so():
    rng = np.random.default_rng(6)
    angle = np.linspace(0.0, np.pi, 9000)
    wander = np.cumsum(rng.normal(scale=0.05 * UM, size=len(angle)))
    (found,) = find_reversals(angle, joints(angle), wander, 1)
    assert abs(found.step) < 4 * found.std
