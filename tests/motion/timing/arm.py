"""A plain numpy DH arm and random tours for it, sharing no code with the planner."""

from dataclasses import dataclass

import numpy as np

DEG = np.pi / 180.0


@dataclass(frozen=True)
class Arm:
    """Standard DH rows alpha, a, d, theta (N,), the tool point in the last frame (3,), and joint limits (N,)."""

    alpha: np.ndarray
    a: np.ndarray
    d: np.ndarray
    theta: np.ndarray
    tool: np.ndarray
    speed: np.ndarray
    acceleration: np.ndarray
    jerk: np.ndarray

    def frames(self, q):
        n = len(q)
        frame = np.broadcast_to(np.eye(4), (n, 4, 4))
        out = [frame]
        for j in range(len(self.a)):
            ct, st = np.cos(q[:, j] + self.theta[j]), np.sin(q[:, j] + self.theta[j])
            ca, sa = np.cos(self.alpha[j]), np.sin(self.alpha[j])
            row = np.zeros((n, 4, 4))
            row[:, 0] = np.stack([ct, -st * ca, st * sa, self.a[j] * ct], axis=1)
            row[:, 1] = np.stack([st, ct * ca, -ct * sa, self.a[j] * st], axis=1)
            row[:, 2] = [0.0, sa, ca, self.d[j]]
            row[:, 3, 3] = 1.0
            frame = frame @ row
            out.append(frame)
        return out

    def position(self, q):
        last = self.frames(np.asarray(q))[-1]
        return last[:, :3, :3] @ self.tool + last[:, :3, 3]

    def jacobian(self, q):
        frames = self.frames(np.asarray(q))
        x = frames[-1][:, :3, :3] @ self.tool + frames[-1][:, :3, 3]
        return np.stack([np.cross(f[:, :3, 2], x - f[:, :3, 3]) for f in frames[:-1]], axis=2)


def nj130() -> Arm:
    """The large arm of the bar paper, with speeds of its class."""
    p = np.pi
    return Arm(
        np.array([-p / 2, 0, p / 2, -p / 2, p / 2, 0]),
        np.array([0.4, 0.86, -0.21, 0, 0, 0]),
        np.array([0.55, 0, 0, 0.76158, 0, 0.21]),
        np.array([0, -p / 2, p, p, 0, -p / 2]),
        np.array([0.05, 0, 0.15]),
        np.array([100, 100, 100, 160, 160, 240]) * DEG,
        np.full(6, 400.0) * DEG,
        np.full(6, 4000.0) * DEG,
    )


def random_arm(rng) -> Arm:
    n = int(rng.integers(5, 8))
    return Arm(
        rng.choice([-np.pi / 2, 0.0, np.pi / 2], n) + rng.normal(0, 0.05, n),
        rng.uniform(-0.6, 0.6, n),
        rng.uniform(-0.4, 0.4, n),
        rng.uniform(-np.pi, np.pi, n),
        rng.uniform(-0.2, 0.2, 3),
        rng.uniform(1.0, 6.0, n),
        rng.uniform(2.0, 30.0, n),
        rng.uniform(20.0, 500.0, n),
    )


def random_tour(rng, n, kind=None):
    """A polyline (m, n) of one of the kinds that have gone wrong before, and what is asked of it."""
    kinds = ["wide", "dense", "mixed", "collinear", "repeated", "reversal", "planar", "tiny"]
    kind = kind or kinds[int(rng.integers(len(kinds)))]
    m = int(rng.integers(3, 14))
    if kind == "dense":
        q = np.cumsum(rng.normal(0, 0.03, (m, n)), axis=0)
    elif kind == "mixed":
        q = np.cumsum(rng.normal(0, 1, (m, n)) * 10 ** rng.uniform(-4, 0, (m, 1)), axis=0)
    elif kind == "collinear":
        q = rng.uniform(-1, 1, n) + np.cumsum(rng.uniform(0.01, 0.5, m))[:, None] * rng.normal(0, 1, n)
    elif kind == "planar":
        q = np.zeros((m, n))
        q[:, int(rng.integers(n))] = np.cumsum(rng.uniform(-1, 1, m))
    elif kind == "tiny":
        q = np.cumsum(rng.normal(0, 1, (m, n)) * rng.choice([1e-8, 1e-6, 0.3], (m, 1)), axis=0)
    else:
        q = rng.uniform(-1.5, 1.5, (m, n))
    if kind == "repeated":
        q = np.repeat(q, rng.integers(1, 3, m), axis=0)
    if kind == "reversal":
        q = np.concatenate([q, q[::-1][1:]])
    m = len(q)
    stop = rng.random(m) < rng.choice([0.0, 0.3])
    stop[[0, -1]] = True
    return {
        "path_q": q,
        "stop": stop,
        "blend_m": rng.choice([0.002, 0.01, 0.05]) * rng.uniform(0.3, 1.0, m),
        "tool_speed": np.where(
            rng.random(m - 1) < rng.choice([0.0, 0.5, 1.0]), np.inf, rng.choice([1 / 60, 0.25, 1.0])
        ),
        "dwell": np.where(stop, rng.choice([0.0, 0.5], m), 0.0),
    }
