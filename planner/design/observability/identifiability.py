"""Which parameters the readings can tell apart, and why the others are left out.

What cannot be seen is a *direction* of the parameter space, so the null space comes first (SVD of the triangular factor
of all rows) and names second: one parameter is fixed for each unseen direction, and the sentence about it is read off
the null vector in which it, and no other fixed one, takes part. Compare Gautier 1991 (QR on base parameters).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr

from planner.common.errors import InputError
from planner.common.units import Array, read_only
from planner.design.observability.explanations import explain_direction
from planner.design.observability.information import r_factor

STRUCTURAL = 1e-9
"""Singular values below this share of the largest count as exact zeros.

Columns are scaled by the prior sizes first. A QR in double precision leaves about P * 2e-16 of rounding there, analytic
columns agree with finite differences to better than 1e-9, and the faintest direction that a robot's geometry really
shows lies above 1e-5: every cut between gives the same rank.
"""
FAINT = 0.1
"""A direction is left out when readings and noise alone would know it ten times worse than its prior size says.

Between that and the prior size itself it is kept and named weak: well-chosen poses see several times more of it than
the average candidate does.
"""
_DROP = 0.5  # a parameter may stand for an unseen direction if its share is at least this part of the largest share
_PREFER = 0.1  # with an explicit order of preference, a smaller share will do


@dataclass(frozen=True)
class DroppedParameter:
    """One parameter that is held at its nominal value, with the sentence that says why.

    ``direction`` is the unseen direction as ((name, coefficient), ...), in m and rad, unit length, this parameter's
    coefficient positive and no other dropped parameter in it.
    """

    name: str
    because: str
    direction: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class WeakParameter:
    """A kept parameter whose predicted standard deviation exceeds its prior size [m or rad]: it is hardly learnt."""

    name: str
    std: float
    prior: float


@dataclass(frozen=True)
class Identifiability:
    """What can be seen.

    ``kept`` column indices, ascending; ``names`` of those; ``dropped`` and ``weak`` as said there; ``rank``;
    ``spectrum`` (P,) singular values of the rms reading per prior size, descending; ``gap`` the ratio of the smallest
    seen to the largest unseen singular value (inf when nothing is unseen).
    """

    kept: tuple[int, ...]
    names: tuple[str, ...]
    dropped: tuple[DroppedParameter, ...]
    weak: tuple[WeakParameter, ...]
    spectrum: Array
    gap: float

    @property
    def rank(self) -> int:
        """The number of parameters that can be told apart."""
        return len(self.kept)


def _split_spectrum(scaled: Array, faint: float) -> tuple[Array, Array]:
    """Singular values (P,) of a scaled triangular factor and an orthonormal basis (P, k) of what is not seen."""
    _, mu, axes = np.linalg.svd(scaled)
    seen = (mu > STRUCTURAL * mu[0]) & (mu > faint) & (mu > 0)
    return mu, axes[~seen].T


def find_identifiable(
    rows: Array,
    names: Sequence[str],
    prior: Array | None = None,
    prefer: Sequence[int] | None = None,
    noise: float | None = None,
    readings: int | None = None,
) -> Identifiability:
    """Split the parameters into those the readings of ``rows`` (n, r, P) can tell apart and the rest.

    ``prior`` (P,) is the 1-sigma size of each parameter before measuring [m or rad]; ``prefer`` lists column indices in
    the order in which to keep them (default: as listed). With ``noise`` [m or rad], the standard deviation of a
    reading, and ``readings``, how many will be taken (default: all rows), a direction far fainter than its prior
    size is left out as well (:data:`FAINT`), and parameters whose predicted standard deviation exceeds their
    prior size are listed in ``weak``.

    Raises:
        InputError: counts do not match, a prior is not positive, or no parameter is seen at all.
    """
    count = rows.shape[-1]
    size = np.ones(count) if prior is None else np.asarray(prior, dtype=float)
    order = list(range(count)) if prefer is None else list(prefer)
    _check_arguments(count, names, size, order)
    factor, stock = r_factor(rows), rows[..., 0].size
    total = readings or stock
    mu, null = _split_spectrum(
        factor * (size / np.sqrt(stock)), 0.0 if noise is None else FAINT * noise / np.sqrt(total)
    )
    if null.shape[1] == count:
        raise InputError("no reading depends on any parameter: nothing can be identified from these poses")
    out = _choose_dropped(null, order, _DROP if prefer is None else _PREFER)
    out = _ensure_full_rank(factor * size, out)
    kept = tuple(k for k in range(count) if k not in out)
    seen = len(kept)
    faint = seen < count and bool(mu[seen] > STRUCTURAL * mu[0])
    dropped = _explain_dropped(null, out, names, size, faint)
    weak = () if noise is None else _find_weak(factor / np.sqrt(stock / total), names, size, kept, noise)
    gap = float(mu[seen - 1] / mu[seen]) if seen < count and mu[seen] > 0 else float("inf")
    return Identifiability(kept, tuple(names[k] for k in kept), dropped, weak, read_only(mu), gap)


def _check_arguments(count: int, names: Sequence[str], size: Array, order: list[int]) -> None:
    if len(names) != count or size.shape != (count,):
        raise InputError(f"{count} columns, but {len(names)} names and {size.size} prior sizes")
    if np.any(size <= 0) or not np.all(np.isfinite(size)):
        bad = names[int(np.flatnonzero(~(size > 0) | ~np.isfinite(size))[0])]
        raise InputError(f"the prior size of {bad} must be a number above zero")
    if sorted(order) != list(range(count)):
        raise InputError("the order of preference must name every parameter once")


def _choose_dropped(null: Array, order: list[int], share: float) -> list[int]:
    """Pick one parameter for each unseen direction: the least preferred with a fair share in what is still unseen."""
    rest, out = null, list[int]()
    while rest.shape[1]:
        part = np.linalg.norm(rest, axis=1)
        part[out] = 0.0
        pick = next(k for k in reversed(order) if part[k] >= share * part.max())
        out.append(pick)
        toward = rest[pick] / np.linalg.norm(rest[pick])
        others = np.linalg.svd(toward[None])[2][1:].T  # the directions that leave the picked parameter alone
        rest = rest @ others
    return out


def _ensure_full_rank(scaled: Array, out: list[int]) -> list[int]:
    """Check that the kept columns have full rank; if not, choose afresh by QR with column pivoting."""
    kept = [k for k in range(scaled.shape[1]) if k not in out]
    mu = np.linalg.svd(scaled[:, kept], compute_uv=False)
    if mu[-1] > STRUCTURAL * mu[0]:
        return out
    pivots = qr(scaled, mode="r", pivoting=True)[1]
    return [int(k) for k in pivots[len(kept) :]]


def _explain_dropped(
    null: Array, out: list[int], names: Sequence[str], size: Array, faint: bool
) -> tuple[DroppedParameter, ...]:
    """Give each dropped parameter the one unseen direction that holds no other dropped one, and its sentence."""
    if not out:
        return ()
    echelon = null @ np.linalg.inv(null[out])
    found = []
    for column, pick in enumerate(out):
        vector = np.where(np.abs(echelon[:, column]) > 1e-6, echelon[:, column], 0.0) * size
        vector = vector / np.linalg.norm(vector)
        shares = vector.tolist()
        support = [k for k in range(len(names)) if shares[k] != 0.0]
        support.sort(key=lambda k: (k != pick, -round(abs(shares[k]), 9), k))
        direction = tuple((names[k], shares[k]) for k in support)
        found.append((pick, DroppedParameter(names[pick], explain_direction(direction, faint=faint), direction)))
    return tuple(each for _, each in sorted(found, key=lambda item: item[0]))


def _find_weak(
    factor: Array, names: Sequence[str], size: Array, kept: tuple[int, ...], noise: float
) -> tuple[WeakParameter, ...]:
    inverse = np.linalg.inv(np.linalg.qr(factor[:, list(kept)], mode="r"))
    std = noise * np.linalg.norm(inverse, axis=1)
    return tuple(
        WeakParameter(names[k], float(s), float(size[k])) for k, s in zip(kept, std, strict=True) if s > size[k]
    )
