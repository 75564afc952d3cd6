"""Predicted reading and identification Jacobian of a setup: one list of parameters for planning, fitting and tracing.

A parameter is a pair of what it moves (an elementary transform, or the reading itself) and a basis function φ of the
sample. For a geometric error φ is 1, for a fixture it tells which fixture holds the bar, for a compliance it is the
joint's torque. A column of the Jacobian is the screw of the transform, projected by the gauge, times φ.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.cell.cell import Cell, MeasurementSetup, setup_of
from planner.cell.placement import Targets
from planner.common.units import CACHED_ROWS, Array
from planner.effects.basis import BasisFunction
from planner.effects.context import Context, Stack
from planner.effects.effect import Parameter, robot_parameters
from planner.effects.gauge_unknowns import unknowns_of
from planner.kinematics.chain import ForwardPass
from planner.model.columns import Columns
from planner.model.reading_noise import ReadingNoise
from planner.runs.run import Samples


@dataclass(frozen=True)
class Linearization:
    """The model about some errors: residuals reading − prediction (n, r) and columns of the Jacobian."""

    residual: Array
    columns: Columns

    @property
    def rows(self) -> Array:
        """Identification Jacobian, (n, r, P)."""
        return self.columns.dense.transpose(2, 1, 0)


@dataclass(frozen=True)
class Model:
    """The measurement model of one setup with a list of parameters; ``fixed`` ones stand at the value beside them."""

    setup: MeasurementSetup
    parameters: tuple[Parameter, ...]
    fixed: tuple[tuple[Parameter, float], ...] = ()

    def __repr__(self) -> str:
        """Name robot and gauge, and say how many parameters there are."""
        named = f"'{self.setup.robot.name}', gauge='{self.setup.gauge.kind}'"
        return f"Model({named}, parameters={len(self.parameters)})"

    @classmethod
    def from_cell(cls, cell: Cell, free: frozenset[str] | None = None) -> "Model":
        """Build the model of a cell with the parameters that its ``[plan] free`` allows."""
        return cls.of(setup_of(cell), cell.plan.free if free is None else free)

    @classmethod
    def of(cls, setup: MeasurementSetup, free: frozenset[str]) -> "Model":
        """Build the model; parameters stand in the order in which they are preferred when some depend on others.

        What places the gauge comes first: it is known worst.
        """
        parameters = (*unknowns_of(setup.gauge).parameters(setup, free), *robot_parameters(setup))
        stated = setup.robot.priors
        return cls(setup, tuple(p.with_prior(stated.size(p.name, p.prior)) for p in parameters))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters in order."""
        return tuple(p.name for p in self.parameters)

    @cached_property
    def parameters_and_constants(self) -> tuple[object, ...]:
        """What decides the model's predictions, prior sigmas aside."""
        return (*(p.moves for p in self.parameters), *((p.moves, value) for p, value in self.fixed))

    @cached_property
    def prior(self) -> Array:
        """One-sigma prior sigmas, (P,) in the parameters' units."""
        return np.array([p.prior for p in self.parameters])

    @property
    def width(self) -> int:
        """Numbers r in one reading: 1, 3 or 6."""
        return self.setup.gauge.width

    def subset(self, kept: list[int]) -> "Model":
        """Return the model with only the parameters at the positions ``kept``."""
        return replace(self, parameters=tuple(self.parameters[k] for k in kept))

    def with_prior(self, prior: Array) -> "Model":
        """Return the model with other prior sigmas, (P,) in the parameters' units."""
        sized = (p.with_prior(s) for p, s in zip(self.parameters, prior.tolist(), strict=True))
        out = replace(self, parameters=tuple(sized))
        same = ("_layout", "_blocks", "_plain_layout", "_fixed_values", "_fixed_layout")  # whatever the prior sigmas
        out.__dict__.update({name: self.__dict__[name] for name in same if name in self.__dict__})
        return out

    def plus(self, more: list[Parameter]) -> "Model":
        """Return the model with more parameters."""
        return replace(self, parameters=(*self.parameters, *more))

    def with_first(self, first: list[Parameter]) -> "Model":
        """Return the model with more parameters, preferred to those it has."""
        return replace(self, parameters=(*first, *self.parameters))

    def fix_at(self, errors: Array) -> "Model":
        """Return the model with every parameter fixed at ``errors`` (P,)."""
        return replace(self, parameters=(), fixed=(*self.fixed, *zip(self.parameters, errors, strict=True)))

    def reading(self, samples: Samples, errors: Array | None = None) -> Array:
        """Predict the readings, (n, r) [m, rad]; ``errors`` (P,) are the parameters' values, zero if not given."""
        return -self.residual(samples, Targets.at_base(len(samples)), errors)

    def rows(self, samples: Samples, errors: Array | None = None) -> Array:
        """Identification Jacobian, (n, r, P) [m/m, m/rad, …] (EDBB paper, eq. 4); readings do not matter to it."""
        out = np.empty((len(samples), self.width, len(self.parameters)))
        for part in chunks(len(samples)):
            out[part] = self.linearize_in(Context(self.setup, samples.take(part)), None, errors).rows
        return out

    def full_reading(self, samples: Samples, errors: Array | None = None) -> Array:
        """Predict all numbers that the gauge shows before it brings them together into readings, (n, m)."""
        context = Context(self.setup, samples)
        motion, shown = self._pass(context, errors)
        return self.setup.gauge.full_reading(self.setup, context.samples, motion, shown)

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

    def linearize(self, samples: Samples, targets: Targets, errors: Array | None = None) -> Linearization:
        """Residuals and Jacobian of some samples in one forward pass."""
        parts = [
            self.linearize_in(Context(self.setup, samples.take(part)), targets.take(part), errors)
            for part in chunks(len(samples))
        ]
        return Linearization(np.concatenate([p.residual for p in parts]), Columns.join([p.columns for p in parts]))

    def noise(self, samples: Samples) -> Array:
        """Standard deviation of one reading, (n,) [m]."""
        return self.reading_noise(samples).std

    def reading_noise(self, samples: Samples) -> ReadingNoise:
        """Return how much the readings of samples are declared to scatter."""
        return ReadingNoise(self.setup.gauge.sigmas_of(samples), self.setup.joint_sigma, self.joint_rows(samples))

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
            out[part] = np.einsum("krn,kj->nrj", self._project(context, motion, which), robot.coupling_matrix)
        return out

    def _pass(self, context: Context, errors: Array | None) -> tuple[ForwardPass, Array]:
        """Forward pass with the errors in place, and what they add to the reading itself, (n, r)."""
        delta = self.setup.offsets(context.samples)
        shown = np.zeros((len(context.samples), self.width))
        for moves, sizes in (self._moving(context, delta, errors), (self._fixed_layout, self._fixed_values)):
            if moves is None:
                continue
            phi = context.values(moves.functions)
            for k, on_transform, index, f in moves.moves:
                if on_transform:
                    delta[index] = delta[index] + sizes[k] * phi[f]
                else:
                    shown[:, index] += sizes[k] * phi[f]
        return self.setup.chain.forward(context.theta, delta), shown

    def _moving(
        self, context: Context, delta: list[float | Array], errors: Array | None
    ) -> tuple["_MoveLayout | None", list[float]]:
        """Return the moves that errors (P,) make and their sizes, but those that are added to ``delta`` here.

        What stands side by side in the context is added up by one product for each transform. Of others those at zero
        are not looked at: a run may lack what their function needs.
        """
        free = [] if errors is None else errors.tolist()
        stacks = None if errors is None else context.known_stacks(self._blocks.stacks)
        if errors is not None and stacks:
            blocks = self._blocks
            for index, at, phi in zip(blocks.block_transforms, blocks.phi_at, stacks, strict=True):
                delta[index] = delta[index] + errors[at] @ phi
            return self._plain_layout, free
        moved = [p for p, v in zip(self.parameters, free, strict=False) if v]
        values = [v for v in free if v]
        return (None if not values else self._layout if all(free) else _MoveLayout.of(moved)), values

    def linearize_in(self, context: Context, targets: Targets | None, errors: Array | None = None) -> Linearization:
        """Residuals and Jacobian for the samples of a context; without targets the residuals mean nothing."""
        motion, shown = self._pass(context, errors)
        residual = shown if targets is None else self._residual(context, motion, targets) - shown
        return Linearization(residual, self.columns(context, motion))

    def motion(self, context: Context, errors: Array) -> ForwardPass:
        """Forward pass of the samples of a context with errors (P,)."""
        return self._pass(context, errors)[0]

    def columns(self, context: Context, motion: ForwardPass) -> Columns:
        """Columns of the Jacobian where the arm stands after a forward pass."""
        layout = self._blocks
        which = layout.transforms
        screws = self._project(context, motion, which)
        place = {int(index): k for k, index in enumerate(which)}
        phi = context.values(layout.functions)
        shape = (self.width, len(context.samples))
        plain = np.empty((len(layout.plain_at), *shape))  # samples side by side: quick
        plain[layout.several] = 0.0
        several = set(layout.several)
        for k, on_transform, index, f in layout.plain:
            if not on_transform:
                plain[k, index] += phi[f]
            elif k in several:
                plain[k] += screws[place[index]] * phi[f]
            else:
                np.multiply(screws[place[index]], phi[f], out=plain[k])
        functions = tuple(context.stacks(layout.stacks))
        own_screws = screws[[place[index] for index in layout.block_transforms]]
        return Columns(plain, layout.plain_at, own_screws, functions, layout.phi_at)

    @cached_property
    def _layout(self) -> "_MoveLayout":
        return _MoveLayout.of(self.parameters)

    @cached_property
    def _blocks(self) -> "_BlockLayout":
        return _BlockLayout.of(self._layout, len(self.parameters), self.width)

    @cached_property
    def _plain_layout(self) -> "_MoveLayout":
        """The moves of the parameters that stand for themselves, numbered among all."""
        plain = set(self._blocks.plain_at.tolist())
        return _MoveLayout(tuple(m for m in self._layout.moves if m[0] in plain), self._layout.functions)

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
    """

    moves: tuple[tuple[int, bool, int, int], ...]
    functions: tuple[BasisFunction, ...]

    @classmethod
    def of(cls, parameters: Sequence[Parameter]) -> "_MoveLayout":
        """Lay out the moves of parameters."""
        functions = dict[BasisFunction, int]()
        moves = tuple(
            (k, m.on == "transform", m.index, functions.setdefault(m.phi, len(functions)))
            for k, p in enumerate(parameters) for m in p.moves
        )  # fmt: skip
        return cls(moves, tuple(functions))


@dataclass(frozen=True)
class _BlockLayout:
    """The same, with the parameters that move one transform side by side.

    Attributes:
        functions: every function.
        transforms: indices of those that move.
        plain, plain_at: moves of the parameters that stand for themselves, numbered among each other, and where they
            stand among all.
        several: numbers of those among them that are more than one move of a transform.
        block_transforms, stacks, phi_at: index of the transform of each block; the functions of each of its parameters;
            and where these stand among all.
    """

    functions: tuple[BasisFunction, ...]
    transforms: np.ndarray
    plain: tuple[tuple[int, bool, int, int], ...]
    plain_at: np.ndarray
    several: list[int]
    block_transforms: tuple[int, ...]
    stacks: tuple[Stack, ...]
    phi_at: tuple[np.ndarray, ...]

    @classmethod
    def of(cls, layout: _MoveLayout, count: int, width: int) -> "_BlockLayout":
        """Lay out so many parameters; a reading of one number gains nothing from blocks."""
        own: list[list[tuple[bool, int, int]]] = [[] for _ in range(count)]
        for k, on_transform, index, f in layout.moves:
            own[k].append((on_transform, index, f))
        on: dict[int, list[int]] = {}
        for k, moves in enumerate(own):
            if width > 1 and len({(t, index) for t, index, _ in moves}) == 1 and moves[0][0]:
                on.setdefault(moves[0][1], []).append(k)
        # 4: parameters of one transform, below which their columns are laid out one by one
        blocks = {index: ks for index, ks in on.items() if len(ks) >= 4}
        taken = {k for ks in blocks.values() for k in ks}
        plain_at = [k for k in range(count) if k not in taken]
        plain = tuple((j, *move) for j, k in enumerate(plain_at) for move in own[k])
        several = [j for j, k in enumerate(plain_at) if len(own[k]) > 1 or not own[k][0][0]]
        return cls(
            layout.functions,
            np.array(sorted({index for _, on_transform, index, _ in layout.moves if on_transform}), dtype=int),
            plain,
            np.array(plain_at, dtype=int),
            several,
            tuple(blocks),
            tuple(tuple(tuple(layout.functions[f] for _, _, f in own[k]) for k in ks) for ks in blocks.values()),
            tuple(np.array(ks) for ks in blocks.values()),
        )


def chunks(n: int, most: int = CACHED_ROWS) -> Iterator[slice]:
    """Slices of at most so many samples."""
    for start in range(0, n, most):
        yield slice(start, min(start + most, n))
