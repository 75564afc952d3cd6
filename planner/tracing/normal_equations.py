"""Normal equations of a model from which columns go and to which new ones come."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.linalg.lapack import dtrtri

from planner.common.units import Array
from planner.effects.effect import Parameter
from planner.model.columns import Columns


@dataclass(frozen=True)
class AddedColumns:
    """Parameters that come to a state, and their whitened columns per prior size."""

    parameters: tuple[Parameter, ...]
    columns: Columns


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

    def beside(self, gram: Array, products: Array, added: Columns) -> Array:
        """Return the products of what stays, of new columns and of the residual, (q + k + 1, q + k + 1).

        Args:
            gram: of all columns of the state and the residual, (P + 1, P + 1).
            products: of these with the new columns, (P + 1, k).
            added: the new columns.
        """
        q, k = len(self.kept), len(added)
        cross = self.reduce_products(products)
        out = np.empty((q + k + 1, q + k + 1))
        place, new = np.append(np.arange(q), q + k), np.arange(q, q + k)
        out[np.ix_(place, place)] = self.reduce(gram)
        out[np.ix_(place, new)], out[np.ix_(new, place)] = cross, cross.T
        out[np.ix_(new, new)] = added.gram
        return out


@dataclass(frozen=True)
class NewtonStep:
    """Step (P,) in prior sizes to the minimum, the triangle R (P, P) of the information, and effective parameters."""

    move: Array
    factor: Array
    effective: float

    @classmethod
    def of(cls, gram: Array, z: Array, ease: float) -> "NewtonStep":
        """Solve for the step from z (P,) by products (P + 1, P + 1) with a noise of ``ease`` times the variance."""
        factor = cholesky(gram[:-1, :-1] / ease + np.eye(len(z)))
        move = solve_triangular(factor, solve_triangular(factor, gram[:-1, -1] / ease - z, trans="T"))
        return cls(np.asarray(move), factor, float(len(z) - (dtrtri(factor)[0] ** 2).sum()))

    def square(self, gram: Array) -> float:
        """Sum of squares of the residual after the step, by products (P + 1, P + 1)."""
        return float(gram[-1, -1] - 2 * gram[-1, :-1] @ self.move + self.move @ gram[:-1, :-1] @ self.move)
