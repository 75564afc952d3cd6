"""Runs made for the tests, and the files that hold them."""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from planner.runs.run import Readings, Run, Samples

MEASURED = Path(__file__).resolve().parents[1] / "data"  # runs that somebody else took


def write(path, text):
    path.write_text(text, encoding="utf-8")
    return path


def rows(n=5, header="t_s,q1_deg,q2_deg,length_mm", change=None):
    """Return a CSV of n rows far from any limit; ``change`` puts (row, column, text) into it."""
    values = [[f"{i}", f"{10 * i - 20}", f"{30 - 7 * i}", f"{350 + i}"] for i in range(n)]
    if change is not None:
        values[change[0]][change[1]] = change[2]
    return "\n".join([header, *(",".join(v) for v in values)]) + "\n"


def sine_path(t):
    """Return joint angles (n, 3) [rad] and speeds (n, 3) [rad/s] of a smooth drive at times t [s]."""
    rate, phase = np.array([0.31, 0.47, 0.23]), np.array([0.2, 1.1, 2.5])
    return np.sin(np.outer(t, rate) + phase), rate * np.cos(np.outer(t, rate) + phase)


def full_run(kind, seed=3):
    """Return a run of 40 samples with everything that can be logged, and a reading of ``kind``."""
    rng = np.random.default_rng(seed)
    n, joints = 40, 7
    readings = {
        "length": Readings(length=rng.uniform(0.3, 0.5, n)),
        "position": Readings(position=rng.normal(0, 1.0, (n, 3)), rotation=Rotation.random(n, rng=rng).as_matrix()),
        "ball": Readings(ball=np.arange(n) % 12, offset=rng.normal(0, 1e-4, (n, 3))),
    }[kind]
    q_read, q_cmd = rng.uniform(-3, 3, (2, n, joints))
    samples = Samples(
        q=q_read,
        place=np.arange(n) // 20,
        t=np.cumsum(rng.uniform(1.0, 3.0, n)),
        q_cmd=q_cmd,
        q_read=q_read,
        session=np.arange(n) // 15,
        pose=rng.permutation(n) - 1,
        point=np.arange(n) % 2,
        temperature=rng.uniform(18, 28, n),
        force=rng.uniform(-50, 600, n),
        torque=rng.normal(0, 80, (n, joints)),
        payload=rng.uniform(0, 5, n),
        direction=rng.integers(-1, 2, (n, joints)).astype(float),
    )
    balls = tuple(str(i) for i in range(1, 13)) if kind == "ball" else ()
    return Run("full", samples, readings, ("A", "B, left"), balls, ("tip", "tip 2"), False, "0123456789ab", "any-arm")
