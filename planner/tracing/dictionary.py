"""Every entry of the catalogue at every inner number, laid out so that all are scored by a few matrix products.

A column of an entry is the whitened screw of one transform, the same for all entries on it, times φ. Products with the
model's basis therefore need only φ itself: with Q_k = Σ_r screw_r · Q_r, the shadow of a column is Q_kᵀ φ.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.catalogue import Entry
from planner.effects import Context
from planner.identification import Problem
from planner.model import Model, Move, Parameter
from planner.model.parameters import transform
from planner.units import Array

Pair = tuple[Entry, float | None]


@dataclass(frozen=True)
class Item:
    """One entry at one inner number, with its parameters and where their columns stand."""

    entry: Entry
    inner: float | None
    parameters: tuple[Parameter, ...]
    columns: slice


@dataclass(frozen=True)
class Sheet:
    """All columns on one transform or number of the reading: φ per prior size (n, m), and which columns they are."""

    move: Move
    phi: Array
    columns: np.ndarray


@dataclass(frozen=True)
class Dictionary:
    """Entries laid out over the samples of a context.

    Attributes:
        items: in the order given.
        sheets: of the columns that move one thing.
        mixed: positions of the columns that move several things, and their parameters.
        width: number of columns.
    """

    context: Context
    items: tuple[Item, ...]
    sheets: tuple[Sheet, ...]
    mixed: tuple[tuple[int, Parameter], ...]
    width: int

    @classmethod
    def of(cls, context: Context, pairs: Sequence[Pair]) -> "Dictionary":
        """Lay out entries at their inner numbers."""
        items, mixed = list[Item](), list[tuple[int, Parameter]]()
        by_place: dict[tuple[str, int], list[tuple[int, Parameter]]] = {}
        width = 0
        for entry, inner in pairs:
            parameters = entry.make(inner)
            items.append(Item(entry, inner, parameters, slice(width, width + len(parameters))))
            for k, p in enumerate(parameters):
                if len(p.moves) == 1:
                    by_place.setdefault((p.main.on, p.main.index), []).append((width + k, p))
                else:
                    mixed.append((width + k, p))
            width += len(parameters)
        sheets = tuple(_sheet(context, members) for members in by_place.values())
        return cls(context, tuple(items), sheets, tuple(mixed), width)


def _sheet(context: Context, members: list[tuple[int, Parameter]]) -> Sheet:
    n = len(context.samples)
    phi = np.empty((n, len(members)))
    for j, (_, p) in enumerate(members):
        phi[:, j] = p.main.phi(context) * p.prior
    return Sheet(members[0][1].main, phi, np.array([k for k, _ in members]))


@dataclass(frozen=True)
class Products:
    """Products of all columns with a basis and a residual.

    Attributes:
        shadow: Qᵀ c of every column, (P, width).
        along: cᵀ residual, (width,).
        squares: cᵀ c within each item, one (k, k) matrix an item.
    """

    shadow: Array
    along: Array
    squares: tuple[Array, ...]


def products(dictionary: Dictionary, problem: Problem, errors: Array, basis: Array, residual: Array) -> Products:
    """Multiply every column, about the model's ``errors``, with a basis (m, P) and a residual (m,), all whitened."""
    n, r = len(problem), problem.model.width
    about = problem.model.fixing(errors)
    screws = _screws(dictionary, problem, about)
    Q = basis.reshape(n, r, -1)
    e = residual.reshape(n, r)
    shadow, along = np.zeros((basis.shape[1], dictionary.width)), np.zeros(dictionary.width)
    for sheet, screw in zip(dictionary.sheets, screws, strict=True):
        shadow[:, sheet.columns] = np.einsum("nr,nrp->pn", screw, Q) @ sheet.phi
        along[sheet.columns] = np.einsum("nr,nr->n", screw, e) @ sheet.phi
    columns = _mixed(dictionary, problem, about)
    for (k, _), column in zip(dictionary.mixed, columns, strict=True):
        shadow[:, k], along[k] = basis.T @ column, float(column @ residual)
    return Products(shadow, along, tuple(_squares(dictionary, screws, columns)))


def _screws(dictionary: Dictionary, problem: Problem, about: Model) -> list[Array]:
    """Whitened change of the reading per unit of what each sheet moves, (n, r)."""
    n = len(problem)
    raw = np.zeros((n, problem.model.width, len(dictionary.sheets)))
    turned = [j for j, s in enumerate(dictionary.sheets) if s.move.on == "transform"]
    moves = [transform(dictionary.sheets[j].move.index) for j in turned]
    single = tuple(Parameter(str(m[0].index), "", 1.0, "", m) for m in moves)
    raw[:, :, turned] = replace(about, parameters=single).linear_in(dictionary.context, None).rows
    for j, sheet in enumerate(dictionary.sheets):
        if sheet.move.on == "reading":
            raw[:, sheet.move.index, j] = 1.0
    white = problem.whitener.white(slice(None), raw) * np.sqrt(problem.weight)[:, None, None]
    return [np.ascontiguousarray(white[:, :, j]) for j in range(raw.shape[2])]


def _mixed(dictionary: Dictionary, problem: Problem, about: Model) -> list[Array]:
    """Whitened columns (m,) of the parameters that move several things."""
    if not dictionary.mixed:
        return []
    model = replace(about, parameters=tuple(p for _, p in dictionary.mixed))
    rows = model.linear_in(dictionary.context, None).rows * model.prior
    white = problem.whitener.white(slice(None), rows) * np.sqrt(problem.weight)[:, None, None]
    return list(white.reshape(-1, rows.shape[2]).T)


def _squares(dictionary: Dictionary, screws: list[Array], mixed: list[Array]) -> list[Array]:
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
