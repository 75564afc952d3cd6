"""What held-out samples would gain by a further effect, to first order: its columns border the fit's information.

A refit settles noise, prior sigmas and nonlinear values anew; where an effect is worth nothing, none of that changes
much. Most candidates are, and of these the prediction costs a tenth of the refit.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_triangular

from planner.common.units import Array
from planner.effects.effect import Parameter
from planner.identification.cross_validation import Split, steps_without_folds
from planner.identification.least_squares import Fit, prior_factors
from planner.identification.problem import FoldPieces
from planner.kinematics.chain import ForwardPass
from planner.tracing.dictionary import whiten_columns


@dataclass(frozen=True)
class HeldOutPredictor:
    """A fit of a short run as its folds see it.

    Attributes:
        fit, split: whose they are.
        motion: forward pass about the fit.
        pieces: its whitened columns by folds.
    """

    fit: Fit
    split: Split
    motion: ForwardPass
    pieces: FoldPieces

    @classmethod
    def of(cls, fit: Fit, split: Split) -> "HeldOutPredictor":
        """Look at a fit by folds."""
        problem = fit.problem
        motion = problem.model.motion(problem.context, fit.errors)
        return cls(fit, split, motion, FoldPieces.of(problem, fit.errors, split.fold))

    def residual_with(self, parameters: Sequence[Parameter]) -> Array:
        """Return reading − prediction (n, r) of every sample by the fit without its fold, with further parameters."""
        problem, P = self.fit.problem, len(self.fit.errors)
        rows = replace(problem.model, parameters=tuple(parameters)).columns(problem.context, self.motion).dense
        beside, inner = self._products(rows)
        prior = self._likeliest_priors(parameters, np.sum(beside, axis=0), np.sum(inner, axis=0))
        bordered = [
            _border(gram, C * prior, D * np.outer(prior, prior))
            for gram, C, D in zip(self.pieces.grams, beside, inner, strict=True)
        ]
        z = np.append(self.fit.errors / problem.prior, 0 * prior)
        free, own_sizes = np.full((1, len(z)), np.nan), np.ones((1, len(z)))
        steps = steps_without_folds(np.stack(bordered), z, free, own_sizes)[0]
        linear = problem.linearize(slice(None), self.fit.errors)
        out = np.array(linear.residual)
        for step, own in zip(steps, self.pieces.samples, strict=True):
            out[own] -= linear.columns.take(own).times(problem.prior * step[:P])
            out[own] -= np.tensordot(prior * step[P:], rows[:, :, own], axes=1).T
        return out

    def _products(self, rows: Array) -> tuple[list[Array], list[Array]]:
        """Return the products of columns (k, r, n), whitened, in each fold: with the fit's, and with each other."""
        white = whiten_columns(self.fit.problem, rows)
        beside, inner = list[Array](), list[Array]()
        for columns, own in zip(self.pieces.columns, self.pieces.samples, strict=True):
            part = white[:, :, own]
            beside.append(columns.products(part))
            inner.append(np.tensordot(part, part, axes=((1, 2), (1, 2))))
        return beside, inner

    def _likeliest_priors(self, parameters: Sequence[Parameter], beside: Array, inner: Array) -> Array:
        """Return the prior sigmas (k,) of further parameters under which the run is likeliest.

        Args:
            parameters: of a new kind.
            beside, inner: products of their columns over the run with the fit's and with each other.
        """
        half = solve_triangular(self.fit.solution.factor, beside[:-1], trans="T")
        free, along = inner - half.T @ half, beside[-1]
        model = replace(self.fit.model, parameters=tuple(parameters))
        prior = model.prior
        for _ in range(4):  # rounds, each as of a fit
            inverse = np.linalg.inv(free * np.outer(prior, prior) + np.eye(len(prior)))
            sizes = prior * (inverse @ (prior * along))
            prior = model.prior * prior_factors(model, model.prior, sizes, np.diag(inverse))
        return prior


def _border(gram: Array, beside: Array, inner: Array) -> Array:
    """Put k columns, with products (P + 1, k) and (k, k), between a gram's others (P + 1, P + 1) and the residual."""
    P, k = len(gram) - 1, len(inner)
    out = np.empty((P + k + 1, P + k + 1))
    old, new = np.append(np.arange(P), P + k), slice(P, P + k)
    out[np.ix_(old, old)] = gram
    out[old, new], out[new, old], out[new, new] = beside, beside.T, inner
    return out
