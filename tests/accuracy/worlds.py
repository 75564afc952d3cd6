"""An arm of the generator's with an artifact at an odd place, and a tracker elsewhere that reads the nests first."""

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType

import numpy as np

import tests.simulation.generator.catalogue as catalogue
import tests.simulation.generator.runs as runs
from planner.cell.reading import load_cell
from planner.documents.calibrated_robot import calibrated_files
from planner.identification.pipeline import FitSettings, identify
from planner.runs.loader import load_run
from tests.identification.few_draws import few_draws
from tests.simulation.generator.arm import Arm
from tests.simulation.generator.benches import BALLS_MM, BENCHES
from tests.simulation.generator.course import course
from tests.simulation.generator.kinds import Effect
from tests.simulation.generator.poses import point, uniform
from tests.simulation.generator.scene import total
from tests.simulation.generator.truth import Noise, Truth

NAME = "kuka-kr6-r700"
ERRORS = {"a1": 3e-4, "a2": -5e-4, "d4": 4e-4, "theta2": 6e-4, "theta3": -4e-4, "alpha1": 3e-4, "alpha4": -5e-4}
SOFT = {2: 5e-6, 3: -8e-6, 5: 2e-5}
NESTS_M = np.array([[0.0, -0.3, 0.0], [0.0, 0.3, 0.0], [0.3, 0.12, 0.0]])
R_GB = np.array([[-0.6, -0.8, 0.0], [0.8, -0.6, 0.0], [0.0, 0.0, 1.0]])  # the tracker's axes
P_BG = np.array([2.6, -0.2, 0.35])  # where it stands


@dataclass(frozen=True, eq=False)
class World:
    """Truth, TriCal run and cells; T_BW is where the artifact truly stands, found from its balls in the base frame."""

    arm: Arm
    truth: Truth
    bench: object
    made: object
    R_BW: np.ndarray
    p_BW: np.ndarray

    def points(self, q):
        """Where the true arm's reflector is at q (n, N), (n, 3) [m]."""
        scene = course(self.arm, self.bench, "tracker", q, self.truth, np.random.default_rng(0), frozenset())
        return scene.points(total(self.truth.of_arm(self.arm), catalogue.motions(scene, self.truth.effects)))

    def seen(self, x):
        """Points (n, 3) of the base frame as the tracker reads them."""
        return (x - P_BG) @ R_GB.T

    @property
    def nests(self):
        """The nests as the tracker reads them, (3, 3) [m]."""
        return self.seen(NESTS_M @ self.R_BW.T + self.p_BW)


@cache
def world():
    """One arm with errors of a millimetre or so, its artifact some millimetres off its stated place."""
    arm = Arm.from_toml(NAME)
    effects = tuple(Effect("joint-compliance", j, c) for j, c in SOFT.items())
    truth = Truth(5, MappingProxyType(ERRORS), effects, Noise(2.5e-6, 5e-6), (1.0,) * 6)
    bench = replace(
        BENCHES[NAME], map_mm=(70, 0, 150), tool_kg=6.0, com_mm=(20, 0, 65), plate_mm=(536.32, 21.901, 58.349)
    )
    made = runs.balls(arm, n_poses=80, seed=5, truth=truth, logs=(), bench=bench)
    balls = np.array(BALLS_MM) / 1e3
    centres = np.array([made.station.balls[made.station.balls[:, 0] == x][0] for x in _firsts(made.station.balls)])
    return World(arm, truth, bench, made, *_laid_on(balls, centres))


@cache
def poses(n=120, seed=2):
    """Poses (n, N) [rad] all over the workspace, none of them a calibration pose."""
    w, rng = world(), np.random.default_rng(seed)
    q = uniform(w.arm, 6 * n, rng)
    x = point(w.arm, q, w.bench.tool)
    return q[(x[:, 2] > 0.05) & (np.hypot(x[:, 0], x[:, 1]) > 0.15)][:n]


def tracker_run(q, noise=0.0, nests=True):
    """The file of a tracker's run as text, the nests above its columns."""
    w = world()
    rng = np.random.default_rng(9)
    x = 1e3 * (w.seen(w.points(q)) + noise * rng.standard_normal((len(q), 3)))
    lines = [f"# nest_mm: N{k + 1}, " + ", ".join(f"{v:.6f}" for v in p) for k, p in enumerate(1e3 * w.nests)]
    head = ",".join([*(f"q{i}_deg" for i in range(1, 7)), "x_mm", "y_mm", "z_mm", "pose"])
    rows = [",".join(f"{v:.9f}" for v in row) + f",{k}" for k, row in enumerate(np.hstack([np.rad2deg(q), x]))]
    return "\n".join([f"# robot: {NAME}", *(lines if nests else ()), head, *rows]) + "\n"


def loaded(text, stem="run"):
    """A run's text, read by the planner."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"{stem}.csv"
        path.write_text(text)
        return load_run(path, 6)


def calibrated(folder, gauge="trical"):
    """Write the calibration by TriCal, by a bar, or by sixty poses of the same tracker; return its ``robot.toml``."""
    for name, text in _calibrated(gauge):
        (folder / name).write_text(text)
    return folder / "robot.toml"


@cache
@few_draws()
def _calibrated(gauge):
    """Names and texts of what a calibration by this gauge writes."""
    w = world()
    if gauge == "edbb":
        text = runs.edbb_static(w.arm, 110, 6, w.truth, logs=()).run_csv
    else:
        text = w.made.run_csv if gauge == "trical" else tracker_run(poses(60, seed=7), noise=5e-6)
    found = identify(loaded(text), load_cell(f"{NAME}/{gauge}"), settings=FitSettings(release=False))
    return (*calibrated_files(found), ("identification.json", found.to_json()))


def _firsts(x):
    """First coordinate of each ball in the order in which the balls were measured."""
    return list(dict.fromkeys(x[:, 0].tolist()))


def _laid_on(a, b):
    """R (3, 3), p (3,) that lay a on b (Kabsch 1976)."""
    U, _, V = np.linalg.svd((b - b.mean(0)).T @ (a - a.mean(0)))
    R = U @ np.diag([1, 1, np.linalg.det(U @ V)]) @ V
    return R, b.mean(0) - R @ a.mean(0)
