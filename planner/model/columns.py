"""Columns of an identification Jacobian, many of them one screw times different functions of the sample.

A column of an effect is the screw s (r, n) of the transform that it moves, times φ (n,). Products of the columns φᵢ sₐ
and φⱼ s_b over a run are Σ φᵢ (sₐ · s_b) φⱼ: with the screws' products taken first, a matrix product over n samples
where the columns themselves would need one over r n readings, and only the screws need to be whitened.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg.blas import dtrmm

from planner.common.units import Array


@dataclass(frozen=True)
class Columns:
    """P columns, each of r numbers a sample.

    Attributes:
        plain: columns that stand for themselves, (D, r, n), at the positions ``plain_at`` (D,).
        screws: of the blocks of columns, (B, r, n).
        phi: functions that they are multiplied by, (m, n) of each block, at the positions ``phi_at`` (m,). They are not
            changed: several linearisations may share them.
        sizes: numbers (P,) that the columns with functions are multiplied by as well, at their positions; none where
            there are no functions, or where they are all 1.
    """

    plain: Array
    plain_at: np.ndarray
    screws: Array
    phi: tuple[Array, ...] = ()
    phi_at: tuple[np.ndarray, ...] = ()
    sizes: Array | None = None

    @classmethod
    def join(cls, parts: Sequence["Columns"]) -> "Columns":
        """Put the samples of several parts one behind the other."""
        first = parts[0]
        if len(parts) == 1:
            return first
        return replace(
            first,
            plain=np.concatenate([p.plain for p in parts], axis=2),
            screws=np.concatenate([p.screws for p in parts], axis=2),
            phi=tuple(np.concatenate([p.phi[b] for p in parts], axis=1) for b in range(len(first.phi))),
        )

    def __len__(self) -> int:
        """Return the number of columns P."""
        return len(self.plain) + sum(map(len, self.phi))

    @cached_property
    def dense(self) -> Array:
        """All of them in order, (P, r, n)."""
        if not self.phi:
            return self.plain
        out = np.empty((len(self), *self.plain.shape[1:]))
        out[self.plain_at] = self.plain
        for at, screw, phi in zip(self.phi_at, self.screws, self.phi, strict=True):
            for k, function in zip(at.tolist(), phi, strict=True):
                np.multiply(screw, function if self.sizes is None else function * self.sizes[k], out=out[k])
        return out

    @property
    def _flat_columns(self) -> Array:
        """Plain columns, (D, r n)."""
        count, r, n = self.plain.shape
        return self.plain.reshape(count, r * n)

    def take(self, which: np.ndarray) -> "Columns":
        """Return the columns over the samples at ``which``."""
        phi = tuple(p[:, which] for p in self.phi)
        return replace(self, plain=self.plain[:, :, which], screws=self.screws[:, :, which], phi=phi)

    def select(self, kept: np.ndarray) -> "Columns":
        """Return the columns at the positions ``kept``, in that order."""
        place = np.full(len(self), -1)
        place[kept] = np.arange(len(kept))

        def part(columns: Array, at: np.ndarray) -> tuple[Array, np.ndarray]:
            """Return the columns of one part that are kept, and where they stand now."""
            stays = place[at] >= 0
            return columns if stays.all() else columns[stays], place[at][stays]

        plain, plain_at = part(self.plain, self.plain_at)
        blocks = [part(phi, at) for phi, at in zip(self.phi, self.phi_at, strict=True)]
        sizes = None if self.sizes is None else self.sizes[kept]
        phi, phi_at = tuple(phi for phi, _ in blocks), tuple(at for _, at in blocks)
        return Columns(plain, plain_at, self.screws, phi, phi_at, sizes)

    def whiten(self, root: Array, scale: Array, residual: Array) -> "Columns":
        """Return the columns times ``scale`` (P,) and, as the last, the residual (n, r), all in standard deviations.

        ``root``: L⁻¹ of every sample, (r, r, n) by column and row, with L Lᵀ the covariance of its reading.
        """
        D = len(self.plain)
        plain = np.empty((D + 1, *self.plain.shape[1:]))
        np.multiply(self.plain, scale[self.plain_at][:, None, None], out=plain[:D])
        plain[D] = residual.T
        _whiten(plain, root)
        at = np.append(self.plain_at, len(self))
        if not self.phi:
            return Columns(plain, at, self.screws)
        screws = self.screws.copy()
        _whiten(screws, root)
        sizes = np.append(scale if self.sizes is None else scale * self.sizes, 1.0)
        return Columns(plain, at, screws, self.phi, self.phi_at, sizes)

    @property
    def gram(self) -> Array:
        """Products of all columns with each other, (P, P)."""
        own = self._flat_columns @ self._flat_columns.T
        if not self.phi:
            return np.asarray(own)
        out = np.empty((len(self), len(self)))
        out[np.ix_(self.plain_at, self.plain_at)] = own
        for b, (at, screw, phi) in enumerate(zip(self.phi_at, self.screws, self.phi, strict=True)):
            _put(out, self.plain_at, at, _products_with_screw(self.plain, screw) @ phi.T)
            for c in range(b):
                both = _products_with_screw(screw[None], self.screws[c])[0]
                _put(out, at, self.phi_at[c], (phi * both) @ self.phi[c].T)
            own = phi * np.sqrt(_products_with_screw(screw[None], screw)[0])
            out[np.ix_(at, at)] = own @ own.T
        if self.sizes is not None:
            out *= self._factors
            out *= self._factors[:, None]
        return out

    @cached_property
    def _factors(self) -> Array:
        """What products without the sizes must be multiplied by, (P,): 1 for plain columns."""
        out = np.ones(len(self))
        if self.sizes is not None:
            for at in self.phi_at:
                out[at] = self.sizes[at]
        return out

    def along(self, residual: Array) -> Array:
        """Return the products of all columns with a residual (n, r), (P,)."""
        out, each = np.empty(len(self)), residual.T
        out[self.plain_at] = self._flat_columns @ each.ravel()
        for at, screw, phi in zip(self.phi_at, self.screws, self.phi, strict=True):
            out[at] = phi @ (screw * each).sum(axis=0)
        return out if self.sizes is None else out * self._factors

    def products(self, others: Array) -> Array:
        """Return the products of all columns with others (k, r, n), (P, k)."""
        out = np.empty((len(self), len(others)))
        out[self.plain_at] = self._flat_columns @ others.reshape(len(others), -1).T
        for at, screw, phi in zip(self.phi_at, self.screws, self.phi, strict=True):
            out[at] = phi @ _products_with_screw(others, screw).T
        return out if self.sizes is None else out * self._factors[:, None]

    def times(self, vector: Array) -> Array:
        """Return the sum of all columns, each times its number in ``vector`` (P,), as (n, r)."""
        vector = vector if self.sizes is None else vector * self._factors
        out = np.tensordot(vector[self.plain_at], self.plain, axes=1)
        for at, screw, phi in zip(self.phi_at, self.screws, self.phi, strict=True):
            out += screw * (vector[at] @ phi)
        return np.asarray(out.T)

    def square_sums(self, root: Array) -> Array:
        """Return the sums of squares of the first columns turned by an upper triangular root (q, q), (n, r)."""
        q, (_, r, n) = len(root), self.plain.shape
        if not self.phi:
            turned = dtrmm(1.0, root, self.plain[:q].reshape(q, -1).T, side=1)
            return np.asarray((turned.T**2).sum(axis=0).reshape(r, n).T)
        turn = np.vstack([root, np.zeros((len(self) - q, q))])
        turn *= self._factors[:, None]
        out = np.empty((n, r))
        few = max(1, 1_000_000 // (q * len(self.phi)))  # numbers of columns that are turned all together
        for start in range(0, n, few):
            part = slice(start, start + few)
            whole = self.plain[:, :, part].transpose(2, 1, 0).reshape(-1, len(self.plain)) @ turn[self.plain_at]
            each = np.stack([p[:, part].T @ turn[at] for p, at in zip(self.phi, self.phi_at, strict=True)], axis=1)
            whole = whole.reshape(-1, r, q) + self.screws[:, :, part].transpose(2, 1, 0) @ each
            out[part] = np.einsum("nrq,nrq->nr", whole, whole)
        return out


def _products_with_screw(columns: Array, screw: Array) -> Array:
    """Products of columns (m, r, n) with a screw (r, n) in each sample, (m, n)."""
    out = columns[:, 0] * screw[0]
    for i in range(1, len(screw)):
        out += columns[:, i] * screw[i]
    return np.asarray(out)


def _put(gram: Array, rows: np.ndarray, columns: np.ndarray, values: Array) -> None:
    gram[np.ix_(rows, columns)] = values
    gram[np.ix_(columns, rows)] = values.T


def _whiten(columns: Array, root: Array) -> None:
    """Multiply columns (m, r, n) by the triangular L⁻¹ of every sample, in place."""
    # 50_000: numbers stay in a processor's cache while they are worked on
    few = max(1, 50_000 // max(1, columns[0].size)) if len(columns) else 1
    for k in range(0, len(columns), few):
        some = columns[k : k + few]
        for i in reversed(range(some.shape[1])):  # L⁻¹ is triangular: what is done is not needed any more
            some[:, i] *= root[i, i]
            for j in range(i):
                some[:, i] += root[j, i] * some[:, j]
