"""The command ``edbb demo``."""

import os
import sys
import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from planner.cli.terminal import PLAINLY, Json, Manner, OptionalOutput, give

DEMO_STARTS = {
    "candidates": 0.0, "roadmap": 0.05, "foresight": 0.1, "selection": 0.15, "path": 0.2, "programs": 0.3,
    "simulation": 0.32, "reading": 0.34, "geometry": 0.36, "rivals": 0.6, "calibrated robot": 0.7, "report": 0.9,
}  # fmt: skip
"""Shares of the time at which each stage begins, about."""


FOLDER = Path("demo")  # where it is written, if no folder is named


def has_display() -> bool:
    """Tell whether a browser can show a page here."""
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def demo_command(
    cell: Annotated[str, typer.Argument(metavar="[CELL]", help="name or file of a cell")] = "comau-nj130/edbb",
    output: OptionalOutput = None,
    poses: Annotated[int | None, typer.Option(min=12, help="number of poses (default: as many as are needed)")] = None,
    seed: Annotated[int, typer.Option(min=0, help="of the robot's errors and of its fault")] = 0,
    no_open: Annotated[bool, typer.Option("--no-open", help="do not show the page in a browser")] = False,
    as_json: Json = False,
    manner: Manner = PLAINLY,
) -> None:
    """Try the whole chain without a robot: plan, simulated run of a robot with a hidden fault, calibration."""
    from planner.workflow.demo import CALIBRATED, demo  # numbers and planning: the help is quicker without

    folder = FOLDER if output is None else output
    give(lambda stages: demo(cell, poses, seed, stages.say), folder, as_json, DEMO_STARTS, manner)
    page = folder / CALIBRATED / "report.html"
    if not no_open and has_display() and page.is_file():
        webbrowser.open(page.resolve().as_uri())
