"""The space that the columns of models span about one fit, and what of other columns lies in it.

The models of a search differ by a few columns. A space therefore grows by what a model has beyond another one, and a
model that lacks some of its columns is a part of it: products of a dictionary of effects with a basis, which cost most
of a score test, are formed once for each basis vector.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.linalg.blas import dtrsm

from planner.common.units import Array
from planner.effects.effect import Parameter, ParameterMove
from planner.fit.problem import FitProblem
from planner.kinematics.chain import ForwardPass
from planner.model.row_basis import posterior_basis
from planner.tracing.dictionary import EffectDictionary, WhitenedDictionary, whiten


@dataclass(frozen=True)
class SpaceMemory:
    """What all spaces about one fit share: columns of kept dictionaries, by identity, and of things that may step."""

    dictionaries: dict[int, WhitenedDictionary] = field(default_factory=dict)
    steps: dict[tuple[Parameter, ...], Array] = field(default_factory=dict)


@dataclass(frozen=True)
class ColumnSpace:
    """Columns of models about one fit, whitened, each with its prior's row below.

    Attributes:
        problem: the model that the columns are linearised about, on the samples that are screened.
        motion: forward pass of these about its fit.
        weight: of the prior's rows.
        parameters: of the columns, (P,), in the sizes that ``problem`` had them in, and ``before``'s first.
        block: rows (m, k), readings only, of the orthonormal vectors that the last k columns add.
        triangle: R (P, P), columns = vectors · R.
        before: the space without these k, if any.
    """

    problem: FitProblem
    motion: ForwardPass
    weight: float
    parameters: tuple[Parameter, ...]
    block: Array
    triangle: Array
    before: "ColumnSpace | None" = None
    memory: SpaceMemory = field(default_factory=SpaceMemory, repr=False, compare=False)
    _projections: dict[int, Array] = field(default_factory=dict, init=False, repr=False, compare=False)
    _informations: dict[int, list[Array]] = field(default_factory=dict, init=False, repr=False, compare=False)
    _sums: dict[str, Array] = field(default_factory=dict, init=False, repr=False, compare=False)

    @classmethod
    def of(cls, problem: FitProblem, errors: Array, weight: float) -> "ColumnSpace":
        """Return the space of a problem's own columns about ``errors`` (P,)."""
        rows = problem.white_columns(errors).rows
        Q, R = posterior_basis(rows.reshape(-1, rows.shape[2]), weight)
        motion = problem.model.motion(problem.context, errors)
        return cls(problem, motion, weight, problem.model.parameters, Q, R)

    def __len__(self) -> int:
        """Return the number of columns P."""
        return len(self.parameters)

    def with_parameters(self, parameters: Sequence[Parameter]) -> "ColumnSpace":
        """Return the space with the columns of parameters, those that it has as they are."""
        new = tuple(p for p in parameters if (p.name, p.moves) not in self._place)
        if not new:
            return self
        A = self._columns(new).reshape(-1, len(new)) * np.array([p.prior for p in new])
        shared = self.products(A)
        # with the prior's rows, of which the new ones are their own, never below the prior's weight
        R = cholesky(A.T @ A - shared.T @ shared + self.weight * np.eye(len(new)))
        block = dtrsm(1.0, R, (A - self.combine(shared)).T, trans_a=1).T
        P, k = len(self), len(new)
        triangle = np.zeros((P + k, P + k))
        triangle[:P, :P], triangle[:P, P:], triangle[P:, P:] = self.triangle, shared, R
        return replace(
            self, parameters=(*self.parameters, *new), block=block, triangle=triangle, before=self, memory=self.memory
        )

    def find_missing_part(self, parameters: Sequence[Parameter]) -> Array:
        """Return the orthonormal part (P, k), in this space's vectors, that the columns of parameters do not span."""
        own = {self._place[p.name, p.moves] for p in parameters}
        left = [j for j in range(len(self)) if j not in own]
        if not left:
            return np.zeros((len(self), 0))
        # across all columns that stay: with x = R⁻ᵀ e, Rᵀ x has nothing but what is gone
        return np.asarray(np.linalg.qr(solve_triangular(self.triangle, np.eye(len(self))[:, left], trans="T"))[0])

    def products(self, columns: Array) -> Array:
        """Return the products (P, k) of the basis vectors with columns (m, k)."""
        return np.concatenate([vectors.T @ columns for vectors in self._vectors])

    def combine(self, parts: Array) -> Array:
        """Return the sum (m, k) of the basis vectors, each times its row of ``parts`` (P, k)."""
        first, *later = self._vectors
        out = first @ parts[: first.shape[1]]
        for vectors in later:
            out += vectors @ parts[first.shape[1] :]
        return np.asarray(out)

    @cached_property
    def _vectors(self) -> list[Array]:
        """The basis vectors: those of the first space, and behind them, side by side, what was added since."""
        added, space = list[Array](), self
        while space.before is not None:
            added.append(space.block)
            space = space.before
        return [space.block, *([np.concatenate(added[::-1], axis=1)] if added else [])]

    def project(self, columns: WhitenedDictionary) -> Array:
        """Return the products of a dictionary's columns with the basis vectors, (width, P)."""
        own = columns.project(self.block)
        return own if self.before is None else np.concatenate([self.before.project(columns), own], axis=1)

    def whiten(self, dictionary: EffectDictionary) -> WhitenedDictionary:
        """Return the columns of a kept dictionary."""
        known = self.memory.dictionaries
        if id(dictionary) not in known:
            known[id(dictionary)] = WhitenedDictionary.of(dictionary, self.problem, self.motion)
        return known[id(dictionary)]

    def information_blocks(self, dictionary: EffectDictionary) -> list[Array]:
        """Return the information of a kept dictionary's items beyond the space, (K, k, k) for its equal items."""
        key = id(dictionary)
        if key not in self._informations:
            columns = self.whiten(dictionary)
            known = columns.squares if self.before is None else self.before.information_blocks(dictionary)
            own = products_of_items(dictionary, self._project(dictionary))
            self._informations[key] = [square - W for square, W in zip(known, own, strict=True)]
        return self._informations[key]

    def project_on(self, dictionary: EffectDictionary, parts: Array) -> Array:
        """Return the products of a kept dictionary's columns with combinations (P, k) of the basis, (width, k)."""
        own = self._project(dictionary)
        first = len(parts) - own.shape[1]
        out = own @ parts[first:].astype(own.dtype)
        return np.asarray(out if self.before is None else out + self.before.project_on(dictionary, parts[:first]))

    def step_columns(self, parameters: tuple[Parameter, ...]) -> Array:
        """Return the whitened columns (n, r, k) of what may step, as it would act all along."""
        known = self.memory.steps
        if parameters not in known:
            known[parameters] = self._columns(parameters)
        return known[parameters]

    def _columns(self, parameters: tuple[Parameter, ...]) -> Array:
        """Whitened columns (n, r, k) of parameters, per their own units."""
        rows = replace(self.problem.model, parameters=parameters).columns(self.problem.context, self.motion).dense
        return whiten(self.problem, rows.transpose(2, 1, 0))

    def _project(self, dictionary: EffectDictionary) -> Array:
        """Products of a kept dictionary's columns with the block, (width, k)."""
        key = id(dictionary)
        if key not in self._projections:
            # of many rows to single precision: nothing hangs on a share of a millionth of what a column explains
            # 1_000_000: of a Jacobian, up to which a kept dictionary is projected in double precision
            many = len(self.block) * len(self) > 1_000_000
            self._projections[key] = self.whiten(dictionary).project(self.block, single=many)
        return self._projections[key]

    def sums_before(self, columns: Array, name: str) -> Array:
        """Return the information (n − 1, k, k) of columns (n, r, k) beyond the space up to each sample but the last.

        It is kept under the name of the thing that they are of.
        """
        if name not in self._sums:
            if self.before is None:
                known = np.cumsum(columns.transpose(0, 2, 1) @ columns, axis=0)[:-1]
            else:
                known = self.before.sums_before(columns, name)
            self._sums[name] = known - squares_before(self.block, columns)
        return self._sums[name]

    @cached_property
    def own_information(self) -> Array:
        """What each sample's own reading is worth beyond all others, (n, r, r)."""
        r = self.problem.model.width
        known = np.eye(r) if self.before is None else self.before.own_information
        return known - row_products(self.block, r)

    @cached_property
    def _place(self) -> dict[tuple[str, tuple[ParameterMove, ...]], int]:
        """Position of each column by its name and what it moves."""
        return {(p.name, p.moves): k for k, p in enumerate(self.parameters)}


def products_of_items(dictionary: EffectDictionary, projection: Array) -> list[Array]:
    """Return W Wᵀ of each item's rows W of the projection; (K, k, k) for the K items with k parameters, for each k."""
    return [_squares(projection, equal.columns) for equal in dictionary.equal_items]


def _squares(projection: Array, rows: np.ndarray) -> Array:
    """Products (K, k, k) with each other of the ``rows`` (K, k) of a projection, few at a time as in the cache."""
    out = np.empty((*rows.shape, rows.shape[1]))
    # 50_000: numbers stay in a processor's cache while they are worked on
    few = max(1, 50_000 // max(1, rows.shape[1] * projection.shape[1]))
    for first in range(0, len(rows), few):
        W = projection[rows[first : first + few]].astype(float, copy=False)
        out[first : first + few] = W @ W.transpose(0, 2, 1)
    return out


def squares_before(basis: Array, columns: Array) -> Array:
    """Return WᵀW (n − 1, k, k) of the products W of basis vectors (n r, p) with columns (n, r, k) up to each sample."""
    n, r, _ = columns.shape
    W = np.cumsum(basis.reshape(n, r, -1).transpose(0, 2, 1) @ columns, axis=0)[:-1]
    return np.asarray(W.transpose(0, 2, 1) @ W)


def row_products(vectors: Array, width: int) -> Array:
    """Return V Vᵀ (n, r, r) of the r rows V (r, p) that each of n readings has in ``vectors`` (n r, p)."""
    each = vectors.reshape(len(vectors) // width, width, vectors.shape[1])
    return np.asarray(each @ each.transpose(0, 2, 1))
