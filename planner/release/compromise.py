"""Where between geometry alone and the posterior the robot lies that is released.

Any robot is judged against all that were drawn, by its error e over that of geometry alone, e₀. The compromise of risk
r has the least mean of (e / e₀)^(2 r): by the larger r, the more count the drawn robots for which it would be worse
than geometry, until it keeps to what nearly all of them have in common. From geometry alone a robot goes towards a
compromise as far as it is hardly ever noticeably worse. Of these robots the one is taken that is expected to err least.
Where all that a run shows is as good as certain that is the compromise of risk 1, which errs least wholly reached.
Where some causes are and others are not, a way towards risk 1 ends early by the latter, and one of higher risk takes
the former whole.
"""

from dataclasses import replace

import numpy as np

from planner.common.units import Array
from planner.fit.assumptions import DOUBT, NOTICED
from planner.fit.least_squares import Fit
from planner.release.released_robot import ReleasedRobot, pick_rows


def choose_compromise(geometry: ReleasedRobot) -> tuple[Fit, float]:
    """Return the compromise to go towards, with the posterior's model, and how far, 0 to 1."""
    aims = [
        minimise_expected_error(geometry, risk) for risk in (1.0, 2.0, 4.0)
    ]  # by higher ones what is sure is left as well
    ways = [(aim, safe_share(geometry, aim)) for aim in aims]
    return min(ways, key=lambda way: geometry.likely_workspace_error(interpolate_fit(geometry.fit, *way)))


def minimise_expected_error(geometry: ReleasedRobot, risk: float = 1.0) -> Fit:
    """Return the posterior's fit with the values whose mean of (e / e₀)^(2 ``risk``) over the drawn robots is least.

    They are a mean of the drawn robots. With a risk of 1 each has the weight 1 / e₀²: robots for which geometry is
    nearly right count most.
    """
    posterior = geometry.posterior
    square = geometry.drawn_errors(geometry.geometry) ** 2
    if not square.all():  # nothing moves the tool
        return posterior.fit
    off, tool = geometry.drawn_offsets, geometry.tool
    moved = pick_rows(off, posterior.fit.model.names, tool.names)
    products = moved.T @ (tool.gram @ moved) / len(tool.q)
    beside = geometry.drawn_beside(tool.from_middle_square.mean())
    return with_values(posterior.fit, posterior.fit.errors + off @ _least_risk(products, beside, square, risk))


def _least_risk(products: Array, beside: Array, plain: Array, risk: float) -> Array:
    """Return the coefficients (n,) of drawn robots, about their mean, in the compromise of a risk.

    It is the mean of the drawn robots with the weights (e / e₀)^(2 ``risk`` − 2) / e₀² of its own errors (iteratively
    reweighted least squares). What is minimised is convex; steps are shortened until it falls.

    Args:
        products: of the tool's motion between the posterior's mean and every two drawn robots, (n, n) [m²].
        beside: mean square motion that joint angles do not determine, (n,) [m²].
        plain: squared errors of geometry alone, (n,) [m²].
        risk: at least 1.
    """
    count, own = len(plain), np.diag(products) + beside

    def ratios(weight: Array) -> Array:
        """Return the squared errors of the mean with these weights over those of geometry alone, (n,)."""
        along = products @ (weight - 1 / count)
        return np.asarray((own - 2 * along + (weight - 1 / count) @ along) / plain)

    weight = 1 / plain / (1 / plain).sum()
    here, step = ratios(weight), 1.0
    # 60: steps at most; 1e-3: a step, and a change of the mean, so small moves no robot noticeably
    for _ in range(60):
        own_weight = here ** (risk - 1) / plain
        towards = own_weight / own_weight.sum() - weight
        there = ratios(weight + step * towards)
        before, after = (here**risk).mean(), (there**risk).mean()
        if after < before:
            weight, here, step = weight + step * towards, there, min(1.0, 2 * step)
            if after > (1 - 1e-3) * before:
                break
        else:
            step *= 0.5
            if step < 1e-3:
                break
    return np.asarray(weight - 1 / count)


def safe_share(geometry: ReleasedRobot, aim: Fit) -> float:
    """Return how far from geometry alone (0) to ``aim`` (1) a robot is noticeably worse with a probability of DOUBT.

    On the way errors are quadratic: with the true robot's projection t on the way, 0 at geometry and 1 at the aim, L
    the square of the way's length and e² that of geometry's error, the square of a robot's a share s along is
    e² + L s (s − 2 t). Where most of e is beside the way, as of a robot of which a run shows little, no share matters:
    it is worse than geometry alone by no more than NOTICED as far as s ≤ t + √(t² + (NOTICED² − 1) e²/L).
    """
    length = geometry.distance(geometry.geometry, aim) ** 2
    if length == 0.0:
        return 0.0
    plain = geometry.drawn_errors(geometry.geometry) ** 2 / length
    along = 0.5 * (1 + plain - geometry.drawn_errors(aim) ** 2 / length)
    farthest = along + np.sqrt(along**2 + (NOTICED**2 - 1) * plain)
    return float(np.clip(np.quantile(farthest, DOUBT), 0.0, 1.0))


def interpolate_fit(geometry: Fit, aim: Fit, share: float) -> Fit:
    """Return the posterior's fit with values a share of the way from those of geometry alone to those of ``aim``."""
    start = geometry.at(aim.model.names)
    return with_values(aim, start + share * (aim.errors - start))


def with_values(fit: Fit, errors: Array) -> Fit:
    """Return a fit with other values (P,) of its parameters."""
    return replace(fit, solution=replace(fit.solution, errors=errors))
