"""``identify()``: from a run to a calibrated robot, stage by stage."""

from dataclasses import dataclass

from planner.cell.cell import Cell
from planner.common.determinism import on_one_thread
from planner.common.errors import InputError
from planner.common.progress import StageReport
from planner.common.summary import Aside
from planner.common.system import give_back_memory, keep_freed_memory
from planner.design.assumptions import TRACEABLE_READINGS
from planner.documents.calibration import Calibration
from planner.effects.compliance import JOINT_COMPLIANCE
from planner.fit.artifact_pose import use_declared_pose
from planner.fit.assumptions import TOO_FEW_READINGS
from planner.fit.better_explanations import explain_failure
from planner.fit.cross_validation import split_run, validate_fit
from planner.fit.identifiable_parameters import choose_parameters, parameters_of_groups
from planner.fit.least_squares import Fit
from planner.fit.run_setup import add_motion, check_pull, locate_gauge, number_samples, setup_for_run, spread_rows
from planner.identification.assessment import approach_warnings, assess_fit, too_few_text
from planner.inference.candidates import TracingResult
from planner.inference.posterior_draws import ChainLimits
from planner.inference.stages import FitContext, Tracer, add_declared_stages, add_stage_if_gain
from planner.model.identification_document import Metrics, ReleaseBasis
from planner.model.model import Model
from planner.runs.run import Run


@dataclass(frozen=True)
class FitSettings:
    """What the user may choose: share of the groups held out, seed of the folds and of the draws.

    The released robot holds geometry and effects by the posterior, with ``geometry`` geometry alone, and the posterior
    then knows no effects but those of the stages and those that always act. Where ``release`` is false it is the last
    stage as fitted, and the error over the workspace follows from its covariance: quicker, for trials of many runs.
    At most ``most_causes`` causes with a name act together, beside those that the cell declares; none: any number.
    """

    hold_out: float = 0.2
    seed: int = 0
    geometry: bool = False
    release: bool = True
    most_causes: int | None = None

    @property
    def basis(self) -> ReleaseBasis:
        """What the released robot is made of."""
        return "fit" if not self.release else "geometry" if self.geometry else "posterior"


@on_one_thread
def identify(
    run: Run,
    cell: Cell,
    validation: Run | None = None,
    settings: FitSettings | None = None,
    say: StageReport = lambda _: None,
    tracer: Tracer | None = None,
) -> Calibration:
    """Identify the robot of a run; with a ``tracer`` what the geometry leaves is traced to its causes.

    Raises:
        InputError: run and cell do not belong together, or the run is too small.
        NoSolutionError: the fit does not come to rest.
    """
    keep_freed_memory()
    give_back_memory()  # the text of a long run, which was read just now
    settings = settings or FitSettings()
    approaches = run.samples.direction is not None
    width, measured = cell.gauge.width, len(run)
    run = spread_rows(number_samples(run), width)
    validation = None if validation is None else spread_rows(add_motion(validation), width)
    say("placing the gauge")
    with explain_failure(cell, run):
        setup = use_declared_pose(cell, locate_gauge(setup_for_run(cell, run), run))
    check_pull(cell, setup, run)
    bare = None if validation is None else setup_for_run(cell, validation)
    parts = split_run(run, settings.hold_out, settings.seed)
    limits = ChainLimits(settings.seed, settings.most_causes, tuple(cell.plan.effects))

    def judge(found: Fit) -> Metrics | None:
        """Return the stage with what validation poses say of it."""
        return None if validation is None or bare is None else validate_fit(found, validation, bare)

    free = choose_parameters(cell, setup, run)
    context = FitContext(run, parts, judge, free.unseen_parameters, validation, limits=limits)
    _check_size(context, free.model)
    model = free.model_up_to(())
    with explain_failure(cell, run):
        say("nominal robot")
        stages = [context.fit_stage("nominal", model.subset([]))]
        say("frames")
        stages.append(context.fit_stage("frames", parameters_of_groups(model, ("gauge",))))
        say("geometry")
        stages.append(context.fit_stage("geometry", model, stages[-1].fit))
    stages, notes = add_declared_stages(stages, free, cell.plan.effects, context, say)
    notes += spread_note(len(run), measured)
    traced = TracingResult()
    if tracer is not None and context.redundancy(free.model) >= TRACEABLE_READINGS:
        more, traced = tracer(stages[-1], context, say)
        stages += more
        notes += [] if approaches else approach_warnings(traced)
    else:
        notes += [] if tracer is None else [too_few_text(context.redundancy(free.model))]
        if JOINT_COMPLIANCE not in cell.plan.effects and (setup.weighs or run.samples.force is not None):
            say(JOINT_COMPLIANCE)
            wider = choose_parameters(cell, setup, run, (JOINT_COMPLIANCE,))
            stages, free = add_stage_if_gain(stages, free, wider, JOINT_COMPLIANCE, context)
    say("calibrated robot")
    give_back_memory()
    return assess_fit(stages, free, context, cell, validation, traced, notes, settings.basis)


def spread_note(used: int, measured: int) -> list[str]:
    """Say of how many rows of a long run the fit is."""
    if used == measured:
        return []
    return [Aside(f"the fit is of {used} of {measured} rows, evenly over the run: neighbours in time err alike")]


def _check_size(context: FitContext, model: Model) -> None:
    run = context.run
    if context.redundancy(model) < TOO_FEW_READINGS:
        raise InputError(
            f"{run.name}: {len(run)} samples give {len(run) * model.width} readings, too few for"
            f" {len(model.parameters)} parameters; measure at least {len(model.parameters) + TOO_FEW_READINGS}, better"
            f" twice that, or free fewer in [plan]{''.join(f'; {w}' for w in run.warnings)}"
        )
