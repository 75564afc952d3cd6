"""From the stages of a fit to the robot that is released."""

from collections.abc import Sequence

from planner.cell.cell import Cell
from planner.identification.cross_validation import predict_held_out
from planner.identification.posterior_background import background_families
from planner.identification.posterior_fit import fit_posterior
from planner.identification.released_robot import ReleasedRobot, ToolMap, tool_maps
from planner.identification.stages import FitContext, FittedStage
from planner.model.identification_document import Metrics, Release, SizeOfFamily, WorkToolError
from planner.model.model import Model


def release_robot(
    stages: Sequence[FittedStage], whole: Model, context: FitContext, cell: Cell, time: float, geometry_alone: bool
) -> ReleasedRobot:
    """Fit the posterior and return the robot to be written.

    Args:
        stages: of the fit; the last one's findings enter the posterior where they pay.
        whole: gauge and geometry, identifiable or not.
        context: run and split.
        cell: the cell.
        time: how many samples are worth one.
        geometry_alone: release the geometry as fitted alone.

    Raises:
        NoSolutionError: the posterior does not come to rest.
    """
    last, run, split = stages[-1].fit, context.run, context.split
    few = context.part(last.model)
    if few is not None:
        run, split, time = run.take(few), split.take(few), max(1.0, time * len(few) / len(run))
    families = background_families(last.model.setup, context.run.samples)
    posterior = fit_posterior(last, run, whole, families, time)
    maps, plain = tool_maps(cell, context.run, posterior.fit), geometry_stage(stages)
    if geometry_alone:
        own = plain.stage
        errors = (own.held_out, own.validation, own.held_residual)
        return ReleasedRobot(plain.fit, plain.fit, posterior, *maps, *errors)
    held = predict_held_out(posterior.fit, split, posterior.mixture.scaled).residual
    errors = (Metrics.of(held, split.fold), context.judge(posterior.fit), held)
    return ReleasedRobot(posterior.fit, plain.fit, posterior, *maps, *errors)


def geometry_stage(stages: Sequence[FittedStage]) -> FittedStage:
    """Return the stage of geometry alone."""
    return next(s for s in stages if s.stage.name == "geometry")


def describe_release(released: ReleasedRobot) -> Release:
    """Return what the document says of the released robot."""
    posterior, work = released.posterior, released.work_tool
    return Release(
        basis="posterior" if released.fit is posterior.fit else "geometry",
        findings=posterior.findings,
        held_out=released.held_out,
        validation=released.validation,
        nominal_anywhere=released.anywhere_with(None),
        geometry_anywhere=released.anywhere_with(released.geometry),
        other_tool=released.other_tool_anywhere,
        work_tool=None if work is None else _describe_work_tool(released, work),
        families=tuple(
            SizeOfFamily(name=f.name, factor=f.factor, probability=f.probability) for f in posterior.families
        ),
    )


def _describe_work_tool(released: ReleasedRobot, tool: ToolMap) -> WorkToolError:
    x, y, z = map(float, tool.p_FM)
    return WorkToolError(
        position=(x, y, z),
        anywhere=released.anywhere_with(released.fit, tool),
        nominal_anywhere=released.anywhere_with(None, tool),
    )
