"""One EDBB cell measured over and over: readings of ever new arms by the generator's own forward model, and fits.

The truth is brought to the parameters that were fitted by the generator's own Jacobian: the errors, all others zero,
that give the same readings at the same poses. What no reading shows is then part of neither.
"""

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy import stats

from planner.cell.cell import Cell
from planner.cell.reading import load_cell
from planner.fit.covariance import parameter_covariance
from planner.fit.identifiable_parameters import identifiable_subset
from planner.fit.least_squares import Fit, fit
from planner.fit.problem import FitProblem
from planner.fit.run_setup import locate_gauge, setup_for_run
from planner.model.model import Model
from planner.runs.loader import load_run
from planner.runs.run import Readings, Run
from tests.simulation.generator.arm import Arm
from tests.simulation.generator.made import Made
from tests.simulation.generator.runs import edbb_continuous, edbb_static
from tests.simulation.generator.scene import total
from tests.simulation.generator.station import Station
from tests.simulation.generator.truth import Noise, draw_errors

BUILD = {"static": edbb_static, "continuous": edbb_continuous}


@cache
def arm_of(name: str) -> Arm:
    """A shipped robot as the generator reads it."""
    return Arm.from_toml(name)


def loaded(made: Made) -> tuple[Run, Cell]:
    """The files of a made run, read by the planner."""
    with TemporaryDirectory() as folder:
        run, cell = made.write(Path(folder))
        return load_run(run, made.scene.arm.n_joints), load_cell(str(cell), planning=False)


@dataclass(frozen=True, eq=False)
class World:
    """A cell, the poses (n, N) [rad] that are measured in it, and the model whose parameters they show."""

    arm: Arm
    q: np.ndarray
    t: np.ndarray
    fixture: np.ndarray
    tool: np.ndarray
    run: Run
    cell: Cell
    model: Model

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the fitted parameters."""
        return self.model.names

    def read(self, errors, moved=None):
        """Length (n,) [m] of an arm with these errors; ``moved`` adds angles (n,) to slots."""
        arm_errors = {k: v for k, v in errors.items() if k in self.arm.names}
        x = self.arm.walk(self.q, total(arm_errors, moved or {}))
        tool = self.tool + [errors.get(f"map_{a}", 0.0) for a in "xyz"]
        point = (x.p + np.einsum("ijn,j->in", x.R, tool)).T
        return self._station(errors).read(point)[:, 0]

    def _station(self, errors) -> Station:
        place = self.fixture + [errors.get(f"fixture_A_{a}", 0.0) for a in "xyz"]
        return Station("edbb", place, np.eye(3), errors.get("zero", 0.0))

    def regrouped(self, errors):
        """Values (P,) of the fitted parameters that give what the arm with ``errors`` reads; what is left, (n,) [m]."""
        wanted, x = self.read(errors), {n: errors[n] for n in self.names}
        tool = self.tool + [x.get(f"map_{a}", 0.0) for a in "xyz"]
        arm_errors = {k: v for k, v in x.items() if k in self.arm.names}
        J, names = self._station(x).columns(self.arm, self.q, arm_errors, tool)
        J = J[:, 0, [names.index(n) for n in self.names]]
        size = np.linalg.norm(J, axis=0)
        inverse = np.linalg.pinv(J / size) / size[:, None]
        for _ in range(3):
            step = inverse @ (wanted - self.read(x))
            x = {n: x[n] + d for n, d in zip(self.names, step, strict=True)}
        return np.array([x[n] for n in self.names]), wanted - self.read(x)

    def measured(self, errors, noise: Noise, rng) -> Run:
        """A run of the arm with these errors."""
        n, memory = len(self.q), None
        if self.run.continuous:
            memory = float(np.exp(-np.median(np.diff(self.t)) / noise.wander_s))
        off = noise.joint * noise.draw(rng, n, self.arm.n_joints, memory)
        length = self.read(errors, {f"theta{i + 1}": off[:, i] for i in range(self.arm.n_joints)})
        return self.reading(length + noise.gauge * noise.draw(rng, n, 1)[:, 0])

    def reading(self, length) -> Run:
        """The run with other lengths (n,) [m]."""
        return replace(self.run, readings=Readings(length=length))

    def fitted(self, run: Run) -> tuple[Fit, np.ndarray]:
        """The fit of a run, and the covariance of its parameters."""
        found = fit(FitProblem.of(self.model, run))
        return found, parameter_covariance(found, run.continuous)[0]


@cache
def world(name="comau-nj130", n=120, motion="static", seed=11) -> World:
    """A cell of the generator with n poses or samples."""
    arm = arm_of(name)
    made = BUILD[motion](arm, n, seed=seed, logs=(), **({"repeats": 0.0} if motion == "static" else {"waypoints": 30}))
    run, cell = loaded(made)
    setup = locate_gauge(setup_for_run(cell, run), run)
    model = identifiable_subset(Model.of(setup, cell.plan.free), run.samples)[0]
    fixture, tool = setup.p_BX[0], setup.p_FM[0]
    return World(arm, made.scene.q, made.scene.t, fixture, tool, run, cell, model)


def declared(w: World) -> Noise:
    """The noise that the cell and the robot's data sheet state."""
    return Noise(w.model.setup.gauge.noise, w.model.setup.joint_sigma)


@dataclass(frozen=True, eq=False)
class Trials:
    """Many fits.

    ``off`` (fits, P) estimates less truth, ``z`` over their stated standard deviations, ``square`` (fits,) joint χ²;
    ``left`` rms [m] that regrouping could not bring over; ``freedom`` degrees of freedom of the noise.
    """

    names: tuple[str, ...]
    off: np.ndarray
    z: np.ndarray
    square: np.ndarray
    left: np.ndarray
    freedom: np.ndarray

    @property
    def P(self) -> int:
        """Number of parameters."""
        return len(self.names)


def covered(t: Trials, level=0.95):
    """How many of the fits' intervals hold the truth, (P,), by Student's t: the noise's size is found from the run."""
    return (np.abs(t.z) < stats.t.ppf(0.5 + level / 2, t.freedom)[:, None]).sum(axis=0)


def trials(w: World, fits: int, noise: Noise, seed=0, length=4e-4, angle=5e-4) -> Trials:
    """Fit ``fits`` arms, each with errors and noise of its own."""
    offs, z, square, left, freedom = [], [], [], [], []
    for k in range(fits):
        rng = np.random.default_rng([seed, k, 77])
        errors = draw_errors(w.arm, rng, length, angle)
        truth, rest = w.regrouped(errors)
        found, covariance = w.fitted(w.measured(errors, noise, rng))
        off = found.errors - truth
        offs.append(off)
        z.append(off / np.sqrt(np.diag(covariance)))
        square.append(off @ np.linalg.solve(covariance, off))
        left.append(np.sqrt((rest**2).mean()))
        freedom.append(len(w.q) - found.effective)
    return Trials(w.names, np.array(offs), np.array(z), np.array(square), np.array(left), np.array(freedom))
