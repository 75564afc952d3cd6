"""From the stages of a fit to the robot that is released."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from planner.cell.cell import Cell
from planner.common.determinism import even_positions
from planner.common.summary import Aside
from planner.common.system import give_back_memory
from planner.common.units import MM, Array, mean_by_group, to_mm
from planner.effects.steps import SLIP
from planner.fit.assumptions import (
    ANOTHER_TOOL_SHARE,
    CURVE_GAIN,
    CURVE_STANDARD_ERRORS,
    DENSE_READINGS,
    NOTICED,
    POSITION_AXES,
    WORTH_SAYING,
)
from planner.fit.cross_validation import Split, predict_held_out
from planner.fit.gross_errors import DeclaredGeometry
from planner.fit.least_squares import Fit, solve
from planner.fit.problem import FitProblem
from planner.fit.wild_rows import unseen_weights
from planner.inference.misfit import (
    SWEEPS,
    HeldOutRegion,
    RepeatedReadings,
    draw_misfit,
    predict_regions,
    predict_validation,
)
from planner.inference.posterior_background import EffectFamily, background_families, curve_groups
from planner.inference.posterior_draws import ChainLimits
from planner.inference.posterior_fit import PosteriorFit, draw_posterior
from planner.inference.stages import FitContext, FittedStage
from planner.model.identification_document import Metrics, Release, WorkToolError
from planner.model.model import Model
from planner.release.compromise import choose_compromise, interpolate_fit
from planner.release.error_parts import error_parts, misfit_place, open_misfit_place
from planner.release.released_robot import ReleasedRobot
from planner.release.tool_map import ToolMap, drift_of, tool_maps
from planner.release.unseen_errors import unseen_errors
from planner.runs.run import Run


def release_robot(
    stages: Sequence[FittedStage],
    whole: Model,
    context: FitContext,
    cell: Cell,
    time: float,
    geometry_alone: bool,
    declared: DeclaredGeometry,
    variants: Sequence[EffectFamily] = (),
) -> ReleasedRobot:
    """Fit the posterior and return the robot to be written.

    It lies on the way from geometry alone to a compromise between it and the posterior, as far along as it is hardly
    ever noticeably worse over the workspace than geometry alone: what an arm may have besides is no reason to move it.
    Where it predicts poses held out worse than geometry alone does, or is hardly better, geometry alone is released.

    Args:
        stages: of the fit; the last one's findings enter the posterior where they pay.
        whole: gauge and geometry, identifiable or not.
        context: run and split.
        cell: the cell.
        time: how many samples are worth one.
        geometry_alone: release the geometry as fitted alone.
        declared: what the run says of one factor on all lengths.
        variants: the last stage's findings at other values of their inner numbers.

    Raises:
        NoSolutionError: the posterior does not come to rest.
    """
    last, plain = stages[-1].fit, next(s for s in stages if s.stage.name == "geometry")
    run, split, limits = context.run, context.split, context.limits
    families = (*background_families(last.setup, run.samples), *variants)
    if geometry_alone:  # only what every robot and gauge has: no cause is looked for
        families = tuple(f for f in families if f.known or f.certain or f.usual)
    dense = len(run) * whole.width >= DENSE_READINGS * len(last.model.names)
    found = curve_groups(last.model) if dense else frozenset()
    weight = _weight_without_slips(last, stages[-1].stage.weight)
    base = FitProblem.of(whole, run)
    curves, start = _choose_curves(last, run, split, base, families, time, found, weight, limits)
    posterior = draw_posterior(
        last, run, whole, families, time, curves, start=start, weight=weight, limits=limits, base=base
    ).fit()
    give_back_memory()
    weight = posterior.fit.problem.weight
    plain = _count_as_posterior(plain, weight, context)
    regions = predict_regions(last, run, base, families, time, posterior.record.last_factors, curves, weight, limits)
    base.memory.forget({m.phi for p in posterior.fit.model.parameters for m in p.moves})
    judged = None if context.validation is None else predict_validation(posterior, context.validation, time)
    unseen = [*(r.readings for r in regions), *([] if judged is None else [judged])]
    nameless, repeats = posterior.record.count_nameless(), RepeatedReadings.of(posterior.fit, run)
    misfit = draw_misfit(unseen, posterior.drawn.shape[1], nameless, repeats, limits.seed)
    drift, maps = drift_of(cell, run, posterior), tool_maps(cell, run, posterior.fit)
    factors = declared.draw_factors(posterior.drawn.shape[1])
    known, own = (posterior, misfit, drift, factors, *maps), plain.stage
    geometry = ReleasedRobot(plain.fit, plain.fit, *known, own.held_out, own.validation, own.held_residual)
    aim, share = (posterior.fit, 0.0) if geometry_alone else choose_compromise(geometry)
    along = geometry.length_along(aim) if share else 0.0
    share = share_by_regions(share * along, plain.fit, regions) / along if along > 0.0 else share
    if share == 0.0:
        return geometry
    held = _predict_way(posterior, aim, share, own.held_residual, split)
    if held is None:
        return geometry
    give_back_memory()
    fit = interpolate_fit(plain.fit, aim, share)
    errors = (Metrics.of(held, split.fold, weight), context.judge(fit), held)
    released = ReleasedRobot(fit, plain.fit, *known, *errors, share)
    return released if is_noticeably_better(released) else geometry


def _predict_way(posterior: PosteriorFit, aim: Fit, share: float, before: Array, split: Split) -> Array | None:
    """Return residuals (n, r) held out of the robot a share of the way from geometry alone to ``aim``.

    ``before`` are those of geometry alone. ``None``: poses that no fit saw refute what is expected of it.
    """
    problem, sizes = posterior.fit.problem, posterior.mixture.scaled_sizes
    give_back_memory()
    # 16: draws of the sizes that poses held out are predicted by
    held = predict_held_out(posterior.fit, split, sizes[even_positions(len(sizes), 16)]).residual
    held = held + problem.residual(aim.errors) - problem.residual(posterior.fit.errors)
    held = share * held + (1 - share) * before
    square, square_before = (float((problem.weight @ r**2).sum()) for r in (held, before))
    problem.memory.forget()  # a linearisation about all that may act, the largest there is
    return held if square <= square_before else None


def _count_as_posterior(plain: FittedStage, weight: Array, context: FitContext) -> FittedStage:
    """Return the stage of geometry with rows that count as in the posterior, (n,).

    What geometry alone leaves is wide, and a row that stands outside the noise may be hidden in it.
    """
    before = plain.fit.problem
    if np.array_equal(before.weight, weight):
        return plain
    problem = replace(before, weight=weight)
    found = replace(plain.fit, problem=problem, solution=solve(problem, plain.fit.errors))
    errors = {
        "residual": problem.residual(found.errors),
        "held_residual": predict_held_out(found, context.split).residual,
        "validation": context.judge(found),
        "weight": before.weight,
    }
    stage = plain.stage.model_copy(update=errors)
    return replace(plain, fit=found, stage=stage.weigh(weight, context.split.fold))


def _weight_without_slips(last: Fit, weight: Array) -> Array:
    """Return by how much each row counts, (n,), where what is wrong of rows that were found wrong is no parameter."""
    slips = np.array([p.group.startswith(SLIP) for p in last.model.parameters], dtype=bool)
    if not slips.any():
        return weight
    fitted, bare = (last.problem.white_residual(np.where(gone, 0.0, last.errors)) for gone in (False, slips))
    wrong = np.abs(bare - fitted).max(axis=1) > 0
    return np.where(wrong, unseen_weights(bare), weight)


def _choose_curves(
    last: Fit,
    run: Run,
    split: Split,
    base: FitProblem,
    families: Sequence[EffectFamily],
    time: float,
    curves: frozenset[str],
    weight: Array,
    limits: ChainLimits,
) -> tuple[frozenset[str], Mapping[str, float] | None]:
    """Return the curves that stand for harmonics and ripple of their gears, and factors that the draws begin with.

    None do where harmonics and ripple predict as well, which is tried with few draws of each.
    """
    if not curves:
        return curves, None
    starts, held = [], []
    for tried in (frozenset[str](), curves):
        few = draw_posterior(
            last, run, base.model, families, time, tried, sweeps=SWEEPS, weight=weight, limits=limits, base=base
        )
        held.append(few.predict_held_out(split) * np.sqrt(weight)[:, None])
        starts.append(few.record.last_factors)
        del few  # all that may act of one at a time: nothing is as large
        give_back_memory()
    better = predicts_better(held[1], held[0], split)
    return curves if better else frozenset[str](), starts[int(better)]


def predicts_better(other: Array, plain: Array, split: Split) -> bool:
    """Tell whether other residuals (n, r) of samples held out are smaller than plain ones, beyond chance and enough.

    By logarithms of mean squares, group by group: a gain of half the square counts alike where little is left and much.
    """
    size = np.sqrt((plain**2).mean(axis=0))
    mine, theirs = (((h / np.where(size > 0, size, 1.0)) ** 2).mean(axis=1) for h in (other, plain))
    least = 0.1 * min(mine.mean(), theirs.mean())  # of a group with hardly any error a factor on it says nothing
    by_group = (mean_by_group(square, split.group)[np.unique(split.group)] for square in (theirs, mine))
    before, after = (np.log(square + least) for square in by_group)
    gain = before - after
    surely = gain.mean() - CURVE_STANDARD_ERRORS * gain.std() / np.sqrt(len(gain))
    return bool(surely > 0 and mine.mean() < (1 - CURVE_GAIN) * theirs.mean())


def is_noticeably_better(released: ReleasedRobot) -> bool:
    """Tell whether a robot is expected to be better than geometry alone so much that anybody notices.

    Over the workspace, or at poses like those measured: of two robots that are as good the simpler one is written.
    """
    return any(
        released.likely_workspace_error(released.geometry, where)
        > NOTICED * released.likely_workspace_error(released.fit, where)
        for where in (released.tool, released.measured)
    )


def share_by_regions(share: float, plain: Fit, regions: Sequence[HeldOutRegion]) -> float:
    """Return the share, or less where a robot that goes as far predicts regions held out worse than geometry alone.

    The share is of the way to the posterior's mean. Both are predicted without the region, and count as was expected
    of the former. Errors on the way are quadratic in the share, so that it goes no farther than where they are least.
    """
    number = np.full(len(plain.problem), -1)
    for k, region in enumerate(regions):
        number[region.samples] = k
    rest = np.where(number < 0, len(regions), number)
    alone = predict_held_out(plain, Split("region", rest, rest, rest)).residual
    width = min(POSITION_AXES, plain.model.width)
    before = np.concatenate([r.readings.weigh(alone[r.samples, :width]) for r in regions])
    after = [r.readings.residual / np.sqrt(r.readings.open + r.readings.noise) for r in regions]
    way = np.concatenate(after) - before
    length = float((way**2).sum())
    best = 1.0 if length == 0.0 else -float((way * before).sum()) / length
    return share if 2 * best >= share else max(best, 0.0)


def describe_release(released: ReleasedRobot) -> Release:
    """Return the section of the document about the released robot."""
    posterior, work, parts = released.posterior, released.work_tool, error_parts(released)
    warm = posterior.record.run.samples.temperature
    return Release(
        basis="posterior" if released.share else "geometry",
        share=released.share,
        findings=posterior.findings if released.share else (),
        held_out=released.held_out,
        validation=released.validation,
        at_most=released.at_most,
        nominal_anywhere=released.likely_workspace_error(None),
        geometry_anywhere=released.likely_workspace_error(released.geometry),
        other_tool=released.other_tool_anywhere,
        where_measured=released.likely_workspace_error(released.fit, released.measured),
        work_tool=None if work is None else _describe_work_tool(released, work),
        families=posterior.families,
        parts=parts,
        warmth=None if warm is None else (float(warm.min()), float(warm.max())),
        not_shown=unseen_errors(released),
        misfit_place=open_misfit_place(released, parts),
        unexplained=misfit_place(released),
    )


def _describe_work_tool(released: ReleasedRobot, tool: ToolMap) -> WorkToolError:
    x, y, z = map(float, tool.p_FM)
    return WorkToolError(
        position=(x, y, z),
        anywhere=released.likely_workspace_error(released.fit, tool),
        nominal_anywhere=released.likely_workspace_error(None, tool),
    )


def draws_note(released: ReleasedRobot) -> list[str]:
    """Say how far other draws would move what is stated, where that is worth saying."""
    median, limit = (released.scatter_by_draws(at) for at in (0.5, 0.95))
    if max(median, limit) < WORTH_SAYING:
        return []
    return [
        Aside(
            f"the error over the workspace is computed from random draws: with another --seed it would differ by about "
            f"{median:.0%}, its 95 % limit by {limit:.0%}"
        )
    ]


def tool_point_advice(released: ReleasedRobot) -> list[str]:
    """Return the advice to measure a second tool point where the robot's own tool would be off for want of one."""
    tool = released.work_tool
    if tool is None:
        return []
    there, here = released.likely_workspace_error(released.fit, tool), released.anywhere
    if there**2 - here**2 < ANOTHER_TOOL_SHARE * there**2:
        return []
    x, y, z = (f"{float(to_mm(v)):g}" for v in tool.p_FM)
    return [
        f"the robot's own tool ({x}, {y}, {z} mm) is known to {there / MM:.3f} mm, the measured point to "
        f"{here / MM:.3f} mm: most of that is what one tool point cannot tell from where its own ball sits on the "
        "flange. A second point in the same session tells it ([[tool.points]]): 100 mm or more from the first, and "
        "not on one line with it and the flange's axis"
    ]
