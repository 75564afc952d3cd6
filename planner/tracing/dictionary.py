"""Every effect of the catalogue at every nonlinear value, laid out so that all are scored by a few matrix products.

A column of an effect is the whitened screw of one transform, the same for all effects on it, times φ. Products with the
model's basis therefore need only φ itself: with Q_k = Σ_r screw_r · Q_r, the projection of a column is Q_kᵀ φ.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.common.units import Array
from planner.effects.context import Context
from planner.effects.effect import Effect
from planner.effects.parameters import Parameter, ParameterMove, transform_move
from planner.identification.problem import FitProblem
from planner.model.model import Model

EffectAtValue = tuple[Effect, float | None]


@dataclass(frozen=True)
class DictionaryItem:
    """One effect at one value of its nonlinear parameter, and where the columns of its parameters stand."""

    effect: Effect
    value: float | None
    columns: slice


@dataclass(frozen=True)
class ColumnBlock:
    """All columns on one transform or number of the reading: φ per prior size (n, m), and which columns they are."""

    move: ParameterMove
    phi: Array
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
                    by_move.setdefault((p.main.on, p.main.index), []).append((k, p))
                else:
                    mixed[k] = p
            width += len(parameters)
        blocks = tuple(_column_block(context, members) for members in by_move.values())
        return cls(context, tuple(items), blocks, mixed, width)


def _column_block(context: Context, members: list[tuple[int, Parameter]]) -> ColumnBlock:
    phi = np.empty((len(context.samples), len(members)))
    for j, (_, p) in enumerate(members):
        phi[:, j] = p.main.phi(context) * p.prior
    return ColumnBlock(members[0][1].main, phi, np.array([k for k, _ in members]))


@dataclass(frozen=True)
class ColumnProducts:
    """Products of all columns with a basis and a residual.

    Attributes:
        projection: Qᵀ c of every column, (P, width).
        along: cᵀ residual, (width,).
        squares: cᵀ c within each item, one (k, k) matrix an item.
    """

    projection: Array
    along: Array
    squares: tuple[Array, ...]


def column_products(
    dictionary: EffectDictionary, problem: FitProblem, errors: Array, basis: Array, residual: Array
) -> ColumnProducts:
    """Multiply every column, about the model's ``errors``, with a basis (m, P) and a residual (m,), all whitened."""
    n, r = len(problem), problem.model.width
    about = problem.model.fixing(errors)
    screws = _whitened_screws(dictionary, problem, about)
    mixed = _whitened_mixed_columns(dictionary, problem, about)
    Q, e = basis.reshape(n, r, -1), residual.reshape(n, r)
    projection, along = np.zeros((basis.shape[1], dictionary.width)), np.zeros(dictionary.width)
    for block, screw in zip(dictionary.blocks, screws, strict=True):
        projection[:, block.columns] = np.einsum("nr,nrp->pn", screw, Q) @ block.phi
        along[block.columns] = np.einsum("nr,nr->n", screw, e) @ block.phi
    for k, column in mixed.items():
        projection[:, k], along[k] = basis.T @ column, float(column @ residual)
    return ColumnProducts(projection, along, tuple(_gram_matrices(dictionary, screws, mixed)))


def _whitened_screws(dictionary: EffectDictionary, problem: FitProblem, about: Model) -> list[Array]:
    """Whitened change of the reading per unit of what each block moves, (n, r)."""
    blocks = dictionary.blocks
    raw = np.zeros((len(problem), problem.model.width, len(blocks)))
    turned = [j for j, b in enumerate(blocks) if b.move.on == "transform"]
    moves = [transform_move(blocks[j].move.index) for j in turned]
    single = tuple(Parameter(str(m[0].index), "", 1.0, "", m) for m in moves)
    raw[:, :, turned] = replace(about, parameters=single).linear_in(dictionary.context, None).rows
    for j, block in enumerate(blocks):
        if block.move.on == "reading":
            raw[:, block.move.index, j] = 1.0
    white = whiten(problem, raw)
    return [np.ascontiguousarray(white[:, :, j]) for j in range(len(blocks))]


def _whitened_mixed_columns(dictionary: EffectDictionary, problem: FitProblem, about: Model) -> dict[int, Array]:
    """Whitened columns (m,) of the parameters that move several things, by position."""
    if not dictionary.mixed:
        return {}
    model = replace(about, parameters=tuple(dictionary.mixed.values()))
    rows = model.linear_in(dictionary.context, None).rows * model.prior
    return dict(zip(dictionary.mixed, whiten(problem, rows).reshape(-1, rows.shape[2]).T, strict=True))


def whiten(problem: FitProblem, rows: Array) -> Array:
    """Return rows (n, r, m) in standard deviations of the readings, by their weights."""
    return np.asarray(problem.whitener.white(slice(None), rows) * np.sqrt(problem.weight)[:, None, None])


def _gram_matrices(dictionary: EffectDictionary, screws: list[Array], mixed: dict[int, Array]) -> Iterator[Array]:
    where = {int(c): (b, j) for b, block in enumerate(dictionary.blocks) for j, c in enumerate(block.columns)}
    power = [np.einsum("nr,nr->n", w, w) for w in screws]
    for item in dictionary.items:
        columns = range(item.columns.start, item.columns.stop)
        of_blocks = {where[c][0] if c in where else -1 for c in columns}
        if of_blocks != {-1} and len(of_blocks) == 1:
            b = of_blocks.pop()
            phi = dictionary.blocks[b].phi[:, [where[c][1] for c in columns]]
            yield phi.T @ (power[b][:, None] * phi)
            continue
        C = np.stack([mixed[c] if c in mixed else _column(dictionary, screws, *where[c]) for c in columns])
        yield C @ C.T


def _column(dictionary: EffectDictionary, screws: list[Array], block: int, j: int) -> Array:
    return np.asarray((screws[block] * dictionary.blocks[block].phi[:, j, None]).reshape(-1))
