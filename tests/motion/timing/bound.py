"""Times that no motion along a given path can beat, computed from samples of the path alone."""

import numpy as np

KEPT = 1.0 + 1e-6  # share of a limit that still counts as kept: rounding and ruckig's tolerance


def largest_share(report):
    """Return the largest share of any limit that a report tells."""
    joints = max(float(share.max()) for share in (report.speed, report.acceleration, report.jerk))
    return max(joints, report.tool_speed, report.reading_rate, report.reading_acceleration)


def speed_bound(trajectory, arm, per_piece=400):
    """Return ∫ ds / (largest ds/dt) [s] under joint and tool-point speed only, on the trajectory's own path."""
    s, fastest, _, _ = samples(trajectory, arm, per_piece)
    return float((np.diff(s) / np.maximum(fastest[:-1], fastest[1:])).sum())


def samples(trajectory, arm, per_piece=400):
    """Return s, the largest ds/dt there under speeds, q′ and q″, over a whole trajectory."""
    curve = trajectory.curve
    s = np.unique(
        np.concatenate([np.linspace(a, a + w, per_piece) for a, w in zip(curve.start, curve.span, strict=True)])
    )
    q, d1, d2, _ = curve.derivatives(s)
    at = trajectory.phases.time_at(s)
    leg = np.clip(
        np.searchsorted(trajectory.waypoint_time, at, side="left") - 1, 0, len(trajectory.tool_speed_limit) - 1
    )
    tool = np.linalg.norm(np.einsum("nij,nj->ni", arm.jacobian(q), d1), axis=1)
    with np.errstate(divide="ignore"):
        fastest = np.minimum((arm.speed / np.abs(d1)).min(axis=1), trajectory.tool_speed_limit[leg] / tool)
    return s, fastest, d1, d2


def acceleration_bound(trajectory, arm, per_piece=100):
    """Return the time [s] of the quickest motion under speeds and joint accelerations, without any limit of jerk.

    Reachability on x = ṡ² (Pham and Pham 2018): backward the largest x that can still be braked, forward the quickest.
    """
    s, fastest, d1, d2 = samples(trajectory, arm, per_piece)
    rest = trajectory.phases.s[np.flatnonzero(trajectory.phases.speed == 0.0)]
    top = fastest**2
    top[np.isin(s, s[np.searchsorted(s, rest).clip(0, len(s) - 1)])] = 0.0
    top[[0, -1]] = 0.0
    a = np.concatenate([d1, -d1], axis=1)
    b = np.concatenate([d2, -d2], axis=1)
    c = np.concatenate([arm.acceleration] * 2)
    step = np.diff(s)
    for i in range(len(s) - 2, -1, -1):
        top[i] = _largest(a[i], b[i], c, top[i], step[i], top[i + 1])
    x = np.zeros(len(s))
    for i in range(len(step)):
        with np.errstate(divide="ignore", invalid="ignore"):
            u = np.where(a[i] > 0.0, (c - b[i] * x[i]) / a[i], np.inf).min()
        x[i + 1] = max(min(x[i] + 2.0 * step[i] * u, top[i + 1]), 0.0)
    v = np.sqrt(x)
    return float((2.0 * step / np.maximum(v[:-1] + v[1:], 1e-12)).sum())


def _largest(a, b, c, top, step, after):
    """Return the largest x ≤ top for which some u keeps a u + b x ≤ c and 0 ≤ x + 2 step u ≤ after."""
    a = np.concatenate([a, [2.0 * step, -2.0 * step, 0.0]])
    b = np.concatenate([b, [1.0, -1.0, 1.0]])
    c = np.concatenate([c, [after, 0.0, top]])
    up, down = a > 0.0, a < 0.0
    # u ≤ (c − b x)/a for a > 0 and u ≥ for a < 0: every pair bounds x
    high, low = (c[up] / a[up], b[up] / a[up]), (c[down] / a[down], b[down] / a[down])
    room = high[0][:, None] - low[0]  # (c/a)_up − (c/a)_down ≥ x (b/a_up − b/a_down)
    slope = high[1][:, None] - low[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        limit = np.where(slope > 0.0, room / slope, np.inf)
    return float(max(min(limit.min(), top), 0.0))
