"""The least-squares problem: model, samples, readings and noise."""

from collections.abc import Hashable, Set
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from planner.cell.placement import Targets
from planner.common.units import Array
from planner.effects.context import Context
from planner.fit.noise import Noise, Whitener
from planner.model.columns import Columns
from planner.model.model import Linearization, Model
from planner.runs.run import Run, Samples


@dataclass
class ProblemCache:
    """Cache of a problem: basis functions, those of parts of its samples, and the last linearisation.

    ``folds`` are the columns that a fit ended with, until the first that asks for them.
    """

    context: Context | None = None
    parts: dict[bytes, Context] = field(default_factory=dict)
    linear: tuple[tuple[object, bytes], Linearization] | None = None
    folds: "FoldColumns | None" = None

    def forget(self, kept: Set[Hashable] = frozenset()) -> None:
        """Let go of the linearisation and of basis functions but some: they are computed anew when asked for."""
        self.linear = self.folds = None
        for context in (self.context, *self.parts.values()):
            if context is not None:
                context.forget_values(kept)


@dataclass(frozen=True)
class WhitenedColumns:
    """Whitened columns per prior sigma, the residual's behind them."""

    factored: Columns

    @property
    def columns(self) -> Array:
        """All columns and behind them the residual, as one dense array (P + 1, r, n)."""
        return self.factored.dense

    @property
    def residual(self) -> Array:
        """Whitened residuals, (n, r)."""
        return np.asarray(self.factored.plain[-1].T)

    @property
    def rows(self) -> Array:
        """Whitened rows, (n, r, P)."""
        return np.asarray(self.columns[:-1].transpose(2, 1, 0))

    @property
    def gram(self) -> Array:
        """Products of all columns with each other, (P + 1, P + 1)."""
        return self.factored.gram

    def along(self, white: Array) -> Array:
        """Return the products of all columns with a whitened residual (n, r), (P + 1,)."""
        return self.factored.along(white)


@dataclass(frozen=True)
class FoldColumns:
    """The same, the samples by the folds in which they are held out.

    Attributes:
        problem: whose columns they are.
        fold: of every sample, (n,) int from 0.
        samples: positions of the samples of each fold.
        columns: of each fold, the residual's behind them.
        grams: their products, (folds, P + 1, P + 1).
    """

    problem: "FitProblem"
    fold: np.ndarray
    samples: tuple[np.ndarray, ...]
    columns: tuple[Columns, ...]
    grams: Array

    @classmethod
    def of(cls, problem: "FitProblem", errors: Array, fold: np.ndarray) -> "FoldColumns":
        """Linearise about ``errors``."""
        samples = tuple(np.flatnonzero(fold == f) for f in range(int(fold.max()) + 1))
        whole = problem.white_columns(errors).factored
        columns = tuple(whole.take(own) for own in samples)
        return cls(problem, fold, samples, columns, np.stack([c.gram for c in columns]))

    @property
    def gram(self) -> Array:
        """Products of all columns with each other, (P + 1, P + 1)."""
        return np.asarray(self.grams.sum(axis=0))

    def along(self, white: Array) -> Array:
        """Return the products of all columns with a whitened residual (n, r), (P + 1,)."""
        return np.asarray(sum(c.along(white[own]) for c, own in zip(self.columns, self.samples, strict=True)))

    def grams_with(self, white: Array) -> Array:
        """Return the products with another whitened residual (n, r) behind the columns, (folds, P + 1, P + 1)."""
        out = self.grams.copy()
        for gram, c, own in zip(out, self.columns, self.samples, strict=True):
            gram[-1] = gram[:, -1] = c.along(white[own])
            gram[-1, -1] = (white[own] ** 2).sum()
        return out


@dataclass(frozen=True)
class FitProblem:
    """A model to be fitted to readings.

    Attributes:
        model: with its parameters.
        samples, targets: of the run.
        whitener: noise of every reading.
        weight: by how much every sample counts, (n,): 1 but for those outside the noise (``wild_rows``).
    """

    model: Model
    samples: Samples
    targets: Targets
    whitener: Whitener
    weight: Array
    memory: "ProblemCache" = field(default_factory=lambda: ProblemCache(), repr=False, compare=False)

    @classmethod
    def of(cls, model: Model, run: Run, noise: Noise | None = None, even: bool = False) -> "FitProblem":
        """Set up the fit of a model to a run.

        ``even`` gives every sample the same noise, for a model that is known to be off.
        """
        white = Whitener.of(model, run.samples, noise)
        if even:
            white = replace(white, shaken=np.zeros_like(white.shaken))
        return cls(model, run.samples, model.setup.targets(run.samples, run.readings), white, np.ones(len(run)))

    def restart_with(self, model: Model, noise: Noise | None = None, even: bool = False) -> "FitProblem":
        """Return the fit of another model of the same setup to the same run, unweighted; see :meth:`of`.

        What basis functions look at is computed once for both.
        """
        white = self.whitener if not even else replace(self.whitener, shaken=np.zeros_like(self.whitener.shaken))
        memory = ProblemCache(self.context, self.memory.parts)
        return FitProblem(model, self.samples, self.targets, white.with_noise(noise or Noise()), self.weight, memory)

    def __len__(self) -> int:
        """Return the number of samples n."""
        return len(self.samples)

    @cached_property
    def prior(self) -> Array:
        """Prior sigmas of the parameters, (P,)."""
        return self.model.prior

    def take(self, which: np.ndarray) -> "FitProblem":
        """Return the problem with only the samples at ``which`` (indices or a mask)."""
        white = self.whitener.take(which)
        key = np.arange(len(self))[which].tobytes()
        context = self.memory.parts.setdefault(key, self.context.take(which))
        known = self.targets.take(which), white, self.weight[which], ProblemCache(context)
        return FitProblem(self.model, context.samples, *known)

    def with_model(self, model: Model) -> "FitProblem":
        """Return the problem with other parameters of the same setup."""
        return replace(self, model=model)

    def with_noise(self, noise: Noise) -> "FitProblem":
        """Return the problem with another size of the noise."""
        return replace(self, whitener=self.whitener.with_noise(noise))

    def linearize(self, errors: Array) -> Linearization:
        """Return residuals and Jacobian rows at ``errors`` (P,), in metres and radians."""
        about = (self.model.parameters_and_constants, errors.tobytes())
        known = self.memory.linear  # read once: several fits may look at one problem at a time
        if known is None or known[0] != about:
            known = self.memory.linear = about, self.model.linearize_in(self.context, self.targets, errors)
        return known[1]

    @property
    def context(self) -> Context:
        """Context of the basis functions, cached."""
        if self.memory.context is None:
            self.memory.context = Context(self.model.setup, self.samples)
        return self.memory.context

    def white_columns(self, errors: Array) -> WhitenedColumns:
        """Linearise about ``errors``, whitened."""
        linear = self.linearize(errors)
        root = np.ascontiguousarray((self.whitener.root * np.sqrt(self.weight)[:, None, None]).T)
        return WhitenedColumns(linear.columns.whiten(root, self.prior, linear.residual))

    def residual(self, errors: Array) -> Array:
        """Reading − prediction of every sample, (n, r) [m, rad]."""
        return self.linearize(errors).residual

    def weighted_residual(self, errors: Array) -> Array:
        """Return the residual in standard deviations, each row as far as it counts, (n, r)."""
        return np.asarray(self.white_residual(errors) * np.sqrt(self.weight)[:, None])

    def white_residual(self, errors: Array) -> Array:
        """Return the residual in standard deviations, each row in full, (n, r)."""
        return self.whitener.white(self.residual(errors)[..., None])[..., 0]
