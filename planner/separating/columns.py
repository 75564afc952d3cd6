"""The columns of all that is compared: the plan's own parameters, and those of findings and rivals."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.catalogue import Entry, catalogue
from planner.model import Model, Parameter
from planner.repeatable import evenly
from planner.run import Samples
from planner.separating.file import Found
from planner.units import Array

LOOK = 1_500  # candidates over which inner numbers are looked for
SPANNED = 1e-9  # share of the largest singular value below which columns span nothing new
NARROWINGS = 3  # rounds of the search between grid neighbours, each five times finer
PIECE = 300  # columns at a time


@dataclass(frozen=True)
class Sight:
    """How readings depend on parameters: a model, and samples of every candidate, with the noise of each.

    Attributes:
        model: the plan's own parameters.
        samples: of every visit of a candidate, see :mod:`.passages`.
        sigma: noise of one reading, (n,) [m].
    """

    model: Model
    samples: tuple[Samples, ...]
    sigma: Array

    def entries(self) -> dict[str, Entry]:
        """Every effect that these samples can show, by name."""
        own = [k for k in ("q", "place", "t", "point") if getattr(self.samples[0], k) is not None]
        both = {k: np.concatenate([getattr(s, k) for s in self.samples]) for k in own}
        one = {
            k: np.concatenate([getattr(s, k) for s in self.samples])
            for k in ("direction", "speed", "reversals")
            if getattr(self.samples[0], k) is not None
        }
        return {e.name: e for e in catalogue(self.model.rig, Samples(**both, **one))}

    def rows(self, parameters: Sequence[Parameter]) -> Array:
        """Whitened rows of every candidate, (n, r, P), per unit of the parameters; r numbers over all visits."""
        model = replace(self.model, parameters=tuple(parameters))
        whole = np.concatenate([model.rows(s) for s in self.samples], axis=1)
        return np.asarray(whole / self.sigma[:, None, None])

    def thinned(self) -> "Sight":
        """Return a few of the candidates, evenly over all."""
        return self.at(evenly(len(self.sigma), LOOK))

    def at(self, which: np.ndarray) -> "Sight":
        """Return only some of the candidates."""
        return Sight(self.model, tuple(s.take(which) for s in self.samples), self.sigma[which])


def flat(rows: Array) -> Array:
    """Rows (n, r, P) as a tall matrix (n r, P)."""
    return rows.reshape(-1, rows.shape[2])


def spanned(columns: Array) -> Array:
    """Orthonormal basis (m, p) of what columns (m, P) span."""
    size = np.linalg.norm(columns, axis=0)
    Q, mu, _ = np.linalg.svd(columns[:, size > 0] / size[size > 0], full_matrices=False)
    return np.asarray(Q[:, mu > SPANNED * mu[0]])


def apart(columns: Array, basis: Array) -> Array:
    """What is left of columns (m, k) beside an orthonormal basis (m, p)."""
    return np.asarray(columns - basis @ (basis.T @ columns))


def values_of(found: Found, parameters: Sequence[Parameter], values: dict[str, float]) -> Array:
    """Found values of an effect's parameters, (k,): by name, else the finding's size on the first of them."""
    out = np.array([values.get(p.name, 0.0) for p in parameters])
    if not np.any(out):
        out[0] = found.size
    return out


def alike(sight: Sight, entry: Entry, signal: Array, base: Array) -> float | None:
    """Inner number with which an entry explains most of a signal (n r,); ``None`` where there is none.

    Args:
        sight: few candidates.
        entry: the entry.
        signal: of which it is to explain as much as it can, after the base took its part.
        base: orthonormal basis (n r, p) of what is in the model anyway.
    """
    if entry.inner is None:
        return None
    grid = entry.inner.values
    value = _best(sight, entry, signal, base, grid)
    near = int(np.argmin(np.abs(grid - value)))
    width = float(max(np.abs(np.diff(grid[max(0, near - 1) : near + 2]))))
    for _ in range(NARROWINGS):
        tries = np.clip(value + width * np.linspace(-1, 1, 11), grid.min(), grid.max())
        value = _best(sight, entry, signal, base, np.unique(tries))
        width /= 5
    return value


def _best(sight: Sight, entry: Entry, signal: Array, base: Array, grid: Array) -> float:
    shares: list[float] = []
    each = len(entry.make(float(grid[0])))
    for start in range(0, len(grid), max(1, PIECE // each)):
        part = grid[start : start + max(1, PIECE // each)]
        columns = flat(sight.rows([p for v in part for p in entry.make(float(v))]))
        left = apart(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300), base)
        for k in range(len(part)):
            own = left[:, k * each : (k + 1) * each]
            shares.append(float(np.sum((own @ np.linalg.lstsq(own, signal, rcond=1e-6)[0]) ** 2)))
    return float(grid[int(np.argmax(shares))])
