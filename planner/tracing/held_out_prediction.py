"""What held-out samples would gain by a further effect, to first order: its columns border the fit's information.

A refit settles noise, prior sigmas and nonlinear values anew; where an effect is worth nothing, none of that changes
much. Most candidates are, and of these the prediction costs a tenth of the refit.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from planner.common.units import Array
from planner.effects.effect import Parameter
from planner.identification.cross_validation import Split, known_alone, steps_without_folds
from planner.identification.least_squares import Fit, prior_factors
from planner.identification.problem import FoldPieces
from planner.kinematics.chain import ForwardPass
from planner.model.columns import Columns
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
        steps = self._steps([C * prior for C in beside], [D * np.outer(prior, prior) for D in inner])
        residual, parts = self._fold_parts
        out = np.array(residual)
        for step, own, columns in zip(steps, self.pieces.samples, parts, strict=True):
            out[own] -= columns.times(problem.prior * step[:P])
            out[own] -= np.tensordot(prior * step[P:], rows[:, :, own], axes=1).T
        return out

    @cached_property
    def _fold_parts(self) -> tuple[Array, list[Columns]]:
        """Residuals (n, r) of the fit, and the columns of each fold's samples, in the units of readings."""
        linear = self.fit.problem.linearize(slice(None), self.fit.errors)
        return linear.residual, [linear.columns.take(own) for own in self.pieces.samples]

    @cached_property
    def _fold_factors(self) -> list[tuple[Array, Array]] | None:
        """For the fit without each fold the Cholesky factor R of its information, and R⁻ᵀ times its right-hand side.

        ``None`` where a fold alone knows some parameter, which is then fitted on that fold itself.
        """
        grams, z = self.pieces.grams, self.fit.errors / self.fit.problem.prior
        total, out = grams.sum(axis=0), list[tuple[Array, Array]]()
        for gram in grams:
            train = total - gram
            if known_alone(gram[:-1, :-1], total[:-1, :-1]).any():
                return None
            R = cholesky(train[:-1, :-1] + np.eye(len(z)), overwrite_a=True, check_finite=False)
            out.append((R, solve_triangular(R, train[:-1, -1] - z, trans="T", check_finite=False)))
        return out

    def _steps(self, beside: Sequence[Array], inner: Sequence[Array]) -> Array:
        """Return the steps (folds, P + k) in prior sigmas to the fits without each fold, with k further columns.

        Args:
            beside, inner: products of these in each fold per prior sigma, (P + 1, k) and (k, k).
        """
        C, D = np.sum(beside, axis=0), np.sum(inner, axis=0)
        alone = any(known_alone(own, D).any() for own in inner)
        if self._fold_factors is None or alone:
            z = np.append(self.fit.errors / self.fit.problem.prior, np.zeros(len(D)))
            bordered = [_border(*parts) for parts in zip(self.pieces.grams, beside, inner, strict=True)]
            return steps_without_folds(np.stack(bordered), z, np.full((1, len(z)), np.nan), np.ones((1, len(z))))[0]
        out = list[Array]()
        for (R, half), c, d in zip(self._fold_factors, beside, inner, strict=True):
            shared = solve_triangular(R, (C - c)[:-1], trans="T", check_finite=False)
            free = D - d - shared.T @ shared + np.eye(len(D))
            new = np.linalg.solve(free, (C - c)[-1] - shared.T @ half)
            out.append(np.append(solve_triangular(R, half - shared @ new, check_finite=False), new))
        return np.stack(out)

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
