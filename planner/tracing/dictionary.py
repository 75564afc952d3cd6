"""Every entry of the catalogue at every inner number, laid out so that all are scored by a few matrix products.

A column of an entry is the whitened screw of one transform, the same for all entries on it, times φ. Products with the
model's basis therefore need only φ itself: with Q_k = Σ_r screw_r · Q_r, the shadow of a column is Q_kᵀ φ.
"""

from collections.abc import Sequence
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
    """One entry at one inner number, with its parameters and where their columns stand."""

    entry: Effect
    inner: float | None
    parameters: tuple[Parameter, ...]
    columns: slice


@dataclass(frozen=True)
class ColumnBlock:
    """All columns on one transform or number of the reading: φ per prior size (n, m), and which columns they are."""

    move: ParameterMove
    phi: Array
    columns: np.ndarray


@dataclass(frozen=True)
class EffectDictionary:
    """Entries laid out over the samples of a context.

    Attributes:
        items: in the order given.
        sheets: of the columns that move one thing.
        mixed: positions of the columns that move several things, and their parameters.
        width: number of columns.
    """

    context: Context
    items: tuple[DictionaryItem, ...]
    sheets: tuple[ColumnBlock, ...]
    mixed: tuple[tuple[int, Parameter], ...]
    width: int

    @classmethod
    def of(cls, context: Context, pairs: Sequence[EffectAtValue]) -> "EffectDictionary":
        """Lay out entries at their inner numbers."""
        items, mixed = list[DictionaryItem](), list[tuple[int, Parameter]]()
        by_place: dict[tuple[str, int], list[tuple[int, Parameter]]] = {}
        width = 0
        for entry, inner in pairs:
            parameters = entry.make(inner)
            items.append(DictionaryItem(entry, inner, parameters, slice(width, width + len(parameters))))
            for k, p in enumerate(parameters):
                if len(p.moves) == 1:
                    by_place.setdefault((p.main.on, p.main.index), []).append((width + k, p))
                else:
                    mixed.append((width + k, p))
            width += len(parameters)
        sheets = tuple(_column_block(context, members) for members in by_place.values())
        return cls(context, tuple(items), sheets, tuple(mixed), width)


def _column_block(context: Context, members: list[tuple[int, Parameter]]) -> ColumnBlock:
    n = len(context.samples)
    phi = np.empty((n, len(members)))
    for j, (_, p) in enumerate(members):
        phi[:, j] = p.main.phi(context) * p.prior
    return ColumnBlock(members[0][1].main, phi, np.array([k for k, _ in members]))


@dataclass(frozen=True)
class ColumnProducts:
    """Products of all columns with a basis and a residual.

    Attributes:
        shadow: Qᵀ c of every column, (P, width).
        along: cᵀ residual, (width,).
        squares: cᵀ c within each item, one (k, k) matrix an item.
    """

    shadow: Array
    along: Array
    squares: tuple[Array, ...]


def column_products(
    dictionary: EffectDictionary, problem: FitProblem, errors: Array, basis: Array, residual: Array
) -> ColumnProducts:
    """Multiply every column, about the model's ``errors``, with a basis (m, P) and a residual (m,), all whitened."""
    n, r = len(problem), problem.model.width
    about = problem.model.fixing(errors)
    screws = _whitened_screws(dictionary, problem, about)
    Q = basis.reshape(n, r, -1)
    e = residual.reshape(n, r)
    shadow, along = np.zeros((basis.shape[1], dictionary.width)), np.zeros(dictionary.width)
    for sheet, screw in zip(dictionary.sheets, screws, strict=True):
        shadow[:, sheet.columns] = np.einsum("nr,nrp->pn", screw, Q) @ sheet.phi
        along[sheet.columns] = np.einsum("nr,nr->n", screw, e) @ sheet.phi
    columns = _whitened_mixed_columns(dictionary, problem, about)
    for (k, _), column in zip(dictionary.mixed, columns, strict=True):
        shadow[:, k], along[k] = basis.T @ column, float(column @ residual)
    return ColumnProducts(shadow, along, tuple(_gram_matrices(dictionary, screws, columns)))


def _whitened_screws(dictionary: EffectDictionary, problem: FitProblem, about: Model) -> list[Array]:
    """Whitened change of the reading per unit of what each sheet moves, (n, r)."""
    n = len(problem)
    raw = np.zeros((n, problem.model.width, len(dictionary.sheets)))
    turned = [j for j, s in enumerate(dictionary.sheets) if s.move.on == "transform"]
    moves = [transform_move(dictionary.sheets[j].move.index) for j in turned]
    single = tuple(Parameter(str(m[0].index), "", 1.0, "", m) for m in moves)
    raw[:, :, turned] = replace(about, parameters=single).linear_in(dictionary.context, None).rows
    for j, sheet in enumerate(dictionary.sheets):
        if sheet.move.on == "reading":
            raw[:, sheet.move.index, j] = 1.0
    white = problem.whitener.white(slice(None), raw) * np.sqrt(problem.weight)[:, None, None]
    return [np.ascontiguousarray(white[:, :, j]) for j in range(raw.shape[2])]


def _whitened_mixed_columns(dictionary: EffectDictionary, problem: FitProblem, about: Model) -> list[Array]:
    """Whitened columns (m,) of the parameters that move several things."""
    if not dictionary.mixed:
        return []
    model = replace(about, parameters=tuple(p for _, p in dictionary.mixed))
    rows = model.linear_in(dictionary.context, None).rows * model.prior
    white = problem.whitener.white(slice(None), rows) * np.sqrt(problem.weight)[:, None, None]
    return list(white.reshape(-1, rows.shape[2]).T)


def _gram_matrices(dictionary: EffectDictionary, screws: list[Array], mixed: list[Array]) -> list[Array]:
    place = {int(c): (s, j) for s, sheet in enumerate(dictionary.sheets) for j, c in enumerate(sheet.columns)}
    where = {k: i for i, (k, _) in enumerate(dictionary.mixed)}
    power = [np.einsum("nr,nr->n", w, w) for w in screws]
    out = []
    for item in dictionary.items:
        columns = range(item.columns.start, item.columns.stop)
        sheets = {place[c][0] for c in columns if c in place}
        if len(sheets) == 1 and all(c in place for c in columns):
            s = sheets.pop()
            phi = dictionary.sheets[s].phi[:, [place[c][1] for c in columns]]
            out.append(phi.T @ (power[s][:, None] * phi))
            continue
        C = np.stack(
            [
                mixed[where[c]]
                if c in where
                else (screws[place[c][0]] * dictionary.sheets[place[c][0]].phi[:, place[c][1], None]).reshape(-1)
                for c in columns
            ]
        )
        out.append(C @ C.T)
    return out
