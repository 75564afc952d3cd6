"""Causes that act together, and which of them are needless beside the others."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dpotri

from planner.common.units import Array, mirror_lower
from planner.inference.comparison_columns import Block
from planner.inference.family_gains import padded_width

Part = tuple[Block, float]
"""A cause that acts, and the factor on its sizes."""


def sizes_of(parts: Sequence[Part]) -> tuple[np.ndarray, Array]:
    """Return the positions of the columns of causes that act, and the factors on their sizes, (k,) each."""
    columns = np.concatenate([b.columns for b, _ in parts])
    return columns, np.concatenate([np.full(len(b.columns), s) for b, s in parts])


@dataclass(frozen=True)
class _AlikeCauses:
    """Causes of about as many parameters each.

    Attributes:
        causes: their numbers, (a,) int.
        rows: where their parameters stand, (a, k) int; 0, which is nought, fills up.
        blocks: of the covariance, (a, k, k), 1 on the diagonal of what fills up.
    """

    causes: np.ndarray
    rows: np.ndarray
    blocks: Array

    @classmethod
    def of(cls, covariance: Array, places: Sequence[slice]) -> tuple["_AlikeCauses", ...]:
        """Sort causes by how many parameters they have; places (f,) in the covariance."""
        width, out = np.array([padded_width(p.stop - p.start) for p in places]), []
        for k in np.unique(width).tolist():
            causes = np.flatnonzero(width == k)
            rows = np.zeros((len(causes), k), dtype=int)
            for row, place in zip(rows, (places[f] for f in causes.tolist()), strict=True):
                row[: place.stop - place.start] = _range(place)
            blocks = covariance[rows[:, :, None], rows[:, None]]
            blocks[:, np.arange(k), np.arange(k)] += rows == 0
            out.append(cls(causes, rows, blocks))
        return tuple(out)

    def with_change(self, change: Array, sign: float) -> "_AlikeCauses":
        """Return the same where the covariance has grown by sign · V Vᵀ."""
        moved = change[self.rows]
        return replace(self, blocks=self.blocks + sign * (moved @ moved.transpose(0, 2, 1)))

    def without(self, cause: int) -> "_AlikeCauses":
        """Return the same without one cause."""
        if cause not in self.causes:
            return self
        kept = self.causes != cause
        return _AlikeCauses(self.causes[kept], self.rows[kept], self.blocks[kept])

    def log_odds(self, mean: Array) -> Array:
        """Return what the readings say of each, (a,); ``mean`` of all parameters."""
        count, k = self.rows.shape
        wide = np.zeros((count, k + 1, k + 1))  # of which the lower triangle is looked at
        # as the last row, so that the root's last row is the mean per root of the block; 1e300: larger than its square
        wide[:, :k, :k], wide[:, k, :k], wide[:, k, k] = self.blocks, mean[self.rows], 1e300
        root = np.linalg.cholesky(wide)
        along, diagonal = root[:, k, :k], np.einsum("fkk->fk", root)[:, :k]
        return np.asarray(0.5 * np.einsum("fk,fk->f", along, along) + np.log(diagonal).sum(axis=1))


@dataclass(frozen=True)
class JointInclusion:
    """Causes that act, fitted together.

    Their covariance is a matrix and changes of a few directions, V diag(s) Vᵀ: to try one cause more or less then takes
    products with few columns. Before the first parameter stands one that is nought, which fills up what is narrow.

    Attributes:
        parts: in order; the last one stays whatever happens.
        places: where their parameters stand, behind the one that is nought, (f,).
        stays: which of them have not been taken out, (f,) bool.
        odds: logarithms of the odds beforehand that each acts, (f,).
        along: products of their columns with the readings, per size, (k + 1,).
        covariance: of the first parameters, each over its size, (k₀ + 1, k₀ + 1) before the changes.
        change, signs: V (k + 1, r) and s (r,).
        mean: of the parameters, each over its size, (k + 1,).
        log_det: logarithm of the covariance's determinant.
        alike: causes that stay, with their blocks of the covariance.
    """

    parts: tuple[Part, ...]
    places: tuple[slice, ...]
    stays: np.ndarray
    odds: Array
    along: Array
    covariance: Array
    change: Array
    signs: Array
    mean: Array
    log_det: float
    alike: tuple[_AlikeCauses, ...]

    @classmethod
    def of(cls, gram: Array, parts: Sequence[Part]) -> "JointInclusion":
        """Fit causes of known sizes, by products of all columns (p + 1, p + 1)."""
        columns, size = sizes_of(parts)
        information = np.eye(len(columns)) + size[:, None] * gram[np.ix_(columns, columns)] * size
        covariance, along = np.zeros((len(size) + 1, len(size) + 1)), np.append(0.0, size * gram[columns, -1])
        root, none = np.linalg.cholesky(information), np.zeros((len(along), 0))
        covariance[1:, 1:] = mirror_lower(dpotri(root, lower=1)[0])
        log_det = -2 * float(np.log(np.diag(root)).sum())
        stays, mean, places = np.ones(len(parts), dtype=bool), covariance @ along, _places(parts)
        alike = _AlikeCauses.of(covariance, places)
        return cls(
            tuple(parts), places, stays, _odds(parts), along, covariance, none, np.zeros(0), mean, log_det, alike
        )

    @property
    def log_odds(self) -> float:
        """Logarithm of the state's probability over that of the one in which nothing acts."""
        return float(self.odds[self.stays].sum() + 0.5 * (self.along @ self.mean + self.log_det))

    def add_cause(self, gram: Array, part: Part) -> "JointInclusion":
        """Return the fit with one more cause, behind the others."""
        return next(self.add_each(gram, [part]))

    def add_each(self, gram: Array, parts: Sequence[Part]) -> Iterator["JointInclusion"]:
        """Yield the fit with each of some causes, behind the others."""
        if not parts:
            return
        (columns, size), (new, its) = sizes_of(self.parts), sizes_of(parts)
        shared, first = np.zeros((len(self.mean), len(new))), len(self.covariance)
        shared[1:] = size[:, None] * gram[np.ix_(columns, new)] * its
        turned = self.change * self.signs @ (self.change.T @ shared)
        turned[:first] += self.covariance @ shared[:first]
        for part, place in zip(parts, _places(parts, 0), strict=True):
            yield self._add(gram, part, shared[:, place], turned[:, place])

    def _add(self, gram: Array, part: Part, shared: Array, turned: Array) -> "JointInclusion":
        """Add one of which products with what acts are known, (k + 1, w), and these times the covariance.

        A block's inverse follows by its Schur complement.
        """
        new, its = sizes_of([part])
        along = its * gram[new, -1]
        own = np.linalg.inv(np.eye(len(new)) + its[:, None] * gram[np.ix_(new, new)] * its - shared.T @ turned)
        root, mean = np.linalg.cholesky(own), own @ (along - shared.T @ self.mean)
        none, side = np.zeros((len(new), len(self.signs))), np.concatenate([-turned @ root, root])
        newcomer = np.zeros((1, padded_width(len(new))), dtype=int)
        newcomer[0, : len(new)] = np.arange(len(self.mean), len(side))
        block = np.eye(newcomer.shape[1])[None]
        block[0, : len(new), : len(new)] = own
        there = [each.with_change(side, 1.0) for each in self.alike]
        return JointInclusion(
            (*self.parts, part),
            (*self.places, slice(len(self.mean), len(side))),
            np.append(self.stays, True),
            np.append(self.odds, _odds([part])),
            np.append(self.along, along),
            self.covariance,
            np.column_stack([np.concatenate([self.change, none]), side]),
            np.append(self.signs, np.ones(len(new))),
            np.append(self.mean - turned @ mean, mean),
            self.log_det + 2 * float(np.log(np.diag(root)).sum()),
            (*there, _AlikeCauses(np.array([len(self.parts)]), newcomer, block)),
        )

    def remove_cause(self, k: int) -> "JointInclusion":
        """Return the fit without one of its causes: its parameters are nought then."""
        gone, first = self.places[k], len(self.covariance)
        side = self.change * self.signs @ self.change[gone].T
        if gone.stop <= first:
            side[:first] += self.covariance[:, gone]
        root = np.linalg.cholesky(side[gone])
        lost = solve_triangular(root, side.T, lower=True).T
        mean = self.mean - lost @ solve_triangular(root, self.mean[gone], lower=True)
        mean[gone] = 0.0
        stays = self.stays.copy()
        stays[k] = False
        return replace(
            self,
            stays=stays,
            change=np.column_stack([self.change, lost]),
            signs=np.append(self.signs, -np.ones(lost.shape[1])),
            mean=mean,
            log_det=self.log_det - 2 * float(np.log(np.diag(root)).sum()),
            alike=tuple(each.without(k).with_change(lost, -1.0) for each in self.alike),
        )

    def settle(self) -> "JointInclusion":
        """Return the same with all changes in the covariance, and without what was taken out."""
        kept = np.concatenate([[0], *(_range(p) for p, stays in zip(self.places, self.stays, strict=True) if stays)])
        old = kept[kept < len(self.covariance)]
        covariance = self.change[kept] * self.signs @ self.change[kept].T
        covariance[: len(old), : len(old)] += self.covariance[np.ix_(old, old)]
        parts = tuple(part for part, stays in zip(self.parts, self.stays, strict=True) if stays)
        places = _places(parts)
        return JointInclusion(
            parts,
            places,
            np.ones(len(parts), dtype=bool),
            self.odds[self.stays],
            self.along[kept],
            covariance,
            np.zeros((len(kept), 0)),
            np.zeros(0),
            self.mean[kept],
            self.log_det,
            _AlikeCauses.of(covariance, places),
        )

    def prune(self, free: bool = False) -> "JointInclusion":
        """Take out what is needless, the least first; the last one stays whatever it is worth, unless ``free``."""
        state = self
        while state.stays.sum() > 1:
            worth = state.conditional_log_odds()[: None if free else -1]
            least = int(np.argmin(worth))
            if worth[least] > 0:
                break
            state = state.remove_cause(least)
            if len(state.signs) > 64:  # directions: a product with so many is as quick as the processor can
                state = state.settle()
        return state

    def conditional_log_odds(self) -> Array:
        """Return the logarithm of the odds of each cause beside the others, (f,); infinite of what was taken out."""
        out = np.where(self.stays, self.odds, np.inf)
        for each in self.alike:
            out[each.causes] += each.log_odds(self.mean)
        return np.asarray(out)


def _places(parts: Sequence[Part], first: int = 1) -> tuple[slice, ...]:
    """Where the parameters of causes stand, behind the one that is nought."""
    ends = np.cumsum([first, *(len(b.columns) for b, _ in parts)]).tolist()
    return tuple(slice(a, e) for a, e in pairwise(ends))


def _range(place: slice) -> np.ndarray:
    return np.arange(place.start, place.stop)


def _odds(parts: Sequence[Part]) -> Array:
    return np.array([block.log_odds(size) for block, size in parts])
