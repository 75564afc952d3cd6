"""A refit that stays linear about a fitted state: what the candidates of a long run are compared by.

Errors are small: about the state's fit the model with another effect is as good as linear. The products of the state's
columns with each other are there already, so that only those with the few new columns are formed, where a refit would
form all of them several times. The winner is then fitted anew. The noise of a refit is that of the state but for its
size, and so are the factors on the prior sizes but for those of what is new.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular

from planner.common.units import Array
from planner.effects.effect import Parameter, Role
from planner.identification.cross_validation import Split
from planner.identification.least_squares import Fit, Solution, prior_factors
from planner.identification.problem import LinearPiece
from planner.identification.stages import FitContext, FittedStage
from planner.kinematics.chain import ForwardPass
from planner.model.columns import Columns
from planner.model.identification_document import Metrics, Stage
from planner.tracing.normal_equations import (
    FactoredEquations,
    FoldEquations,
    RemainingColumns,
    WiderEquations,
)
from planner.tracing.state import SETTLING_ROUNDS, STILL_SIGMAS, FittedEffect, SearchState


@dataclass(frozen=True)
class LinearState:
    """A state linearised about its fit.

    Attributes:
        state: the state.
        split: of the samples that it was fitted to.
        motion: forward pass at the fit.
        white: whitened columns per prior size, and the residual behind them.
        members: samples of each fold.
        folds: the columns over these.
        grams: products of all columns over each fold, (folds, P + 1, P + 1).
    """

    state: SearchState
    split: Split
    motion: ForwardPass
    white: Columns
    members: tuple[np.ndarray, ...]
    folds: tuple[Columns, ...]
    grams: Array

    @classmethod
    def of(cls, state: SearchState, fit_context: FitContext) -> "LinearState":
        """Linearise a state about its fit."""
        problem, errors, split = state.fit.problem, state.fit.errors, fit_context.split
        few = fit_context.part(state.fit.model)
        split = split if few is None else split.take(few)
        motion = problem.model.motion(problem.context, errors)
        white = problem.piece(slice(None), errors).factored
        members = tuple(np.flatnonzero(split.fold == f) for f in range(split.folds))
        folds = tuple(white.take(m) for m in members)
        return cls(state, split, motion, white, members, folds, np.stack([c.gram for c in folds]))

    def refit(self, effects: tuple[FittedEffect, ...]) -> SearchState:
        """Return the state with other effects; none that comes or goes is a compliance, whose masses would change."""
        fit, rest = self.state.fit, self._rest(effects)
        base = self._equations if len(rest.kept) == len(fit.errors) else FoldEquations.of(self.grams, rest)
        effects, added = self._settle(rest, base.whole, effects)
        columns = self._columns(added)
        new = tuple(columns.take(mine) for mine in self.members)
        equations, weight = self._widen(base, rest, new), 1.0
        white = rest.residual(self.white, columns, equations.whole.step)
        ease = self._noise_ratio(float((white**2).sum()), equations.whole.effective)
        # 0.1: change of the variance's logarithm, up to which the equations of a state serve for a refit
        if abs(np.log(ease)) > 0.1:  # the prior's weight beside the readings is another
            base, weight = FoldEquations.of(self.grams / ease, rest), ease
            equations = WiderEquations(base, equations.products / ease, equations.squares / ease, equations.z)
            white = rest.residual(self.white, columns, equations.whole.step)
        best = equations.whole
        problem = fit.problem.with_model(replace(fit.model, parameters=(*rest.parameters, *added)))
        problem = replace(problem, whitener=problem.whitener.times(float(np.sqrt(ease))))
        at = equations.z + best.step
        cost = float((white**2).sum()) / ease + float(at @ at)
        solution = Solution(problem.prior * at, best.factor * np.sqrt(weight / ease), cost)
        held = self._held_residual(rest, new, equations.steps_without_folds)
        stage = self._stage(effects, len(at), white, held)
        residual = Columns(white.T[None], np.zeros(1, dtype=int), self.white.screws[:0])
        piece = LinearPiece(self.white.select(rest.kept).beside(columns).beside(residual))
        found = Fit(problem, solution, best.effective, np.zeros(0, dtype=int))
        return SearchState(self.state.base, effects, FittedStage(stage, found, ()), piece)

    def _widen(self, base: FoldEquations, rest: RemainingColumns, new: tuple[Columns, ...]) -> WiderEquations:
        """Return the equations of what stays and of new columns, which are given over each fold."""
        products = np.stack([rest.reduce_products(c.products(n)) for c, n in zip(self.folds, new, strict=True)])
        z = np.append(rest.z, np.zeros(len(new[0])))
        return WiderEquations(base, products, np.stack([n.gram for n in new]), z)

    @cached_property
    def _equations(self) -> FoldEquations:
        """Those of the state with all of its effects."""
        return FoldEquations.of(self.grams, self._rest(self.state.effects))

    def _noise_ratio(self, square: float, effective: float) -> float:
        """Variance of the noise that a refit finds, by the sum of squares that it leaves, over that of the state."""
        fit = self.state.fit
        readings = len(fit.problem) * fit.model.width
        before = float(self.grams[:, -1, -1].sum()) / (readings - fit.effective)
        return square / (readings - effective) / before

    def _held_residual(self, rest: RemainingColumns, new: tuple[Columns, ...], steps: Array) -> Array:
        """Whitened residual (n, r) of each fold after the step (folds, P) to the fit without it."""
        out = np.empty((len(self.split.fold), self.state.fit.model.width))
        for mine, fold, own, step in zip(self.members, self.folds, new, steps, strict=True):
            out[mine] = rest.residual(fold, own, step)
        return out

    def _rest(self, effects: tuple[FittedEffect, ...]) -> RemainingColumns:
        """What stays of the state without those of its effects that are not among ``effects``."""
        fit = self.state.fit
        gone = self.state.without(*effects)
        names = {p.name for f in gone for p in f.parameters} | {f.sensitivity_name for f in gone}
        kept = np.array([k for k, p in enumerate(fit.model.parameters) if p.name not in names], dtype=int)
        z = fit.errors / fit.problem.prior
        part = np.append(z, 1.0)
        part[kept] = 0.0
        return RemainingColumns(tuple(fit.model.parameters[k] for k in kept), kept, z[kept], part)

    def _settle(
        self, rest: RemainingColumns, equations: FactoredEquations, effects: tuple[FittedEffect, ...]
    ) -> tuple[tuple[FittedEffect, ...], tuple[Parameter, ...]]:
        """Settle the nonlinear values and the prior sizes of what is new; return it with its parameters."""
        factor, right = equations.factor, equations.right
        new = [f for f in effects if f not in self.state.effects]
        errors = dict[str, float]()
        for left in reversed(range(SETTLING_ROUNDS)):
            moving = {f.name: p for f in new if (p := f.sensitivity(errors)) is not None}
            parameters = (*(p for f in new for p in f.parameters), *moving.values())
            columns = self._columns(parameters)
            products = rest.reduce_products(self.white.products(columns))
            shared = solve_triangular(factor, products[:-1], trans="T")
            size, z, sigma = self._prior_sizes(
                parameters, columns.gram - shared.T @ shared, products[-1] - right @ shared
            )
            errors = {p.name: v for p, v in zip(parameters, size * z, strict=True)}
            going = {p.name: abs(v) > STILL_SIGMAS * s for p, v, s in zip(parameters, z, sigma, strict=True)}
            waiting = any(f.value is not None and f.name not in moving for f in new)
            if left == 0 or not (waiting or any(going[p.name] for p in moving.values())):
                break
            moved = [f.step_value(errors[moving[f.name].name]) if f.name in moving else f for f in new]
            for before, after in zip(new, moved, strict=True):  # names of parameters bear the value
                errors |= {q.name: errors[p.name] for p, q in zip(before.parameters, after.parameters, strict=True)}
            new = moved
        sized = tuple(replace(p, prior=float(s)) for p, s in zip(parameters, size, strict=True))
        own = iter(new)
        effects = tuple(f if f in self.state.effects else next(own) for f in effects)
        return effects, sized

    def _prior_sizes(
        self, parameters: tuple[Parameter, ...], information: Array, along: Array
    ) -> tuple[Array, Array, Array]:
        """Return prior sizes (k,) at which the run is likeliest; values and standard deviations in these."""
        model = replace(self.state.fit.model, parameters=parameters)
        factors = np.ones(len(parameters))
        for _ in range(8):  # rounds in which the factors on new prior sigmas settle
            H = factors[:, None] * information * factors + np.eye(len(factors))
            covariance = np.linalg.inv(H)
            z = covariance @ (factors * along)
            again = prior_factors(model, model.prior, model.prior * factors * z, np.diag(covariance))
            if np.abs(again / factors - 1).max(initial=0.0) < 0.02:  # relative change of a factor that ends them
                break
            factors = again
        return model.prior * factors, z, np.sqrt(np.diag(covariance))

    def _columns(self, parameters: tuple[Parameter, ...]) -> Columns:
        """Whitened columns of parameters per prior size."""
        problem = self.state.fit.problem
        model = replace(problem.model, parameters=parameters)
        columns = model.columns(problem.context, self.motion)
        white = columns.whiten(self._root, model.prior, np.zeros((len(problem), model.width)))
        return white.select(np.arange(len(parameters)))

    def _stage(self, effects: tuple[FittedEffect, ...], parameters: int, white: Array, held: Array) -> Stage:
        """Return the stage with residuals (n, r) that are given whitened."""
        residual, held = (np.einsum("nij,nj->ni", self._unwhiten, r) for r in (white, held))
        return Stage(
            name=effects[-1].name,
            parameters=parameters,
            train=Metrics.of(residual),
            held_out=Metrics.of(held, self.split.fold),
            residual=residual,
            held_residual=held,
        )

    @cached_property
    def _root(self) -> Array:
        """L⁻¹ of every sample, (r, r, n) by column and row, robust weights in it."""
        problem = self.state.fit.problem
        return np.ascontiguousarray((problem.whitener.root * np.sqrt(problem.weight)[:, None, None]).T)

    @cached_property
    def _unwhiten(self) -> Array:
        """L of every sample, (n, r, r)."""
        return np.asarray(np.linalg.inv(self._root.T))


def changes_compliance(state: SearchState, effects: tuple[FittedEffect, ...]) -> bool:
    """Tell whether a compliance comes or goes from a state to other effects: masses that show through it change."""
    own = {f.name for f in state.effects if f.has(Role.COMPLIANCE)}
    return own != {f.name for f in effects if f.has(Role.COMPLIANCE)}
