"""Computes the numbers of the rows, group by group: some take seconds, the others minutes."""

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

from planner.common.progress import Stages
from planner.reproduction.rows import Numbers, stored_numbers

QUICK = {
    "model": "planner.reproduction.edbb_model:model_numbers",
    "kuka": "planner.reproduction.trical:table_numbers",
}  # seconds each
LONG = {
    "plan": "planner.reproduction.edbb_plan:plan_numbers",
    "loaded": "planner.reproduction.loaded_bar:loaded_numbers",
    "accuracy": "planner.reproduction.trical:accuracy_numbers",
    "methods": "planner.reproduction.methods:method_numbers",
}  # minutes each


def compute_group(name: str) -> Mapping[str, Any]:
    """Compute one group of numbers, rounded as it is kept."""
    module, _, function = {**QUICK, **LONG}[name].partition(":")
    make: Callable[[], Mapping[str, Any]] = getattr(import_module(module), function)
    return {key: _round(value) for key, value in make().items()}


def compute_numbers(stages: Stages, quick: bool) -> Numbers:
    """Compute every group, or with ``quick`` those that take seconds; the others are as they were stored."""
    groups = QUICK if quick else {**QUICK, **LONG}
    out = dict(stored_numbers())
    for name in groups:
        with stages.stage(name):
            out[name] = compute_group(name)
    return out


def _round(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.6g}")  # digits that are kept
    if isinstance(value, list | tuple):
        return [_round(v) for v in value]
    return {k: _round(v) for k, v in value.items()} if isinstance(value, dict) else value
