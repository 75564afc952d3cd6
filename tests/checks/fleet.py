"""Robots that are calibrated, measured again and have changed or not: readings by the generator's own forward model."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from planner.cell.cell import Cell
from planner.checks.evaluation import build_detector, possible_changes
from planner.checks.planning import choose_check_poses
from planner.documents.baseline import Baseline, BaselineFile
from planner.fit.identifiable_parameters import identifiable_subset
from planner.fit.problem import FitProblem
from planner.fit.run_setup import locate_gauge, setup_for_run
from planner.model.model import Model
from planner.runs.run import Readings, Run, Samples
from tests.identification.worlds import World, arm_of, loaded, world
from tests.simulation.generator.runs import tracker
from tests.simulation.generator.scene import total
from tests.simulation.generator.truth import Noise, draw_errors

CALIBRATED, POSES, FREEDOM = 60, 10, 40.0
NAME = "kuka-kr6-r700"


@dataclass(frozen=True, eq=False)
class Calibrated:
    """A cell, and what a calibration in it knows: a model, and the root of the covariance of its parameters."""

    model: Model
    root: np.ndarray
    cell: Cell

    def found(self, values, rng) -> Baseline:
        """What a calibration of the arm with these values finds: off by a draw from its own covariance."""
        size = float(np.sqrt(rng.chisquare(FREEDOM) / FREEDOM))
        values = values + self.root @ rng.standard_normal(self.root.shape[1])
        setup = self.model.setup
        file = BaselineFile(
            schema="edbb-posterior/1", robot=NAME, robot_sha256="", gauge=self.cell.gauge.kind,
            fixtures={n: p.tolist() for n, p in setup.gauge.lasting_places(setup).items()},
            points=dict(zip(setup.point_names, setup.p_FM.tolist(), strict=True)),
            turns={n: (0.0, 0.0, 0.0) for n in setup.point_names} if setup.gauge.angles else {},
            noise=(size, size, size), freedom=FREEDOM,
            rest=0.0, parameters=[{"name": n, "value": v} for n, v in zip(self.model.names, values, strict=True)],
            spread=(self.root * size).tolist(),
        )  # fmt: skip
        return Baseline.of(file, self.cell, "baseline")


def root_of(model, run):
    """Root of the covariance of a model's parameters after the fit of a run."""
    rows = FitProblem.of(model, run).white_columns(np.zeros(len(model.names))).rows
    rows = rows.reshape(-1, len(model.names))
    information = rows.T @ rows + np.eye(len(model.names))
    return model.prior[:, None] * np.linalg.inv(np.linalg.cholesky(information)).T


@dataclass(frozen=True, eq=False)
class Fleet(Calibrated):
    """Its calibrations of ``CALIBRATED`` poses with a bar, and the poses (10, N) [rad] of the check."""

    world: World
    check: World
    noise: Noise

    def baseline(self, errors, rng) -> Baseline:
        """What a calibration of the arm with these errors finds."""
        return self.found(self.world.regrouped(errors)[0], rng)

    def read(self, errors, rng, moved=None) -> Run:
        """The run of a check; the zero of the bar is another one."""
        errors = dict(errors) | {"zero": float(rng.normal(0.0, 3e-4))}
        n, joints = self.check.q.shape
        off = self.noise.joint * rng.standard_normal((n, joints))
        angles = {f"theta{i + 1}": off[:, i] + (moved or {}).get(i, 0.0) for i in range(joints)}
        length = self.check.read(errors, angles) + self.noise.gauge * rng.standard_normal(n)
        samples = Samples(self.check.q, np.zeros(n, dtype=int))
        return Run("check", samples, Readings(length=length), self.world.run.places, robot=NAME)


@cache
def fleet() -> Fleet:
    """The cell of the generator, calibrated in 60 poses, with a check of ten others."""
    w = world(NAME, 150, seed=4)
    calibrated = np.arange(CALIBRATED)
    part = replace(w.run, samples=w.run.samples.take(calibrated), readings=w.run.readings.take(calibrated))
    model = identifiable_subset(w.model, part.samples)[0]
    mine = replace(w, q=w.q[calibrated], t=w.t[calibrated], run=part, model=model)
    noise = Noise(model.setup.gauge.noise, model.joint_sigma)
    whole = Fleet(model, root_of(model, part), w.cell, mine, mine, noise)
    known = whole.baseline(draw_errors(w.arm, np.random.default_rng(0)), np.random.default_rng(0))
    pool = Samples(w.q[CALIBRATED:], np.zeros(len(w.q) - CALIBRATED, dtype=int))
    changes = possible_changes(w.cell, known.model.setup, with_play=False)
    q = pool.q[choose_check_poses(known, changes, pool, POSES)]
    return replace(whole, check=replace(mine, q=q, t=np.arange(POSES) * 20.0))


@dataclass(frozen=True, eq=False)
class TrackerFleet(Calibrated):
    """The same with a laser tracker, which stands elsewhere every time; ``tool`` (3,) [m], ``q`` (10, N) [rad]."""

    tool: np.ndarray
    q: np.ndarray

    def baseline(self, errors, rng) -> Baseline:
        """What a calibration of the arm with these errors finds."""
        return self.found(np.array([errors.get(n, 0.0) for n in self.model.names]), rng)

    def read(self, errors, rng, moved=None) -> Run:
        """The run of a check, from a new station."""
        arm, setup = arm_of(NAME), self.model.setup
        off = self.model.joint_sigma * rng.standard_normal(self.q.shape)
        angles = {f"theta{i + 1}": off[:, i] + (moved or {}).get(i, 0.0) for i in range(self.q.shape[1])}
        stance = arm.walk(self.q, total({k: v for k, v in errors.items() if k in arm.names}, angles))
        R = stance.R.transpose(2, 0, 1)
        x = stance.p.T + R @ (self.tool + [errors[f"map_{a}"] for a in "xyz"])
        R_BG = Rotation.from_euler("xyz", [rng.normal(0, 0.02), rng.normal(0, 0.02), rng.uniform(-np.pi, np.pi)])
        place = np.array([2.5, 0.0, 0.4]) + rng.normal(0.0, 0.5, 3)
        position = (x - place) @ R_BG.as_matrix() + setup.gauge.noise * rng.standard_normal(x.shape)
        tilt = Rotation.from_rotvec(setup.gauge.noise_angle * rng.standard_normal(x.shape))
        rotation = (R_BG.inv() * tilt * Rotation.from_matrix(R)).as_matrix() if setup.gauge.angles else None
        samples = Samples(self.q, np.zeros(len(self.q), dtype=int))
        return Run("check", samples, Readings(position=position, rotation=rotation), ("",), robot=NAME)


@cache
def tracker_fleet(turns: bool) -> TrackerFleet:
    """The cell of the generator with a tracker, which reads orientations as well where ``turns``."""
    made = tracker(arm_of(NAME), 120, seed=4, logs=())
    run, cell = loaded(made)
    setup = locate_gauge(setup_for_run(cell, run), run)
    setup = replace(setup, gauge=cell.gauge.with_turns(turns))
    model, first = Model.of(setup, frozenset({"tool"})), run.take(slice(0, CALIBRATED))
    if turns:
        upright = np.broadcast_to(np.eye(3), (CALIBRATED, 3, 3))
        first = replace(first, readings=replace(first.readings, rotation=upright))
    whole = TrackerFleet(model, root_of(model, first), cell, setup.p_FM[0], run.samples.q[CALIBRATED:])
    known = whole.baseline(draw_errors(arm_of(NAME), np.random.default_rng(0)), np.random.default_rng(0))
    pool = run.samples.take(slice(CALIBRATED, None))
    changes = possible_changes(cell, known.model.setup, with_play=False)
    changes = build_detector(known, changes, pool)[1]
    return replace(whole, q=pool.q[choose_check_poses(known, changes, pool, POSES)])
