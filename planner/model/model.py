"""Predicted reading and identification Jacobian of a setup: one list of parameters for planning, fitting and tracing.

A parameter is a pair of what it moves (an elementary transform, or the reading itself) and a basis function φ of the
sample; for a geometric error φ is 1, for a fixture it tells which fixture holds the bar, for a compliance it is the
joint's torque. A column of the Jacobian is the screw of the transform, projected by the gauge, times φ.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.cell.cell import Cell
from planner.cell.setup import MeasurementSetup, Targets, setup_of
from planner.common.units import Array
from planner.effects.basis import BasisFunction
from planner.effects.context import Context
from planner.effects.effect import Parameter, gauge_parameters, robot_parameters
from planner.kinematics.chain import ForwardPass
from planner.runs.run import Samples


@dataclass(frozen=True)
class ReadingNoise:
    """How much readings are declared to scatter, by the gauge and by the robot's repeatability.

    The covariance of a reading is diag(gauge²) + J_q Σ_q J_qᵀ, with Σ_q = joint_sigma² I.

    Attributes:
        gauge: standard deviation of each number of a reading by the gauge alone, (r,) [m, rad].
        joint_sigma: repeatability of one joint [rad].
        joint_rows: derivative J_q of the readings by the joint angles, (n, r, N).
    """

    gauge: Array
    joint_sigma: float
    joint_rows: Array

    @property
    def gauge_variance(self) -> Array:
        """Variance of each number by the gauge alone, (r,) [m², rad²]."""
        return self.gauge**2

    @property
    def robot_variance(self) -> Array:
        """Variance of each number by the robot's repeatability alone, (n, r) [m², rad²]."""
        return np.asarray(self.joint_sigma**2 * (self.joint_rows**2).sum(axis=2))

    @property
    def robot_covariance(self) -> Array:
        """Covariance by the robot's repeatability alone, (n, r, r) [m², m rad, rad²]."""
        return np.asarray(self.joint_sigma**2 * self.joint_rows @ self.joint_rows.transpose(0, 2, 1))

    @property
    def std(self) -> Array:
        """Standard deviation of the noisiest number of each reading, (n,) [m]."""
        return np.asarray(np.sqrt(self.gauge_variance + self.robot_variance).max(axis=1))

    @property
    def square(self) -> Array:
        """Expected square of a reading's whole error, (n,) [m²]."""
        return np.asarray(self.gauge_variance.sum() + self.robot_variance.sum(axis=1))


LAYOUTS = ("_layout", "_fixed_layout", "_fixed_values", "parameters_and_fixed")
CHUNK = 4096  # samples a pass: the working set stays in the processor's cache


@dataclass(frozen=True)
class Linearization:
    """The model about some errors: residuals reading − prediction (n, r) and identification Jacobian (n, r, P)."""

    residual: Array
    rows: Array


@dataclass(frozen=True)
class Model:
    """The measurement model of one setup with a list of parameters; ``fixed`` ones stand at the value beside them."""

    setup: MeasurementSetup
    parameters: tuple[Parameter, ...]
    fixed: tuple[tuple[Parameter, float], ...] = ()

    @classmethod
    def from_cell(cls, cell: Cell, free: frozenset[str] | None = None) -> "Model":
        """Build the model of a cell with the parameters that its ``[plan] free`` allows."""
        return cls.of(setup_of(cell), cell.plan.free if free is None else free)

    @classmethod
    def of(cls, setup: MeasurementSetup, free: frozenset[str]) -> "Model":
        """Build the model; parameters stand in the order in which they are preferred when some depend on others.

        What places the gauge comes first: it is known worst.
        """
        return cls(setup, (*gauge_parameters(setup, free), *robot_parameters(setup)))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters in order."""
        return tuple(p.name for p in self.parameters)

    @cached_property
    def parameters_and_fixed(self) -> tuple[object, ...]:
        """What decides the model's predictions, prior sizes aside."""
        return (*(p.moves for p in self.parameters), *((p.moves, value) for p, value in self.fixed))

    @cached_property
    def prior(self) -> Array:
        """One-sigma prior sizes, (P,) in the parameters' units."""
        return np.array([p.prior for p in self.parameters])

    @property
    def width(self) -> int:
        """Numbers r in one reading: 1, 3 or 6."""
        return self.setup.gauge.width

    def subset(self, kept: list[int]) -> "Model":
        """Return the model with only the parameters at the positions ``kept``."""
        return replace(self, parameters=tuple(self.parameters[k] for k in kept))

    def with_prior(self, prior: Array) -> "Model":
        """Return the model with other prior sizes, (P,) in the parameters' units."""
        sized = (replace(p, prior=s) for p, s in zip(self.parameters, prior.tolist(), strict=True))
        out = replace(self, parameters=tuple(sized))
        # the moves are the same: what was laid out for them serves again
        out.__dict__.update({k: v for k, v in self.__dict__.items() if k in LAYOUTS})
        return out

    def plus(self, more: list[Parameter]) -> "Model":
        """Return the model with more parameters."""
        return replace(self, parameters=(*self.parameters, *more))

    def before(self, first: list[Parameter]) -> "Model":
        """Return the model with more parameters, preferred to those it has."""
        return replace(self, parameters=(*first, *self.parameters))

    def fixing(self, errors: Array) -> "Model":
        """Return the model with every parameter fixed at ``errors`` (P,)."""
        return replace(self, parameters=(), fixed=(*self.fixed, *zip(self.parameters, errors, strict=True)))

    def reading(self, samples: Samples, errors: Array | None = None) -> Array:
        """Predict the readings, (n, r) [m, rad]; ``errors`` (P,) are the parameters' values, zero if not given."""
        return -self.residual(samples, self.setup.gauge.zero_targets(len(samples)), errors)

    def rows(self, samples: Samples, errors: Array | None = None) -> Array:
        """Identification Jacobian, (n, r, P) [m/m, m/rad, …] (EDBB paper, eq. 4); readings do not matter to it."""
        out = np.empty((len(samples), self.width, len(self.parameters)))
        for part in chunks(len(samples)):
            out[part] = self.linear_in(Context(self.setup, samples.take(part)), None, errors).rows
        return out

    def residual(self, samples: Samples, targets: Targets, errors: Array | None = None) -> Array:
        """Reading − prediction, (n, r) [m, rad]."""
        out = np.empty((len(samples), self.width))
        for part in chunks(len(samples)):
            out[part] = self.residual_in(Context(self.setup, samples.take(part)), targets.take(part), errors)
        return out

    def residual_in(self, context: Context, targets: Targets, errors: Array | None = None) -> Array:
        """Reading − prediction for the samples of a context, (n, r) [m, rad]."""
        motion, shown = self._pass(context, errors)
        return np.asarray(self._residual(context, motion, targets) - shown)

    def linear(self, samples: Samples, targets: Targets, errors: Array | None = None) -> Linearization:
        """Residuals and Jacobian of some samples in one forward pass."""
        parts = [
            self.linear_in(Context(self.setup, samples.take(part)), targets.take(part), errors)
            for part in chunks(len(samples))
        ]
        return Linearization(np.concatenate([p.residual for p in parts]), np.concatenate([p.rows for p in parts]))

    def noise(self, samples: Samples) -> Array:
        """Standard deviation of one reading, (n,) [m]."""
        return self.reading_noise(samples).std

    def reading_noise(self, samples: Samples) -> ReadingNoise:
        """Return how much the readings of samples are declared to scatter."""
        return ReadingNoise(self.setup.gauge.sigmas, self.setup.joint_sigma, self.joint_rows(samples))

    @property
    def joint_sigma(self) -> float:
        """Standard deviation of one joint's angle [rad] that explains the published repeatability."""
        return self.setup.joint_sigma

    def joint_rows(self, samples: Samples) -> Array:
        """Derivative of the reading by the controller's joint angles, (n, r, N) [m/rad, rad/rad]."""
        robot = self.setup.robot
        which = self.setup.chain.joint_places
        out = np.empty((len(samples), self.width, robot.n_joints))
        for part in chunks(len(samples)):
            context = Context(self.setup, samples.take(part))
            motion = self.setup.chain.forward(context.theta, self.setup.offsets(context.samples))
            out[part] = np.einsum("krn,kj->nrj", self._project(context, motion, which), robot.sense_matrix)
        return out

    def _pass(self, context: Context, errors: Array | None) -> tuple[ForwardPass, Array]:
        """Forward pass with the errors in place, and what they add to the reading itself, (n, r)."""
        delta = self.setup.offsets(context.samples)
        shown = np.zeros((len(context.samples), self.width))
        free = [] if errors is None else errors.tolist()
        # what stands at zero is not looked at: a run may lack what its function needs
        moved = [p for p, v in zip(self.parameters, free, strict=False) if v]
        layout = self._layout if all(free) else _MoveLayout.of(moved)
        values = [v for v in free if v]
        for moves, sizes in ((layout if values else None, values), (self._fixed_layout, self._fixed_values)):
            if moves is None:
                continue
            phi = context.values(moves.functions)
            for k, on_transform, index, f in moves.moves:
                if on_transform:
                    delta[index] = delta[index] + sizes[k] * phi[f]
                else:
                    shown[:, index] += sizes[k] * phi[f]
        return self.setup.chain.forward(context.theta, delta), shown

    def linear_in(self, context: Context, targets: Targets | None, errors: Array | None = None) -> Linearization:
        """Residuals and Jacobian for the samples of a context; without targets the residuals mean nothing."""
        motion, shown = self._pass(context, errors)
        residual = shown if targets is None else self._residual(context, motion, targets) - shown
        layout = self._layout
        which = layout.transforms
        projected = dict(zip(which.tolist(), self._project(context, motion, which), strict=True))
        phi = context.values(layout.functions)
        columns = np.empty((len(self.parameters), self.width, len(context.samples)))  # samples side by side: quick
        columns[layout.several] = 0.0
        several = set(layout.several)
        for k, on_transform, index, f in layout.moves:
            if not on_transform:
                columns[k, index] += phi[f]
            elif k in several:
                columns[k] += projected[index] * phi[f]
            else:
                np.multiply(projected[index], phi[f], out=columns[k])
        return Linearization(residual, columns.transpose(2, 1, 0))

    @cached_property
    def _layout(self) -> "_MoveLayout":
        return _MoveLayout.of(self.parameters)

    @cached_property
    def _fixed_values(self) -> list[float]:
        return [float(v) for _, v in self.fixed if v]

    @cached_property
    def _fixed_layout(self) -> "_MoveLayout | None":
        return _MoveLayout.of([p for p, v in self.fixed if v]) if self._fixed_values else None

    def _project(self, context: Context, motion: ForwardPass, which: np.ndarray) -> Array:
        """Change of the reading per unit of each transform, (k, r, n)."""
        return self.setup.gauge.project(self.setup, context.samples, motion, which)

    def _residual(self, context: Context, motion: ForwardPass, targets: Targets) -> Array:
        return self.setup.gauge.residual(self.setup, context.samples, motion, targets)


@dataclass(frozen=True)
class _MoveLayout:
    """All moves of some parameters, each basis function once.

    Attributes:
        moves: position of the parameter, whether it is a transform that moves (else the reading), its index, and the
            position of the function.
        functions: every function.
        transforms: indices of those that move.
        several: positions of parameters that are more than one move of a transform.
    """

    moves: tuple[tuple[int, bool, int, int], ...]
    functions: tuple[BasisFunction, ...]
    transforms: np.ndarray
    several: list[int]

    @classmethod
    def of(cls, parameters: Sequence[Parameter]) -> "_MoveLayout":
        """Lay out the moves of parameters."""
        functions = dict[BasisFunction, int]()
        moves = tuple(
            (k, m.on == "transform", m.index, functions.setdefault(m.phi, len(functions)))
            for k, p in enumerate(parameters) for m in p.moves
        )  # fmt: skip
        transforms = np.array(sorted({index for _, on_transform, index, _ in moves if on_transform}), dtype=int)
        several = [k for k, p in enumerate(parameters) if len(p.moves) > 1 or p.main.on != "transform"]
        return cls(moves, tuple(functions), transforms, several)


def chunks(n: int) -> Iterator[slice]:
    """Slices of at most ``CHUNK`` samples."""
    for start in range(0, n, CHUNK):
        yield slice(start, min(start + CHUNK, n))
