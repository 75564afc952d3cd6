"""Measured runs of true arms, in the product's format of a run: a bar at rest, a bar that is driven, a tracker."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

from tests.independent_arms.arm import HAND, workspace
from tests.independent_arms.chain import frames, points, transforms

FOLDER = Path(__file__).parent
CELLS = {"bar": FOLDER / "data" / "bar.toml", "tracker": FOLDER / "data" / "tracker.toml"}
POSES = FOLDER / "data" / "bar_poses.csv"  # of `edbb plan comau-nj130/edbb`
FIXTURE = np.array([0.258, 1.468, 0.708])
TRACKER = np.array([4.2, -0.6, 0.9])
TRACKER_POSES = 110
SECONDS_A_POSE = 21.0
RESTLESS_S = 1.5
JOINTS = [f"q{i}_deg" for i in range(1, 7)]


def warming(time):
    """Kelvin that the logged temperature has risen: the hall warms up over the morning."""
    return 6.0 * (1 - np.exp(-time / 2400.0))


def middle(time):
    """The condition for which a robot is judged: mean time and mean warmth of its run."""
    return {"time": float(np.mean(time)), "warm": float(np.mean(warming(time)))}


def bar_poses():
    table = np.genfromtxt(POSES, delimiter=",", names=True)
    return np.radians(np.stack([table[c] for c in JOINTS], 1))


def tracker_poses(arm, seed):
    """Poses of which the tracker sees the reflector: on its side of the arm, not too low."""
    q = workspace(arm, 6 * TRACKER_POSES, np.random.default_rng([seed, 31]))
    place = points(frames(arm, q)[6], np.array([0.05, 0.0, 0.15]))
    return q[(place[:, 2] > 0.2) & (place[:, 0] > -0.8)][:TRACKER_POSES]


def fixture_as_set_up(true, q, rng):
    """The cup is pushed under the ball where the robot shows it, by hand: the robot's error there, and the hand's."""
    nominal = points(frames(true.arm, q)[6], np.array([0.05, 0.0, 0.15]))
    near = int(np.argmin(np.linalg.norm(nominal - FIXTURE, axis=1)))
    return FIXTURE + (true.points(q[near : near + 1])[0] - nominal[near]) + rng.normal(0, HAND, 3)


def columns_at_rest(q, time):
    moved = np.sign(np.round(np.diff(q, axis=0, prepend=q[:1] - 1e-3), 9))
    columns = {"t_s": time, "temperature_degC": 20 + warming(time)}
    columns |= {name: np.degrees(q[:, i]) for i, name in enumerate(JOINTS)}
    columns |= {f"direction{i + 1}": moved[:, i] for i in range(6)}
    return columns | {"pose": np.arange(1, len(q) + 1)}


def bar_at_rest(true, q=None):
    """One reading a pose; the columns of the run, and its times."""
    rng = np.random.default_rng([true.seed, 5])
    q = bar_poses() if q is None else q
    time = SECONDS_A_POSE * (1 + np.arange(len(q))) + rng.uniform(0, 4, len(q))
    fixture = fixture_as_set_up(true, q, rng)
    rest = rng.normal(0, true.joint_noise, q.shape)
    length = bar_lengths(true, q, time, rest, fixture) + rng.normal(0, true.noise, len(q))
    return columns_at_rest(q, time) | {"length_mm": 1e3 * length}


def bar_lengths(true, q, time, rest, fixture):
    flange = true.flange(q, time=time, warm=warming(time), rest=rest)
    line = points(flange, true.tool) - fixture
    length = np.linalg.norm(line, axis=1)
    return length + true.zero + true.read_along(line, length, flange[:, :3, :3], time)


def tracker_run(true):
    """A point a pose, in the tracker's frame, which stands where nobody has measured it."""
    rng = np.random.default_rng([true.seed, 6])
    q = tracker_poses(true.arm, true.seed)
    time = SECONDS_A_POSE * (1 + np.arange(len(q))) + rng.uniform(0, 4, len(q))
    rest = rng.normal(0, true.joint_noise, q.shape)
    flange = true.flange(q, time=time, warm=warming(time), rest=rest)
    stand = transforms(np.array([*(TRACKER + rng.normal(0, 3e-3, 3)), *rng.normal(0, 2e-3, 2), np.pi - 0.1]))
    line = (points(flange, true.tool) - stand[:3, 3]) @ stand[:3, :3]
    far = np.linalg.norm(line, axis=1)
    seen = far + true.read_along(line @ stand[:3, :3].T, far, flange[:, :3, :3], time)
    noise = rng.normal(size=line.shape) * true.noise
    place = line * (seen / far)[:, None] + noise
    return columns_at_rest(q, time) | {f"{axis}_mm": 1e3 * place[:, i] for i, axis in enumerate("xyz")}


def write_run(columns, path, robot="comau-nj130"):
    """A run as CSV, seven digits behind the point of angles, six of lengths."""
    digits = [0 if n == "pose" or n.startswith("direction") else 7 if n.endswith("deg") else 6 for n in columns]
    lines = [f"# robot: {robot}", ",".join(columns)]
    rows = np.stack(list(columns.values()), 1)
    lines += [",".join(f"{v:.{d}f}" for v, d in zip(row, digits, strict=True)) for row in rows.tolist()]
    Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8")


def driven_rest(rng, time, sigma):
    """Where the axes run beside where they should: noise that lasts for some RESTLESS_S seconds (n, 6)."""
    keeps = np.exp(-np.median(np.diff(time)) / RESTLESS_S)
    drawn = rng.normal(size=(len(time), 6)) * sigma * np.sqrt(1 - keeps**2)
    return lfilter([1.0], [1.0, -keeps], drawn, axis=0)


def bar_driven(true, plan):
    """The bar as the robot drives the planned way, a row every 50 ms; its reading is a little late."""
    rng = np.random.default_rng([true.seed, 8])
    table = np.loadtxt(plan / "trajectory.csv", delimiter=",", skiprows=1)
    time, q = table[:, 0], np.radians(table[:, 1:7])
    fixture = fixture_as_set_up(true, q[:: len(q) // 200], rng)
    rest = driven_rest(rng, time, true.joint_noise)
    length = bar_lengths(true, q, time, rest, fixture)
    late = np.interp(time - true.late, time, length) + rng.normal(0, true.noise, len(q))
    columns = {"t_s": time, "temperature_degC": 20 + warming(time)}
    return columns | {name: np.degrees(q[:, i]) for i, name in enumerate(JOINTS)} | {"length_mm": 1e3 * late}


@dataclass(frozen=True)
class Session:
    """What is measured with, and for a bar that is driven the folder of its plan."""

    gauge: str
    plan: Path | None = None

    def measure(self, true):
        """The columns of the run of an arm."""
        if self.gauge == "driven":
            return bar_driven(true, self.plan)
        return tracker_run(true) if self.gauge == "tracker" else bar_at_rest(true)

    def words(self):
        """What `edbb identify` is told beside the run."""
        if self.gauge == "driven":
            return "--cell", self.plan / "cell.toml", "--plan", self.plan / "plan.json"
        return "--cell", CELLS[self.gauge]
