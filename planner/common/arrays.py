"""Arrays with one entry a row: some of the rows, the rows of several, means by group."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np

from planner.common.units import Array

CACHED_ROWS = 4096  # [samples] of one pass over a batch: what they need stays in the processor's cache


@dataclass(frozen=True)
class Rows:
    """Arrays of equal length, the fields of a dataclass; ``None`` where there is nothing."""

    def take(self, which: slice | np.ndarray) -> Self:
        """Return the rows at ``which`` (a slice, indices, or a mask); fields that are one array stay one."""
        own = {f.name: v for f in fields(self) if (v := getattr(self, f.name)) is not None}
        taken = {key: v[which] for key, v in {id(v): v for v in own.values()}.items()}
        return replace(self, **{name: taken[id(v)] for name, v in own.items()})

    @classmethod
    def concatenate(cls, parts: Sequence[Self]) -> Self:
        """Return the rows of all, one after the other, in the fields that all of them have."""
        columns = {f.name: [getattr(p, f.name) for p in parts] for f in fields(cls)}
        return cls(**{name: np.concatenate(v) for name, v in columns.items() if not any(part is None for part in v)})


def mirror_lower(matrix: Array) -> Array:
    """Make a square matrix symmetric, in place, by its lower triangle; return it."""
    step = 256  # rows at once, so that no second matrix is made
    for start in range(0, len(matrix), step):
        end = min(start + step, len(matrix))
        own = matrix[start:end, start:end]
        own[:] = np.where(np.tri(len(own), dtype=bool), own, own.T)
        matrix[start:end, end:] = matrix[end:, start:end].T
    return matrix


def mean_by_group(values: Array, group: np.ndarray) -> Array:
    """Return the mean of values (n,) or (n, k) in each group 0 … G − 1, (G,) or (G, k); NaN where a group has none."""
    count = np.bincount(group)
    sums = np.stack([np.bincount(group, column) for column in np.atleast_2d(values.T)], axis=1)
    with np.errstate(invalid="ignore"):
        return np.asarray(sums / count[:, None]).reshape(-1, *values.shape[1:])
