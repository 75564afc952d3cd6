"""Normal equations of a model from which columns go and to which new ones come."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.linalg.lapack import dtrtri

from planner.common.units import Array
from planner.effects.effect import Parameter
from planner.identification.cross_validation import NO_INFORMATION, steps_without_folds
from planner.model.columns import Columns


@dataclass(frozen=True)
class RemainingColumns:
    """What stays of a state when effects go: their columns times what they were join the residual.

    Attributes:
        parameters: that stay.
        kept: their positions in the state, (q,).
        z: their values in prior sizes, (q,).
        part: of all columns and the residual in the new residual, (P + 1,).
    """

    parameters: tuple[Parameter, ...]
    kept: np.ndarray
    z: Array
    part: Array

    def reduce(self, gram: Array) -> Array:
        """Return products (q + 1, q + 1) of what stays and of the new residual from those of the state."""
        out = np.empty((len(self.kept) + 1,) * 2)
        along = gram @ self.part
        out[:-1, :-1] = gram[np.ix_(self.kept, self.kept)]
        out[:-1, -1] = out[-1, :-1] = along[self.kept]
        out[-1, -1] = self.part @ along
        return out

    def reduce_products(self, products: Array) -> Array:
        """Return the same (q + 1, k) of products (P + 1, k) with other columns."""
        return np.vstack([products[self.kept], self.part @ products])

    def residual(self, columns: Columns, added: Columns, step: Array) -> Array:
        """Return the residual (n, r), whitened, after a step (q + k,) of what stays and of new columns.

        ``columns``: of the state and the residual.
        """
        q, part = len(self.kept), self.part.copy()
        part[self.kept] = -step[:q]
        return columns.times(part) - added.times(step[q:])


@dataclass(frozen=True)
class FactoredEquations:
    """Normal equations with the prior's rows, RᵀR x = Rᵀ right: R (q, q) upper triangular, right (q,)."""

    factor: Array
    right: Array

    @classmethod
    def of(cls, gram: Array, z: Array) -> "FactoredEquations":
        """Factor them by products of columns and residual (q + 1, q + 1), for the step from z (q,) in prior sizes."""
        factor = cholesky(gram[:-1, :-1] + np.eye(len(z)), check_finite=False)
        return cls(factor, solve_triangular(factor, gram[:-1, -1] - z, trans="T", check_finite=False))

    def beside(self, products: Array, gram: Array) -> "FactoredEquations":
        """Return the equations with new columns added, whose parameters are still zero.

        Args:
            products: of the columns and of the residual with the new columns, (q + 1, k).
            gram: of the new columns, (k, k).
        """
        q, k = len(self.right), len(gram)
        shared = solve_triangular(self.factor, products[:-1], trans="T", check_finite=False)
        own = np.linalg.cholesky(gram + np.eye(k) - shared.T @ shared)
        factor = np.zeros((q + k, q + k))
        factor[:q, :q], factor[:q, q:], factor[q:, q:] = self.factor, shared, own.T
        return FactoredEquations(
            factor, np.append(self.right, np.linalg.solve(own, products[-1] - self.right @ shared))
        )

    @cached_property
    def step(self) -> Array:
        """The step x, (q,)."""
        return np.asarray(solve_triangular(self.factor, self.right, check_finite=False))

    @cached_property
    def effective(self) -> float:
        """Number of parameters that the readings decide."""
        return float(len(self.right) - (dtrtri(self.factor)[0] ** 2).sum())


@dataclass(frozen=True)
class FoldEquations:
    """Products of what stays of a state over each fold, (q + 1, q + 1), and the equations with and without each."""

    grams: tuple[Array, ...]
    whole: FactoredEquations
    without: tuple[FactoredEquations, ...]

    @classmethod
    def of(cls, grams: Array, rest: RemainingColumns) -> "FoldEquations":
        """Factor the equations of what stays by the state's products over the folds, (folds, P + 1, P + 1)."""
        own = tuple(rest.reduce(g) for g in grams)
        total = np.sum(own, axis=0)
        return cls(
            own, FactoredEquations.of(total, rest.z), tuple(FactoredEquations.of(total - g, rest.z) for g in own)
        )


@dataclass(frozen=True)
class WiderEquations:
    """The equations of what stays of a state and of new columns behind it.

    Attributes:
        base: of what stays.
        products: of its columns and of the residual with the new ones over each fold, (folds, q + 1, k).
        squares: products of the new columns with each other, (folds, k, k).
        z: values in prior sizes, (q + k,), the new ones at zero.
    """

    base: FoldEquations
    products: Array
    squares: Array
    z: Array

    @cached_property
    def whole(self) -> FactoredEquations:
        """The equations of all samples."""
        return self.base.whole.beside(self.products.sum(axis=0), self.squares.sum(axis=0))

    @property
    def steps_without_folds(self) -> Array:
        """The steps to the fits without each fold, (folds, q + k)."""
        own = zip(self.base.grams, self.squares, strict=True)
        length = np.stack([np.append(np.diag(g)[:-1], np.diag(s)) for g, s in own])
        if (length > (1 - NO_INFORMATION) * length.sum(axis=0)).any():  # what a fold alone knows is fitted on it
            every = np.full((1, len(self.z)), np.nan)
            return steps_without_folds(self._joined_grams, self.z, every, np.ones_like(every))[0]
        others = zip(self.products.sum(axis=0) - self.products, self.squares.sum(axis=0) - self.squares, strict=True)
        return np.stack([e.beside(*o).step for e, o in zip(self.base.without, others, strict=True)])

    @property
    def _joined_grams(self) -> Array:
        """Products over each fold with the residual's last, (folds, q + k + 1, q + k + 1)."""
        q, k = len(self.base.grams[0]) - 1, len(self.squares[0])
        order = np.r_[:q, q + 1 : q + k + 1, q]
        each = zip(self.base.grams, self.products, self.squares, strict=True)
        return np.stack([np.block([[g, p], [p.T, s]])[np.ix_(order, order)] for g, p, s in each])
