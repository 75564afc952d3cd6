"""Every effect of the catalogue at every nonlinear value, laid out so that all are scored by a few matrix products.

A column of an effect is the whitened screw of one transform, the same for all effects on it, times φ. Products with the
model's basis therefore need only φ itself: with Q_k = Σ_r screw_r · Q_r, the projection of a column is Q_kᵀ φ.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby

import numpy as np

from planner.common.units import Array
from planner.effects.context import Context
from planner.effects.effect import Effect, Parameter, ParameterMove, transform_move
from planner.fit.problem import FitProblem
from planner.kinematics.chain import ForwardPass
from planner.model.model import chunks

EffectAtValue = tuple[Effect, float | None]
LARGE = 20_000_000  # numbers of a dictionary, from which on its functions are held in single precision


@dataclass(frozen=True)
class DictionaryItem:
    """One effect at one value of its nonlinear parameter, and where the columns of its parameters stand."""

    effect: Effect
    value: float | None
    columns: slice


@dataclass(frozen=True)
class ColumnBlock:
    """All columns on one transform or number of the reading: φ per prior sigma (m, n), and which columns they are.

    Of a large dictionary φ is in single precision: nothing hangs on a millionth of what a column explains.
    """

    move: ParameterMove
    phi: np.ndarray
    columns: np.ndarray

    def products(self, seen: np.ndarray) -> np.ndarray:
        """Return the products (m, …) of all φ with what each sample shows (n, …), as precise as that is."""
        if self.phi.dtype == seen.dtype:
            return np.asarray(self.phi @ seen)
        out = np.empty((len(self.phi), *seen.shape[1:]), dtype=seen.dtype)
        # 256: rows at a time: a second copy of all φ would be most of what tracing keeps
        for part in chunks(len(out), 256):
            out[part] = self.phi[part].astype(seen.dtype) @ seen
        return out


@dataclass(frozen=True)
class EqualItems:
    """Items of k parameters each: their positions (K,), and the positions (K, k) of their columns."""

    items: np.ndarray
    columns: np.ndarray


@dataclass(frozen=True)
class EffectDictionary:
    """Effects laid out over the samples of a context.

    Attributes:
        items: in the order given.
        blocks: of the columns that move one thing.
        mixed: positions of the columns that move several things, and their parameters.
        width: number of columns.
    """

    context: Context
    items: tuple[DictionaryItem, ...]
    blocks: tuple[ColumnBlock, ...]
    mixed: dict[int, Parameter]
    width: int

    @classmethod
    def of(cls, context: Context, pairs: Sequence[EffectAtValue]) -> "EffectDictionary":
        """Lay out effects at their nonlinear values."""
        items, mixed = list[DictionaryItem](), dict[int, Parameter]()
        by_move: dict[tuple[str, int], list[tuple[int, Parameter]]] = {}
        width = 0
        for effect, value in pairs:
            parameters = effect.make(value)
            items.append(DictionaryItem(effect, value, slice(width, width + len(parameters))))
            for k, p in enumerate(parameters, width):
                if len(p.moves) == 1:
                    by_move.setdefault((p.main_move.on, p.main_move.index), []).append((k, p))
                else:
                    mixed[k] = p
            width += len(parameters)
        single = width * len(context.samples) > LARGE
        blocks = tuple(_column_block(context, members, single) for members in by_move.values())
        return cls(context, tuple(items), blocks, mixed, width)

    @cached_property
    def equal_items(self) -> tuple[EqualItems, ...]:
        """Items by the number of their parameters."""
        start = np.array([item.columns.start for item in self.items])
        count = np.array([item.columns.stop for item in self.items]) - start
        alike = [np.flatnonzero(count == k) for k in np.unique(count)]
        return tuple(EqualItems(w, start[w][:, None] + np.arange(count[w[0]])) for w in alike)

    @cached_property
    def effects(self) -> tuple[tuple[Effect, slice], ...]:
        """Every effect, and the positions of its items."""
        out, first = [], 0
        for _, group in groupby(self.items, lambda item: item.effect.name):
            own = list(group)
            out.append((own[0].effect, slice(first, first + len(own))))
            first += len(own)
        return tuple(out)

    @cached_property
    def home(self) -> Array:
        """Block of every column and its row there, (2, width) int; −1 for those that move several things."""
        out = np.full((2, self.width), -1)
        for b, block in enumerate(self.blocks):
            out[0, block.columns], out[1, block.columns] = b, np.arange(len(block.columns))
        return out


def _column_block(context: Context, members: list[tuple[int, Parameter]], single: bool) -> ColumnBlock:
    phi = np.empty((len(members), len(context.samples)), dtype=np.float32 if single else np.float64)
    for row, (_, p) in zip(phi, members, strict=True):
        np.multiply(p.main_move.phi(context), p.prior, out=row)
    return ColumnBlock(members[0][1].main_move, phi, np.array([k for k, _ in members]))


@dataclass(frozen=True)
class WhitenedDictionary:
    """The columns of a dictionary about one model.

    Attributes:
        dictionary: whose they are.
        screws: whitened change of the reading per unit of what each block moves, (n, r) each.
        mixed: whitened columns (m,) of the parameters that move several things, by position.
        squares: cᵀ c within each item, (K, k, k) for each of the dictionary's ``equal_items``.
    """

    dictionary: EffectDictionary
    screws: tuple[Array, ...]
    mixed: dict[int, Array]
    squares: tuple[Array, ...]

    @classmethod
    def of(cls, dictionary: EffectDictionary, problem: FitProblem, motion: ForwardPass) -> "WhitenedDictionary":
        """Whiten the columns where the arm stands after a forward pass."""
        screws = tuple(_whitened_screws(dictionary, problem, motion))
        mixed = _whitened_mixed_columns(dictionary, problem, motion)
        return cls(dictionary, screws, mixed, tuple(_squares(dictionary, screws, mixed)))

    def project(self, basis: Array, single: bool = False) -> Array:
        """Return the products of all columns with a basis (m, P), (width, P); ``single``: to single precision."""
        n = len(self.dictionary.context.samples)
        shape = (n, len(basis) // n, basis.shape[1])
        out = np.empty((self.dictionary.width, basis.shape[1]), dtype=np.float32 if single else np.float64)
        for block, screw in zip(self.dictionary.blocks, self.screws, strict=True):
            seen = (screw[:, None, :] @ basis.reshape(shape))[:, 0]
            out[block.columns] = block.products(seen.astype(out.dtype, copy=False))
        if self.mixed:
            out[list(self.mixed)] = np.stack(list(self.mixed.values())) @ basis
        return out

    def along(self, residual: Array) -> Array:
        """Return the products of all columns with a residual (m,), (width,)."""
        out = np.empty(self.dictionary.width)
        each = residual.reshape(len(self.dictionary.context.samples), -1)
        for block, screw in zip(self.dictionary.blocks, self.screws, strict=True):
            out[block.columns] = block.products((screw * each).sum(axis=1))
        for k, column in self.mixed.items():
            out[k] = column @ residual
        return out


def _whitened_screws(dictionary: EffectDictionary, problem: FitProblem, motion: ForwardPass) -> list[Array]:
    blocks = dictionary.blocks
    raw = np.zeros((len(problem), problem.model.width, len(blocks)))
    turned = [j for j, b in enumerate(blocks) if b.move.on == "transform"]
    moves = [transform_move(blocks[j].move.index) for j in turned]
    single = tuple(Parameter(str(m[0].index), "1", 1.0, "", m) for m in moves)
    model = replace(problem.model, parameters=single)
    raw[:, :, turned] = model.columns(dictionary.context, motion).dense.transpose(2, 1, 0)
    for j, block in enumerate(blocks):
        if block.move.on == "reading":
            raw[:, block.move.index, j] = 1.0
    white = whiten(problem, raw)
    return [np.ascontiguousarray(white[:, :, j]) for j in range(len(blocks))]


def _whitened_mixed_columns(dictionary: EffectDictionary, problem: FitProblem, motion: ForwardPass) -> dict[int, Array]:
    if not dictionary.mixed:
        return {}
    model = replace(problem.model, parameters=tuple(dictionary.mixed.values()))
    rows = model.columns(dictionary.context, motion).dense.transpose(2, 1, 0) * model.prior
    return dict(zip(dictionary.mixed, whiten(problem, rows).reshape(-1, rows.shape[2]).T, strict=True))


def whiten(problem: FitProblem, rows: Array) -> Array:
    """Return rows (n, r, m) in standard deviations of the readings, by their weights."""
    return np.asarray(problem.whitener.white(rows) * np.sqrt(problem.weight)[:, None, None])


def whitened_columns(problem: FitProblem, parameters: Sequence[Parameter], motion: ForwardPass) -> Array:
    """Return the columns (k, r, n) of parameters per prior sigma in standard deviations, after a forward pass."""
    model = replace(problem.model, parameters=tuple(parameters))
    return whiten_columns(problem, model.columns(problem.context, motion).dense * model.prior[:, None, None])


def whiten_columns(problem: FitProblem, columns: Array) -> Array:
    """Return columns (k, r, n) in standard deviations of the readings."""
    return np.ascontiguousarray(whiten(problem, columns.transpose(2, 1, 0)).transpose(2, 1, 0))


def _squares(dictionary: EffectDictionary, screws: Sequence[Array], mixed: dict[int, Array]) -> Iterator[Array]:
    several = 128  # columns at a time, so that they stay in the processor's cache
    block, row = dictionary.home
    for equal in dictionary.equal_items:
        count, width = equal.columns.shape
        out = np.empty((count, width, width))
        of = block[equal.columns]
        whole = np.where((of == of[:, :1]).all(axis=1), of[:, 0], -1)
        for b, screw in enumerate(screws):
            power, mine = (screw**2).sum(axis=1), np.flatnonzero(whole == b)
            for k in range(0, len(mine), several):
                few = mine[k : k + several]
                phi = dictionary.blocks[b].phi[row[equal.columns[few]]].astype(float, copy=False)
                out[few] = (phi * power) @ phi.transpose(0, 2, 1)
        for j in np.flatnonzero(whole < 0).tolist():
            C = np.stack(
                [
                    mixed[c] if c in mixed else (screws[block[c]].T * dictionary.blocks[block[c]].phi[row[c]]).T.ravel()
                    for c in equal.columns[j].tolist()
                ]
            )
            out[j] = C @ C.T
        yield out
