"""Which poses a check measures: those at which every change shows at its least size, and axes are told apart."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr

from planner.common.determinism import Positions, even_positions
from planner.common.units import Array
from planner.identification.baseline import Baseline
from planner.instruments.check.changes import Change, change_columns
from planner.runs.run import Samples

TRIED = 500  # candidates that compete
SWEEPS = 4  # of exchanges


def choose_check_poses(baseline: Baseline, changes: tuple[Change, ...], pool: Samples, count: int) -> Positions:
    """Return the positions of ``count`` candidates, by exchange from a start by pivoting.

    The figure of merit is the mean over all changes of log λ, with λ the information about the direction that shows
    least per motion of the tool (E-optimal for each change: its detectable size is as 1/√λ), plus the logarithm of the
    determinant of the correlation of the axes' zeros, per axis (D-optimal: says which of them it was).
    """
    tried = even_positions(len(pool), TRIED)
    samples = pool.take(tried)
    merit = _Merit.of(baseline, changes, samples)
    white = merit.columns / np.sqrt(np.diag(merit.covariance))[:, None]
    chosen = qr(white.T, pivoting=True, mode="r")[1][:count].tolist()
    for at in range(count - len(chosen)):  # fewer columns than poses
        chosen.append(next(k for k in range(at, len(tried)) if k not in chosen))
    best = float(merit.of_sets(np.array([chosen]))[0])
    for _ in range(SWEEPS):
        before = best
        for place in range(count):
            others = np.setdiff1d(np.arange(len(tried)), chosen)
            sets = np.repeat(np.array([chosen]), len(others), axis=0)
            sets[:, place] = others
            values = merit.of_sets(sets)
            k = int(np.argmax(values))
            if values[k] > best:
                best, chosen[place] = float(values[k]), int(others[k])
        if best == before:
            break
    return np.sort(tried[chosen])


@dataclass(frozen=True)
class _Merit:
    """Figure of merit of sets of candidates.

    ``covariance`` (N, N) of their readings; ``columns`` (N, D) of all changes per metre of the tool's motion;
    ``blocks`` where each change has its columns; ``zeros`` (z,) columns of the axes' zeros.
    """

    covariance: Array
    columns: Array
    blocks: tuple[slice, ...]
    zeros: np.ndarray

    @classmethod
    def of(cls, baseline: Baseline, changes: tuple[Change, ...], samples: Samples) -> "_Merit":
        parts, blocks, zeros, start = [], [], [], 0
        alone = [c for c in changes if c.kind != "collision"]  # which is nothing but the others together
        for c, rows in zip(alone, change_columns(baseline, samples, alone), strict=True):
            root = np.linalg.cholesky(c.square + 1e-15 * np.trace(c.square) * np.eye(len(c.square)))
            parts.append(np.linalg.solve(root, rows.T).T)
            blocks.append(slice(start, start + len(c.parameters)))
            zeros += [start] if c.kind == "zero" else []
            start += len(c.parameters)
        return cls(baseline.covariance(samples), np.hstack(parts), tuple(blocks), np.array(zeros))

    def of_sets(self, sets: np.ndarray) -> Array:
        """Return it of sets (m, n) of positions."""
        covariance = self.covariance[sets[:, :, None], sets[:, None, :]]
        columns = self.columns[sets]
        information = columns.transpose(0, 2, 1) @ np.linalg.solve(covariance, columns)
        least = [np.linalg.eigvalsh(information[:, b, b])[:, 0] for b in self.blocks]
        z = information[:, self.zeros[:, None], self.zeros]
        unit = np.sqrt(np.einsum("mii->mi", z))
        sign, size = np.linalg.slogdet(z / (unit[:, :, None] * unit[:, None, :] + 1e-300))
        apart = np.where(sign > 0, size, -np.inf) / len(self.zeros)
        return np.asarray(np.log(np.maximum(np.stack(least), 1e-300)).mean(axis=0) + apart)
