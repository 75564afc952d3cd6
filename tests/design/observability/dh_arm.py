"""A plain numpy arm on a ball bar, written apart from the planner: the generator that these tests judge it by.

Elementary transforms T = Rz(theta) Tz(d) Tx(a) Rx(alpha) [Ry(beta)], the measured point at a fixed offset from the
flange, and one reading, the distance to a fixture. Lengths in metres, angles in radians.
"""

from dataclasses import dataclass

import numpy as np

PI = np.pi


@dataclass(frozen=True)
class Arm:
    alpha: tuple[float, ...]  # [rad]
    a: tuple[float, ...]  # [m]
    d: tuple[float, ...]  # [m]
    theta: tuple[float, ...]  # [rad] at joint zero
    lower: tuple[float, ...]  # [deg]
    upper: tuple[float, ...]  # [deg]
    fixture: tuple[float, float, float]  # [m]
    tool: tuple[float, float, float]  # [m]
    shell: tuple[float, float]  # [m]


NJ130 = Arm(
    alpha=(-PI / 2, 0.0, PI / 2, -PI / 2, PI / 2, 0.0),
    a=(0.4, 0.86, -0.21, 0.0, 0.0, 0.0),
    d=(0.55, 0.0, 0.0, 0.76158, 0.0, 0.21),
    theta=(0.0, -PI / 2, PI, PI, 0.0, -PI / 2),
    lower=(-180, -60, -80, -270, -125, -180),
    upper=(180, 75, 110, 270, 125, 180),
    fixture=(0.258, 1.468, 0.708),
    tool=(0.05, 0.0, 0.15),
    shell=(0.3, 0.52),
)


def transforms(arm, beta_on=()):
    """(name, kind, axis, value, joint): the arm from base to measured point."""
    out = []
    for i in range(len(arm.a)):
        j = str(i + 1)
        out.append(("theta" + j, "R", 2, arm.theta[i], i))
        out += [("d" + j, "T", 2, arm.d[i], None), ("a" + j, "T", 0, arm.a[i], None)]
        out.append(("alpha" + j, "R", 0, arm.alpha[i], None))
        if i + 1 in beta_on:
            out.append(("beta" + j, "R", 1, 0.0, None))
    return out + [("map_" + "xyz"[k], "T", k, arm.tool[k], None) for k in range(3)]


def rotation(axis, angle):
    """(n, 3, 3) rotations about one of x, y, z, real or complex."""
    angle = np.atleast_1d(angle)
    out = np.zeros((len(angle), 3, 3), dtype=angle.dtype)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out[:, axis, axis] = 1
    out[:, i, i] = out[:, j, j] = np.cos(angle)
    out[:, j, i] = np.sin(angle)
    out[:, i, j] = -np.sin(angle)
    return out


def forward(chain, q):
    """Measured point (n, 3) and, for each transform, its axis and origin in the base frame."""
    turn, point, axes, origins = np.eye(3)[None], np.zeros((1, 3)), [], []
    for _, kind, axis, value, joint in chain:
        axes.append(turn[:, :, axis])
        origins.append(point)
        total = value + (q[:, joint] if joint is not None else 0)
        if kind == "R":
            turn = turn @ rotation(axis, total)
        else:
            point = point + turn[:, :, axis] * total
    return point, axes, origins


def names(arm, beta_on=(), free=()):
    chain = transforms(arm, beta_on)
    out = [name for name, *_ in chain if not name.startswith("map_") or "tool" in free]
    if "fixture" in free:
        out += ["fixture_A_" + c for c in "xyz"]
    return tuple(out) + (("zero",) if "zero" in free else ())


def rows(arm, q, beta_on=(), free=()):
    """Length rows (n, 1, P) in the order of ``names``."""
    chain = transforms(arm, beta_on)
    point, axes, origins = forward(chain, q)
    line = point - np.array(arm.fixture)
    line = line / np.linalg.norm(line, axis=1, keepdims=True)
    columns = []
    for (name, kind, *_), axis, origin in zip(chain, axes, origins, strict=True):
        if not name.startswith("map_") or "tool" in free:
            motion = axis if kind == "T" else np.cross(axis, point - origin)
            columns.append(np.broadcast_to(np.sum(line * motion, axis=1), len(q)))
    if "fixture" in free:
        columns += [-line[:, k] for k in range(3)]
    if "zero" in free:
        columns.append(np.ones(len(q)))
    return np.stack(columns, axis=1)[:, None, :]


def length(arm, q, values=None, beta_on=()):
    """Reading (n,), with some transforms set to other (complex) values: what a complex step differentiates."""
    values = values or {}
    chain = [(n, k, x, values.get(n, v), j) for n, k, x, v, j in transforms(arm, beta_on)]
    fixture = np.array([values.get("fixture_A_" + c, arm.fixture[k]) for k, c in enumerate("xyz")])
    point, _, _ = forward(chain, q)
    return np.sqrt(np.sum((point - fixture) ** 2, axis=1)) + values.get("zero", 0.0)


def shell_poses(arm, count, seed=0, batch=200_000):
    """Joint samples (count, N) [rad], uniform within the limits, whose reading is in the bar's range."""
    rng = np.random.default_rng(seed)
    low, high = np.radians(arm.lower), np.radians(arm.upper)
    chain = transforms(arm)
    to_wrist = chain[: next(i for i, t in enumerate(chain) if t[0] == "theta5")]
    reach = sum(abs(v) for _, k, _, v, _ in chain[len(to_wrist) :] if k == "T") + arm.shell[1]
    kept, have = [], 0
    while have < count:
        q = low + (high - low) * rng.random((batch, len(low)))
        near = np.linalg.norm(forward(to_wrist, q)[0] - arm.fixture, axis=1) < reach
        q = q[near]
        reading = length(arm, q)
        q = q[(reading > arm.shell[0]) & (reading < arm.shell[1])]
        kept.append(q)
        have += len(q)
    return np.concatenate(kept)[:count]
