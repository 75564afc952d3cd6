"""The model during the search: the geometry and the effects found so far, fitted and judged."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.linalg.lapack import dtrtri

from planner.common.determinism import even_positions
from planner.common.units import Array
from planner.effects.basis import Times
from planner.effects.compliance import LINK_MASSES, WeightTorque
from planner.effects.effect import Effect, Parameter, ParameterMove, Role
from planner.effects.sizes import LINK_MASS
from planner.fit.assumptions import ROUGHLY_CONVERGED_SIGMAS
from planner.fit.least_squares import Fit, solve, subset_size
from planner.fit.problem import FitProblem, WhitenedColumns
from planner.fit.wild_rows import wild_cost
from planner.inference.stages import FitContext, FittedStage
from planner.model.identification_document import Stage
from planner.model.model import Model
from planner.tracing.dictionary import whitened_columns


def sensitivity_parameter(effect: Effect, value: float, sizes: Array) -> Parameter:
    """Return the parameter that moves the nonlinear value, the effect's parameters being ``sizes``."""
    assert effect.nonlinear is not None
    spacing = effect.nonlinear.spacing(value)
    h = 1e-3 * spacing  # of the grid's spacing, for the derivative
    moves: list[ParameterMove] = []
    for sign in (1.0, -1.0):
        for parameter, size in zip(effect.make(value + sign * h), sizes, strict=True):
            factor = float(sign * size / (2 * h))
            moves += [replace(m, phi=Times(factor, m.phi)) for m in parameter.moves]
    return replace(
        effect.make(value)[0],
        name=f"{effect.name}, {effect.nonlinear.name}",
        unit=effect.nonlinear.unit,
        prior=2 * spacing,
        what=f"{effect.nonlinear.name} of {effect.name}",
        moves=tuple(moves),
    )


def link_mass_parameters(base: Model, compliance: Sequence[tuple[int, float]]) -> list[Parameter]:
    """Return the parts by which links and tool weigh more than stated; ``compliance``: joints (from 0) and [rad/Nm]."""
    setup, robot = base.setup, base.setup.robot
    rotation = setup.chain.joint_places.tolist()
    out = []
    for link, mass in enumerate([*(None if m is None else m.mass for m in robot.masses), setup.tool_mass]):
        bearing = [(i, c) for i, c in compliance if i <= link]
        if not mass or not bearing:
            continue
        moves = tuple(
            ParameterMove("transform", rotation[i], Times(float(c * mass), WeightTorque(i, link))) for i, c in bearing
        )
        of_tool = link == len(robot.masses)
        what = f"part by which {'tool' if of_tool else f'link {link + 1}'} weighs more than stated"
        name = "weight_tool" if of_tool else f"weight{link + 1}"
        out.append(Parameter(name, LINK_MASS.unit, LINK_MASS.usual, what, moves, LINK_MASSES))
    return out


def link_mass_uncertainty(model: Model) -> float:
    """How far the masses of a fitted model are believed to be off, one sigma; 0 where there are none."""
    return max((p.prior for p in model.parameters if p.group == LINK_MASSES), default=0.0)


SETTLING_ROUNDS = 6  # in which nonlinear values settle
SETTLED_SIGMAS = 0.1  # standard deviations that a settled nonlinear value may still go


@dataclass(frozen=True)
class FittedEffect:
    """An effect in the model, and the value of its nonlinear parameter."""

    effect: Effect
    value: float | None = None

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.effect.name

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Its parameters, the nonlinear one left aside."""
        return self.effect.make(self.value)

    @property
    def sensitivity_name(self) -> str:
        """Name of the parameter that moves the nonlinear value, empty where there is none."""
        return f"{self.name}, {self.effect.nonlinear.name}" if self.effect.nonlinear else ""

    def has(self, role: Role) -> bool:
        """Tell whether the effect has any of the roles."""
        return self.effect.has(role)

    def step_value(self, step: float) -> "FittedEffect":
        """Move the nonlinear value, by one grid spacing at most: beyond it the linear step means nothing."""
        assert self.value is not None
        assert self.effect.nonlinear is not None
        width = self.effect.nonlinear.spacing(self.value)
        value = float(np.clip(self.value + step, self.value - width, self.value + width))
        return replace(self, value=self.effect.nonlinear.clip(value))

    def sensitivity(self, errors: dict[str, float]) -> Parameter | None:
        """The parameter that moves the nonlinear value, where there is one and the effect has a size."""
        sizes = np.array([errors.get(p.name, 0.0) for p in self.parameters])
        return sensitivity_parameter(self.effect, self.value, sizes) if self.value is not None and sizes.any() else None


@dataclass(frozen=True)
class SearchState:
    """Fitted model with its effects.

    Attributes:
        base: model without any effect.
        effects: in the order in which they were found.
        fitted: stage and fit with all of them.
    """

    base: Model
    effects: tuple[FittedEffect, ...]
    fitted: FittedStage

    @property
    def fit(self) -> Fit:
        """The fit of geometry and effects."""
        return self.fitted.fit

    @property
    def stage(self) -> Stage:
        """The stage with its errors."""
        return self.fitted.stage

    @property
    def white_columns(self) -> WhitenedColumns:
        """Whitened columns and residual about the fit."""
        return self.fit.problem.white_columns(self.fit.errors)

    @property
    def names(self) -> frozenset[str]:
        """Names of the effects."""
        return frozenset(f.name for f in self.effects)

    @property
    def structure(self) -> frozenset[tuple[str, int]]:
        """What tells the model from others: its effects, and how many parameters each has."""
        return frozenset((f.name, len(f.parameters)) for f in self.effects)

    def positions(self, found: FittedEffect) -> list[int]:
        """Positions of an effect's own parameters in the model, its nonlinear one left aside."""
        names = {p.name for p in found.parameters}
        return [j for j, name in enumerate(self.fit.model.names) if name in names]

    def sizes(self, found: FittedEffect) -> Array:
        """Values of an effect's parameters."""
        return self.fit.errors[self.positions(found)]

    def without(self, *effects: FittedEffect) -> tuple[FittedEffect, ...]:
        """Return the effects but these."""
        return tuple(f for f in self.effects if f not in effects)

    def evidence(self, correlation_time: float = 1.0) -> float:
        """Minus twice the logarithm of the run's likelihood under this model, its parameters averaged over (Laplace).

        Each parameter costs what the readings narrow its prior by, each nonlinear value what they narrow its grid by
        (MacKay 1992): of two models that fit alike the simpler one has the lower value. So many samples count as one.
        """
        problem, solution = self.fit.problem, self.fit.solution
        noise = float(np.linalg.slogdet(problem.whitener.covariance())[1].sum())
        grids = [len(f.effect.nonlinear.values) for f in self.effects if f.effect.nonlinear is not None]
        grids += [f.effect.scanned for f in self.effects]
        scanned = sum(2 * float(np.log(n)) for n in grids)
        precision = np.abs(np.diag(solution.factor)) / np.sqrt(correlation_time)
        narrowed = 2 * float(np.log(np.maximum(precision, 1.0)).sum())
        tails = wild_cost(problem.white_residual(self.fit.errors), problem.weight)
        return (solution.cost + noise + tails) / correlation_time + narrowed + scanned

    def refit(self, fit_context: FitContext, effects: tuple[FittedEffect, ...]) -> "SearchState":
        """Fit the base model with effects: nonlinear values of new ones settle first, then all parameters together.

        It starts from this state, with its noise and priors. Effects that it has keep their nonlinear values, whose
        steps are parameters of the fit.
        """
        return self._fit(fit_context, *self._settle(effects, self.fit.values))

    def settle(self, fit_context: FitContext, before: "SearchState", sigmas: float) -> "SearchState":
        """Fit anew where nonlinear values, or compliances since a state ``before``, are not where the fit has them.

        That is farther off than so many standard deviations, and compliances a tenth as large a part of themselves.
        """
        names, errors = self.fit.model.names, self.fit.values
        sigma = dict(zip(names, np.linalg.norm(self.fit.solution.root(self.fit.problem.prior), axis=1), strict=True))
        own = (f.sensitivity_name for f in self.effects if f.value is not None)
        settled = all(n in errors and abs(errors[n]) <= sigmas * sigma[n] for n in own)
        if settled and _are_alike(_compliances(self.effects), before.fit.values, errors, 0.1 * sigmas):
            return self
        return self._fit(fit_context, *_take_steps(self.effects, errors))

    def _fit(
        self, fit_context: FitContext, effects: tuple[FittedEffect, ...], errors: dict[str, float]
    ) -> "SearchState":
        """Fit the base model with effects whose nonlinear values stay."""
        sensitivities = [p for f in effects if (p := f.sensitivity(errors)) is not None]
        model = self.base.plus([*(p for f in effects for p in f.parameters), *sensitivities])
        masses = _link_masses(self.base, effects, errors)

        changed = any(f.has(Role.CHANGE) and f.name not in self.names for f in effects)
        before = self.fit.count_in_full() if changed else self.fit  # rows that it explains count for little there

        def fit(model: Model) -> FittedStage:
            """Return the stage of a model, fitted from this state on."""
            return fit_context.fit_stage(_stage_name(effects[-1].effect), model, before)

        fitted = fit(model.plus(masses))
        if masses and link_mass_uncertainty(fitted.fit.model) > LINK_MASS.largest:
            fitted = fit(model)  # they stand in for what is missing yet, and for the compliances themselves
        return SearchState(self.base, effects, fitted)

    @cached_property
    def covariance_root(self) -> tuple[np.ndarray, Array]:
        """Positions of all parameters but masses, (q,), and a root S (q, q) of their covariance per prior sigma.

        Masses count as known in it: they show through compliances only.
        """
        kept = np.array([j for j, p in enumerate(self.fit.model.parameters) if p.group != LINK_MASSES], dtype=int)
        R = self.fit.solution.factor
        if len(kept) < len(R):
            R = np.asarray(np.linalg.qr(R[:, kept], mode="r"))
        return kept, np.asarray(dtrtri(R)[0])

    def _settle(
        self, effects: tuple[FittedEffect, ...], errors: dict[str, float]
    ) -> tuple[tuple[FittedEffect, ...], dict[str, float]]:
        """Settle nonlinear values and the masses that show through compliances, on some samples of the run.

        Only where some effects that this state lacks have such.
        """
        # 3_000: samples of a long run settle the nonlinear values
        problem, most = self.fit.problem, subset_size(self.base, 3_000)
        new = tuple(f for f in effects if f not in self.effects)
        needed = any(f.value is not None or f.has(Role.COMPLIANCE) for f in new)
        if not needed:
            return effects, errors
        if len(problem) > most:
            problem = problem.take(even_positions(len(problem), most))
        if len(effects) == len(self.effects) + len(new) and not any(map(self._is_bound_to_others, new)):
            moved, errors = _settle_beside(problem, self.fit, new, errors)
            return (*(f for f in effects if f not in new), *moved), errors
        for _ in range(SETTLING_ROUNDS):
            effects, errors, settled = _settling_step(problem, self.base, effects, errors)
            if settled:
                break
        return effects, errors

    def _is_bound_to_others(self, new: FittedEffect) -> bool:
        """Tell whether values that this state has move with those of a further effect.

        Two warm-ups at one place share one curve between them; waves of other frequencies hardly know of each other.
        """
        again = any(f.effect.family == new.effect.family for f in self.effects)
        return new.has(Role.COMPLIANCE) or (again and new.value is not None and not new.has(Role.GEAR_WAVE))


def _stage_name(last: Effect) -> str:
    """Return what the stage is called that an effect is the last of: of what stepped again and again, how often."""
    return f"{last.family}, {last.repeat} times" if last.has(Role.CHANGE) and last.repeat > 1 else last.name


def _link_masses(base: Model, effects: tuple[FittedEffect, ...], errors: dict[str, float]) -> list[Parameter]:
    """Masses other than stated, as the compliances that are known so far show them."""
    compliances = [
        (f.effect.place.joint, errors.get(f.parameters[0].name, 0.0))
        for f in _compliances(effects)
        if f.effect.unit == "rad/Nm"  # else masses are unknown, and what they do is fitted link by link
    ]
    return link_mass_parameters(base, [(i, round(c, 12)) for i, c in compliances if i is not None and c])


def _compliances(effects: tuple[FittedEffect, ...]) -> list[FittedEffect]:
    return [f for f in effects if f.has(Role.COMPLIANCE)]


def _settling_step(
    problem: FitProblem, base: Model, effects: tuple[FittedEffect, ...], errors: dict[str, float]
) -> tuple[tuple[FittedEffect, ...], dict[str, float], bool]:
    """One step of the nonlinear values with everything else free, and whether none moved by more than σ/10."""
    sensitivities = {f.name: p for f in effects if (p := f.sensitivity(errors)) is not None}
    own = [p for f in effects for p in f.parameters]
    everything = [*base.parameters, *own, *sensitivities.values(), *_link_masses(base, effects, errors)]
    priors = dict(zip(problem.model.names, problem.model.prior, strict=True))
    model = replace(base, parameters=tuple(replace(p, prior=priors.get(p.name, p.prior)) for p in everything))
    here = problem.with_model(model)
    zero = {p.name: 0.0 for p in sensitivities.values()}
    found = solve(here, np.array([(errors | zero).get(p.name, 0.0) for p in everything]), ROUGHLY_CONVERGED_SIGMAS)
    value = dict(zip(model.names, found.errors, strict=True))
    sigma = dict(zip(model.names, np.linalg.norm(found.root(here.prior), axis=1), strict=True))
    moved, value = _take_steps(effects, value)
    # 0.02: relative change of a compliance that ends the rounds
    settled = (
        len(sensitivities) == sum(f.value is not None for f in effects)
        and all(abs(value[p.name]) <= SETTLED_SIGMAS * sigma[p.name] for p in sensitivities.values())
        and _are_alike(_compliances(effects), errors, value, 0.02)
    )
    return (effects if settled else moved), value, settled


def _settle_beside(
    problem: FitProblem, fit: Fit, new: tuple[FittedEffect, ...], errors: dict[str, float]
) -> tuple[tuple[FittedEffect, ...], dict[str, float]]:
    """Settle the nonlinear values of effects beside a fit, what it has staying as it is linearised about it.

    Their columns border those of the fit, which are reduced once: R of these with their priors gives what of the new
    ones they do not span.
    """
    about, motion = problem.white_columns(fit.errors).factored, problem.model.motion(problem.context, fit.errors)
    gram = about.gram
    R = cholesky(gram[:-1, :-1] + np.eye(len(fit.errors)))
    rest = solve_triangular(R, gram[:-1, -1] - fit.errors / problem.prior, trans="T")
    for _ in range(SETTLING_ROUNDS):
        steps = [p for f in new if (p := f.sensitivity(errors)) is not None]
        own = (*(p for f in new for p in f.parameters), *steps)
        columns = whitened_columns(problem, own, motion)
        beside = about.products(columns)
        half = solve_triangular(R, beside[:-1], trans="T")
        inner = np.tensordot(columns, columns, axes=((1, 2), (1, 2))) - half.T @ half + np.eye(len(own))
        prior = np.array([p.prior for p in own])
        sizes = prior * np.linalg.solve(inner, beside[-1] - half.T @ rest)
        sigmas = prior * np.sqrt(np.diag(np.linalg.inv(inner)))
        sigma = dict(zip((p.name for p in own), sigmas.tolist(), strict=True))
        errors = errors | dict(zip(sigma, sizes.tolist(), strict=True))
        moved, after = _take_steps(new, errors)
        settled = len(steps) == sum(f.value is not None for f in new)
        if settled and all(abs(errors[p.name]) <= SETTLED_SIGMAS * sigma[p.name] for p in steps):
            return new, errors
        new, errors = moved, after
    return new, errors


def _are_alike(
    compliances: Sequence[FittedEffect], before: dict[str, float], after: dict[str, float], part: float
) -> bool:
    """Tell whether compliances changed by less than a part of themselves, so that the masses on them do the same."""
    names = [f.parameters[0].name for f in compliances]
    return all(abs(after.get(n, 0.0) - before.get(n, 0.0)) <= part * abs(after.get(n, 0.0)) for n in names)


def _take_steps(
    effects: tuple[FittedEffect, ...], errors: dict[str, float]
) -> tuple[tuple[FittedEffect, ...], dict[str, float]]:
    """Move nonlinear values by the parameters that stand for their steps; return the effects and all values."""
    moved = tuple(f.step_value(errors[f.sensitivity_name]) if f.sensitivity_name in errors else f for f in effects)
    for before, after in zip(effects, moved, strict=True):  # parameters bear their nonlinear value in their names
        errors = errors | {q.name: errors[p.name] for p, q in zip(before.parameters, after.parameters, strict=True)}
    return moved, errors


def number_repeat(effect: Effect, effects: tuple[FittedEffect, ...]) -> Effect:
    """Return the effect under a name that no other one has yet."""
    names = {f.name for f in effects}
    while effect.name in names:
        effect = replace(effect, repeat=effect.repeat + 1)
    return effect


def known_values(effect: Effect, effects: tuple[FittedEffect, ...]) -> list[float]:
    """Nonlinear values that effects of the same kind at the same place have already."""
    return [f.value for f in effects if f.effect.family == effect.name and f.value]


def may_join(effect: Effect, effects: tuple[FittedEffect, ...]) -> bool:
    """Tell whether an effect may be added to others: a new one, or one that may come again.

    A joint gives way by one measure of its load: computed, read from the drive, or that of the payload alone.
    """
    if effect.name not in {f.name for f in effects}:
        yields = effect.has(Role.YIELDING)
        return not (yields and any(f.has(Role.YIELDING) and f.effect.place == effect.place for f in effects))
    return effect.has(Role.REPEATABLE) and len(known_values(effect, effects)) < 4  # effects of one kind at one place
