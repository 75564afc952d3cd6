"""``identify()``: from a run to a calibrated robot, stage by stage."""

from dataclasses import dataclass

from planner.cell import Cell
from planner.errors import InputError
from planner.freed import COMPLIANCE
from planner.identification.added import SPARE, with_declared, with_gain
from planner.identification.bench import Bench, Say, Tracer
from planner.identification.checks import TRACEABLE, too_few
from planner.identification.finishing import finished
from planner.identification.fit import Fit
from planner.identification.freeing import freed
from planner.identification.placed import check_pull, placed, rig_for, with_motion
from planner.identification.splits import split
from planner.identification.stages import frames_only, nominal
from planner.identification.standing import as_declared
from planner.identification.types import Calibration, Metrics
from planner.identification.validation import judged
from planner.model import Model
from planner.repeatable import single_threaded
from planner.run import Run


@dataclass(frozen=True)
class Settings:
    """What the user may choose: share of the groups held out, robust loss, seed of the folds."""

    hold_out: float = 0.2
    robust: bool = False
    seed: int = 0


@single_threaded
def identify(
    run: Run,
    cell: Cell,
    validation: Run | None = None,
    settings: Settings | None = None,
    say: Say = lambda _: None,
    tracer: Tracer | None = None,
) -> Calibration:
    """Identify the robot of a run; with a ``tracer`` what the geometry leaves is traced to its causes.

    Raises:
        InputError: run and cell do not belong together, or the run is too small.
        NoSolutionError: the fit does not come to rest.
    """
    settings = settings or Settings()
    run = with_motion(run)
    validation = None if validation is None else with_motion(validation)
    say("placing the gauge")
    rig = as_declared(cell, placed(rig_for(cell, run), run))
    check_pull(cell, rig, run)
    bare = None if validation is None else rig_for(cell, validation)
    parts = split(run, settings.hold_out, settings.seed)

    def judge(found: Fit) -> Metrics | None:
        return None if validation is None or bare is None else judged(found, validation, bare)

    bench = Bench(run, parts, judge, settings.robust)
    free = freed(cell, rig, run)
    _check_size(bench, free.model)
    model = free.upto(())
    say("nominal robot")
    stages = [nominal(model, run, parts, judge)]
    say("frames")
    stages.append(bench.fitted("frames", frames_only(model)))
    say("geometry")
    stages.append(bench.fitted("geometry", model, stages[-1].fit))
    stages, notes = with_declared(stages, free, cell.plan.effects, bench, say)
    if tracer is not None and bench.spare(free.model) >= TRACEABLE:
        more, traced = tracer(stages[-1], bench, say)
        return finished([*stages, *more], free, bench, cell, validation, traced, notes)
    if tracer is not None:
        notes.append(too_few(bench.spare(free.model)))
    if COMPLIANCE not in cell.plan.effects and (rig.weighs or run.samples.force is not None):
        say(COMPLIANCE)
        stages, free = with_gain(stages, free, freed(cell, rig, run, (COMPLIANCE,)), COMPLIANCE, bench)
    return finished(stages, free, bench, cell, validation, None, notes)


def _check_size(bench: Bench, model: Model) -> None:
    run = bench.run
    if bench.spare(model) < SPARE:
        raise InputError(
            f"{run.name}: {len(run)} samples give {len(run) * model.width} readings, too few for "
            f"{len(model.parameters)} parameters; measure at least {len(model.parameters) + SPARE}, better twice that, "
            "or free fewer in [plan]"
        )
