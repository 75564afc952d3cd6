"""A run that was made: the files that the identifier gets, and the truth that it does not get."""

import io
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import polars as pl

import tests.simulation.generator.catalogue as catalogue
import tests.simulation.generator.oracle as oracle
from tests.simulation.generator.scene import Scene, total
from tests.simulation.generator.station import Station
from tests.simulation.generator.truth import Truth

FREE = 100.0  # times its own size: an effect's size is as good as free in the oracle's fit
MANY = 4000  # rows that a Jacobian is made of, spread over a long run


@dataclass(frozen=True, eq=False)
class TrueRun:
    """What is true of one run of n samples with k numbers a reading.

    ``truth``: with the sizes of the effects as they are. ``scene``, ``station``: the true course and gauge.
    ``reading``, ``clean`` (n, k) [m]: with and without noise (balls: the measured point in the base frame that the
    recorded angles stand for, against ``station.balls``). ``pose`` (n,): groups of samples.
    """

    truth: Truth
    scene: Scene
    station: Station
    reading: np.ndarray
    clean: np.ndarray
    pose: np.ndarray


@dataclass(frozen=True, eq=False)
class Made(TrueRun):
    """A run and its files: ``run_csv``, ``cell_toml``, ``robot_toml`` (empty where the shipped file will do)."""

    run_csv: str
    cell_toml: str
    robot_toml: str

    @property
    def noise(self):
        """What the gauge's noise and the joints' repeatability add to the reading, (n, k) [m]."""
        return self.reading - self.clean

    @property
    def noise_rms(self):
        """RMS of the noise of a whole reading [m]."""
        return oracle.rms(self.noise)

    def write(self, folder: Path):
        """Write ``run.csv`` and ``cell.toml``; return their paths."""
        run, cell = Path(folder) / "run.csv", Path(folder) / "cell.toml"
        run.write_text(self.run_csv)
        cell.write_text(self.cell_toml)
        if self.robot_toml:
            (Path(folder) / "robot.toml").write_text(self.robot_toml)
        return run, cell

    def two_logs(self, offset_s):
        """A continuous run as controller and gauge log it apart: two texts, by turns, the gauge's clock ahead."""
        lines = self.run_csv.splitlines(keepends=True)
        table = pl.read_csv(io.StringIO("".join(lines[1:])))
        angles = [c for c in table.columns if c == "t_s" or c.startswith(("q", "cmd"))]
        gauge = table.gather_every(2, 1).select(pl.col("t_s") + offset_s, pl.exclude(angles))
        return lines[0] + table.gather_every(2).select(angles).write_csv(), lines[0] + gauge.write_csv()

    @cached_property
    def rows(self):
        """The samples that the oracle works with: all of them, or a spread of a long run."""
        return np.unique(np.linspace(0, len(self.scene.t) - 1, min(MANY, len(self.scene.t))).astype(int))

    @cached_property
    def geometry(self):
        """Jacobian (rows, k, P) of the reading by geometry, tool and gauge at the truth, and its names."""
        return columns(self.scene, self.station, self.truth, self.rows)

    def effect_columns(self):
        """Change of the reading (rows, k, E) by the whole of each effect, the others absent."""
        parts = [self.left_by(e) for e in self.truth.effects]
        shape = (len(self.rows), self.clean.shape[1], 0)
        return np.stack(parts, axis=2) if parts else np.zeros(shape)

    def left_by(self, effect):
        """Change of the reading (rows, k) [m] that one effect makes, before geometry takes its share."""
        return change(self.scene, self.station, self.truth, effect)[self.rows]

    def share_of(self, effect):
        """RMS of an effect after the geometry has taken what it can, over the noise."""
        e = oracle.left_over(self.geometry[0], self.left_by(effect), self.sigma)
        return oracle.rms(e) / self.noise_rms

    def likeness(self, one, other):
        """Cosine between what two effects leave after geometry: 1 or -1, and no fit of this run can tell them apart."""
        left = [oracle.left_over(self.geometry[0], self.left_by(e), self.sigma).ravel() for e in (one, other)]
        return float(left[0] @ left[1] / (np.linalg.norm(left[0]) * np.linalg.norm(left[1])))

    @property
    def sigma(self):
        """Noise of one number of a reading [m]."""
        return self.noise_rms / np.sqrt(self.clean.shape[1])

    def oracle(self, folds=5, knows_effects=True):
        """Train and held-out RMS [m] of a fit that knows which effects there are, or of geometry alone.

        ``folds``: a number, whole poses dealt out in turn; or (rows,) labels of what is left out together.
        """
        J, y = self.geometry[0], self.noise[self.rows]
        wide = np.full(J.shape[2], oracle.WIDE)
        if knows_effects:
            J = np.concatenate([J, self.effect_columns()], axis=2)
            wide = np.append(wide, np.full(len(self.truth.effects), FREE))
        else:
            y = y + (self.clean - plain(self.scene, self.station, self.truth))[self.rows]
        if np.ndim(folds) == 0:
            folds = blocks(self.pose[self.rows], self.scene.moving, int(folds))
        train = oracle.left_over(J, y, self.sigma, wide)
        return oracle.rms(train), oracle.rms(oracle.held_out(J, y, folds, self.sigma, wide))


def blocks(pose, moving, folds):
    """Fold (n,) of each sample: poses in turn, or stretches of a continuous run."""
    if moving:
        return np.arange(len(pose)) * 10 * folds // len(pose) % folds
    return np.unique(pose, return_inverse=True)[1] % folds


def columns(scene, station, truth, rows):
    """Jacobian (rows, k, P) at the truth, and names."""
    some = station if station.balls is None else Station(**{**vars(station), "balls": station.balls[rows]})
    return some.columns(scene.arm, scene.q[rows], truth.of_arm(scene.arm), scene.tool)


def plain(scene, station, truth):
    """Reading (n, k) [m] of the true geometry without effects and noise."""
    return station.read(scene.points(truth.of_arm(scene.arm)))


def with_effects(scene, station, truth, effects):
    """Reading (n, k) [m] of the true geometry with effects."""
    x = scene.points(total(truth.of_arm(scene.arm), catalogue.motions(scene, effects)))
    return catalogue.read(scene, effects, station.read(x), x - scene.fixture)


def change(scene, station, truth, effect):
    """What one effect alone changes in the reading, (n, k) [m]."""
    return with_effects(scene, station, truth, (effect,)) - plain(scene, station, truth)
