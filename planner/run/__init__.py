"""A measured run: load, check, synchronise, save."""

from planner.run.importing import import_run
from planner.run.joining import joined, load_runs
from planner.run.loading import load_run
from planner.run.motion import REST_SPEED, REST_TIME, speeds, stretches_at_rest
from planner.run.resting import rest
from planner.run.reversals import reversals
from planner.run.saving import run_text, save_run
from planner.run.types import Readings, Run, Samples

__all__ = [
    "REST_SPEED",
    "REST_TIME",
    "Readings",
    "Run",
    "Samples",
    "import_run",
    "joined",
    "load_run",
    "load_runs",
    "rest",
    "reversals",
    "run_text",
    "save_run",
    "speeds",
    "stretches_at_rest",
]
