"""Whether an effect that was added to the model stays in it."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import f as f_distribution

from planner.catalogue.curves import CURVE
from planner.identification import Bench, Metrics
from planner.identification.heldout import held_out, held_out_without
from planner.identification.stages import fall_in_errors, fitted_part, gain_in_errors
from planner.tracing.masses import GROUP
from planner.tracing.memory import inflation
from planner.tracing.state import Held, State

SURE = float(np.log(2e-3))  # chance, corrected for everything that was tried, below which an effect may be added
WORTH = 0.02  # share of the squared error, 1 % of the error, that an effect must take away to be worth a name
MANY = 8  # parameters above which an effect is a curve: some of its waves are always faint
DECIDED = 0.5  # share of a direction's prior variance that the readings leave, below which they decide it
SEEN = 3.0  # standard deviations that an effect's size must be above zero


def reason(before: State, after: State, bench: Bench, tried: int) -> str | None:
    """Return why the last effect of ``after`` is not kept, ``None`` if it is."""
    held = after.effects[-1]
    fall, error = gain(before, after, bench)
    if fall <= error:
        return "held-out samples gain no more than chance"
    if fall < WORTH:
        return f"held-out errors fall by {fall / 2:.1%} only"
    size = float(np.linalg.norm(after.sizes(held)))
    if size > held.entry.largest:
        return f"its size {size:.3g} is beyond what is plausible, {held.entry.largest:.3g}"
    memory = inflation(after, held)
    if len(after.positions(held)) <= MANY and strength(after, held)[0] / memory < SEEN**2:
        return "its size is not determined once everything is refitted"
    if wald_log_p(after, held, tried, memory) > SURE:
        return "it is no larger than chance would have it among so many"
    return None


def gain(before: State, after: State, bench: Bench) -> tuple[float, float]:
    """Share of the held-out squared error that goes from one state to another, and its standard error."""
    return gain_in_errors(before.stage, after.stage, bench.split)


@dataclass(frozen=True)
class Own:
    """What one effect gains for itself: against the model without it, everything else fitted anew.

    Attributes:
        fall: of the held-out root mean square error [m].
        share: of the held-out squared error that goes with it; ``error`` its standard error.
    """

    fall: float
    share: float
    error: float


def own_gains(state: State, bench: Bench) -> list[Own]:
    """What each effect of a state gains; noise, prior sizes and weights stay as they are."""
    fit = state.fit
    few = fitted_part(bench.run, fit.model) if len(fit.problem) < len(bench.run) else None
    split = bench.split if few is None else bench.split.take(few)
    names = fit.model.names
    slopes = [[names.index(h.slope_name)] if h.slope_name in names else [] for h in state.effects]
    parts = [[*state.positions(h), *slope] for h, slope in zip(state.effects, slopes, strict=True)]
    weights = [j for j, p in enumerate(fit.model.parameters) if p.group == GROUP]
    after = held_out(fit, split).residual
    bare = [h.residual for h in held_out_without(fit, split, parts, weights)]
    least = Metrics.of(after).rms
    return [Own(Metrics.of(b).rms - least, *fall_in_errors(b, after, split)) for b in bare]


def strength(state: State, held: Held) -> tuple[float, int]:
    """Wald statistic of an effect over the number of its parameters, and that number: how far its size is from zero.

    Of a gear's curve only what the readings decide is counted: waves that are too quick for the poses to show are
    expected near zero and found there. Wrong weights count as known: they show through the compliances only, and go
    with them.
    """
    model, R, prior = state.fit.model, state.fit.solution.factor, state.fit.problem.prior
    kept = np.array([j for j, p in enumerate(model.parameters) if p.group != GROUP])
    which = np.searchsorted(kept, state.positions(held))
    root = np.linalg.inv(np.linalg.qr(R[:, kept], mode="r"))[which]
    variance, axes = np.linalg.eigh(root @ root.T)  # per prior size: 1 where the readings say nothing
    along = axes.T @ (state.fit.errors / prior)[kept][which]
    told = variance < DECIDED
    if held.entry.kind != CURVE or not told.any():
        told = np.ones(len(which), dtype=bool)
    return float((along[told] ** 2 / variance[told]).mean()), int(told.sum())


def wald_log_p(state: State, held: Held, tried: int, memory: float | None = None) -> float:
    """Logarithm of the chance of so large an effect in the final model, corrected for everything that was tried.

    Beside other gears that run unevenly a gear's curve is one of as many as there are joints.
    """
    memory = inflation(state, held) if memory is None else memory
    if held.entry.kind == CURVE and sum(h.entry.kind == CURVE for h in state.effects) > 1:
        tried = min(tried, state.base.rig.robot.n_joints)
    spare = max(1.0, len(state.fit.problem) * state.fit.model.width / memory - state.fit.effective)
    size, directions = strength(state, held)
    one = f_distribution.logsf(size / memory, directions, spare)
    return min(0.0, float(one) + float(np.log(tried)))
