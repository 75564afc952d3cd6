"""How much each sample of a run decides: leverage, left-out residuals, and what the parameters would be without it.

All of it is of the fit's last linearisation, W z ≈ r with columns W in standard deviations of a reading per prior sigma
and the prior z ~ N(0, 1) as P further readings. Sizes of noise and priors stay as the fit found them.
Source: Belsley, Kuh, Welsch, Regression Diagnostics, 1980, chapter 2, for a block of readings at a time.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np

from planner.common.determinism import on_one_thread
from planner.common.units import Array, read_only
from planner.fit.least_squares import Fit


@dataclass(frozen=True)
class Influence:
    """Diagnostics of a fit, one entry a sample.

    Attributes:
        names: of the parameters, (P,).
        covariance: of the parameters, (P, P) in their units.
        leverage: of each sample, (n,), 0 … r: how many of its r numbers the fit takes from itself.
        residual: reading − prediction of the fit, (n, r) [m or rad].
        left_out_residual: reading − prediction of the fit without this sample, (n, r) [m or rad].
        left_out_std: its standard deviation, by noise and what the others leave open, (n, r).
        change: by how much the parameters would change without the sample, (n, P) in their units.
        distance: Cook's distance of each sample, (n,): squared change in standard deviations over P.
        log_density: of each sample's reading as the others predict it, (n,): their sum judges a model.
        log_likelihood: of all readings by the fit itself.
    """

    names: tuple[str, ...]
    covariance: Array
    leverage: Array
    residual: Array
    left_out_residual: Array
    left_out_std: Array
    change: Array
    distance: Array
    log_density: Array
    log_likelihood: float

    @classmethod
    @on_one_thread
    def of(cls, fit: Fit) -> Self:
        """Return the diagnostics of a fit; rows count as the fit weighed them."""
        return cls(**_Linear.of(fit).diagnostics())


@dataclass(frozen=True)
class _Linear:
    """A fit, linearised: ``rows`` W (n, r, P), ``white`` e (n, r), both weighed; ``root`` (n, r, r) makes them so."""

    fit: Fit
    rows: Array
    white: Array
    root: Array

    @classmethod
    def of(cls, fit: Fit) -> Self:
        problem = fit.problem
        width = problem.model.width
        white = problem.white_columns(fit.errors)
        eye = np.broadcast_to(np.eye(width), (len(problem), width, width))
        root = problem.whitener.white(eye) * np.sqrt(problem.weight)[:, None, None]
        return cls(fit, white.rows, white.residual, root)

    @cached_property
    def spread(self) -> Array:
        """Inverse (P, P) of the information per prior sigma, the prior included."""
        wide = self.rows.reshape(-1, self.rows.shape[2])
        return np.asarray(np.linalg.inv(wide.T @ wide + np.eye(wide.shape[1])))

    def diagnostics(self) -> dict[str, Any]:
        """Return the fields of :class:`Influence`."""
        prior, width = self.fit.problem.prior, self.rows.shape[1]
        gain = self.rows @ self.spread  # (n, r, P)
        hat = gain @ self.rows.transpose(0, 2, 1)  # (n, r, r)
        left = np.eye(width) - hat
        white_left = np.asarray(np.linalg.solve(left, self.white[..., None])[..., 0], dtype=float)
        change = -np.einsum("nrp,nr->np", gain, white_left)
        information = np.linalg.inv(self.spread)
        raw = np.linalg.inv(self.root)
        predicted = raw @ np.linalg.inv(left) @ raw.transpose(0, 2, 1)
        names = self.fit.model.names
        return {
            "names": names,
            "covariance": read_only(self.spread * np.outer(prior, prior)),
            "leverage": read_only(np.trace(hat, axis1=1, axis2=2)),
            "residual": read_only((raw @ self.white[..., None])[..., 0]),
            "left_out_residual": read_only((raw @ white_left[..., None])[..., 0]),
            "left_out_std": read_only(np.sqrt(np.diagonal(predicted, axis1=1, axis2=2))),
            "change": read_only(change * prior),
            "distance": read_only(((change @ information) * change).sum(axis=1) / max(len(names), 1)),
            "log_density": read_only(self._log_density(left, white_left)),
            "log_likelihood": float(self._log_gauss(self.white, np.linalg.slogdet(self.root)[1]).sum()),
        }

    def _log_density(self, left: Array, white_left: Array) -> Array:
        """Log density of a left-out residual, whose covariance in standard deviations is (1 − H)⁻¹."""
        size = np.einsum("nr,nrs,ns->n", white_left, left, white_left)
        log_root = np.linalg.slogdet(self.root)[1] + np.linalg.slogdet(left)[1] / 2
        return np.asarray(-(size + self.rows.shape[1] * np.log(2 * np.pi)) / 2 + log_root)

    def _log_gauss(self, white: Array, log_root: Array) -> Array:
        return np.asarray(-((white**2).sum(axis=1) + white.shape[1] * np.log(2 * np.pi)) / 2 + log_root)
