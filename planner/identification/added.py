"""Stages beyond the geometry that are asked for by name: the cell's own model, and compliance where it gains."""

from planner.identification.bench import Bench, Say
from planner.identification.freeing import Freed
from planner.identification.stages import Fitted, gains
from planner.units import MM

SPARE = 5  # readings beyond the parameters, below which nothing is fitted


def with_declared(
    stages: list[Fitted], free: Freed, effects: tuple[str, ...], bench: Bench, say: Say
) -> tuple[list[Fitted], list[str]]:
    """Add a stage for each effect that the cell declares; return what a person should know beside them.

    They are the user's model: they stay whatever held-out samples say, as the plan chose its poses for them.
    """
    stages, notes = list(stages), list[str]()
    kinds = list(dict.fromkeys(effects))
    for k, kind in enumerate(kinds):
        model = free.upto(kinds[: k + 1])
        if len(model.parameters) == len(stages[-1].fit.errors):
            notes.append(f"{kind} is declared in plan.effects, but this run shows nothing of it: it was left out")
            continue
        say(kind)
        stages.append(bench.fitted(kind, model, stages[-1].fit))
        before, after = (s.stage.held_out.rms for s in stages[-2:])
        if after > before:
            notes.append(
                f"{kind} is declared in plan.effects and was fitted, but held-out samples came out worse with it, "
                f"{after / MM:.4f} mm against {before / MM:.4f} mm without: this run says too little of it"
            )
    return stages, notes


def with_gain(stages: list[Fitted], free: Freed, wider: Freed, kind: str, bench: Bench) -> tuple[list[Fitted], Freed]:
    """Add an effect that nobody declared and keep it only if held-out samples gain."""
    if len(wider.model.parameters) == len(stages[-1].fit.errors) or bench.spare(wider.model) < SPARE:
        return stages, free
    trial = bench.fitted(kind, wider.model, stages[-1].fit)
    return ([*stages, trial], wider) if gains(stages[-1].stage, trial.stage, bench.split) else (stages, free)
