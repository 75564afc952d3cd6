"""The five observability indices of a set of measuring poses, each a function of the singular values of its Jacobian.

Sources: O1 Borm and Menq 1991; O2 Driels and Pathre 1990; O3, O4 Nahvi and Hollerbach 1996; O5 Sun and Hollerbach 2008,
whose O5 is 1 / sum(1/mu). With mu_1 >= ... >= mu_r the singular values of the stacked rows of all poses.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from planner.errors import InputError, nearest
from planner.units import Array

IndexName = Literal["O1", "O2", "O3", "O4", "O5"]


def _o1(mu: Array, poses: int) -> Array:
    with np.errstate(divide="ignore"):
        return np.asarray(np.exp(np.mean(np.log(mu), axis=-1)) / np.sqrt(poses))


def _o5(mu: Array) -> Array:
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / np.sum(1.0 / mu, axis=-1))


def _o2(mu: Array) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(mu[..., 0] / mu[..., -1])


@dataclass(frozen=True)
class IndexRule:
    """One index: the sense of better and its formula on descending singular values (..., r) and a count of poses."""

    name: IndexName
    maximise: bool
    what: str
    of: Callable[[Array, int], Array]

    def better(self, value: float, than: float) -> bool:
        """Tell whether ``value`` is strictly better than ``than``."""
        return value > than if self.maximise else value < than

    def gap(self, value: float, bound: float) -> float:
        """Return how far ``value`` is from ``bound``, as a share of the better of the two (0: proven optimal)."""
        return bound / value - 1.0 if self.maximise else value / bound - 1.0


RULES: dict[str, IndexRule] = {
    rule.name: rule
    for rule in (
        IndexRule("O1", True, "geometric mean of the singular values over the root of the poses", _o1),
        IndexRule("O2", False, "condition number", lambda mu, _: _o2(mu)),
        IndexRule("O3", True, "smallest singular value", lambda mu, _: np.asarray(mu[..., -1])),
        IndexRule("O4", True, "noise amplification index", lambda mu, _: np.asarray(mu[..., -1] ** 2 / mu[..., 0])),
        IndexRule("O5", True, "inverse of the sum of inverse singular values", lambda mu, _: _o5(mu)),
    )
}


def rule(kind: str) -> IndexRule:
    """Return the rule of an index by name.

    Raises:
        InputError: the name is none of O1 ... O5.
    """
    if kind not in RULES:
        raise InputError(f"index {kind!r} is unknown; allowed are {', '.join(RULES)}{nearest(kind, list(RULES))}")
    return RULES[kind]


@dataclass(frozen=True)
class Indices:
    """O1 ... O5 of one set of ``poses`` poses, on ``parameters`` columns."""

    O1: float
    O2: float
    O3: float
    O4: float
    O5: float
    poses: int
    parameters: int


def stacked(rows: Array) -> Array:
    """Return rows (n, r, P), or (n, P) for one reading a pose, as the tall matrix (n r, P)."""
    return np.reshape(rows, (-1, rows.shape[-1]))


def singular_values(rows: Array) -> Array:
    """Return the singular values, descending, (P,) of rows (n, r, P); zeros fill up when there are too few rows."""
    tall = stacked(rows)
    mu = np.zeros(tall.shape[1])
    found = np.linalg.svd(tall, compute_uv=False)
    mu[: len(found)] = found
    return mu


def index_value(kind: str, rows: Array, scale: Array | None = None) -> float:
    """Return one index of the pose set ``rows`` (n, r, P) or (n, P); a set that sees too little gets its worst value.

    ``scale`` (P,) multiplies the columns: with each parameter's prior size the index is free of units.
    """
    mu = singular_values(rows if scale is None else rows * scale)
    return _finite(rule(kind), mu, len(rows))


def _finite(index: IndexRule, mu: Array, poses: int) -> float:
    """Apply the formula, with numerically zero singular values (below rounding) taken as zero."""
    floor = mu[0] * len(mu) * np.finfo(float).eps
    mu = np.where(mu > floor, mu, 0.0)
    return float(np.nan_to_num(index.of(mu, poses), nan=np.inf, posinf=np.inf))


def indices(rows: Array, scale: Array | None = None) -> Indices:
    """Return all five indices of a pose set ``rows`` (n, r, P); ``scale`` as in :func:`index_value`."""
    mu = singular_values(rows if scale is None else rows * scale)
    values = {name: _finite(each, mu, len(rows)) for name, each in RULES.items()}
    return Indices(**values, poses=len(rows), parameters=len(mu))
