"""Writes a planned circular test into its folder: all of it, or nothing."""

from functools import partial
from pathlib import Path

import numpy as np
import polars as pl

from planner.circular import CircularPlan, circular_text
from planner.files import write_text
from planner.trajectory import table, table_csv
from planner.workflow.planning import Stages
from planner.workflow.writing import SAMPLE, drafted, timed, write_driven


def write_circular_plan(plan: CircularPlan, folder: Path, stages: Stages) -> list[Path]:
    """Write ``plan.json``, programs, ``trajectory.csv``, ``cell.toml``, ``report.html``, pictures, ``timings.json``.

    Everything is written beside the folder first, then moved in: a failure leaves the folder as it was.
    """
    from planner.report.circular import write_plan_report  # matplotlib: other commands start quicker without

    with drafted(folder) as draft:
        with stages.stage("report"):
            write_driven(plan.cell, plan.programs, circular_trajectory_csv(plan), draft)
            write_plan_report(plan, draft)
            write_text(draft / "plan.json", circular_text(plan))
        return timed(stages, draft, folder)


def circular_trajectory_csv(plan: CircularPlan) -> str:
    """All passes one after the other, as they are driven with the bar on: t_s, q1_deg …, length_mm."""
    frames, start = [], 0.0
    for drive in plan.drives:
        length = partial(plan.cell.bar_length, fixture=drive.fixture)
        for one in drive.passes:
            frame = table(one.trajectory, SAMPLE, length)
            frames.append(frame.with_columns(pl.col("t_s") + np.round(start, 6)))
            start += one.trajectory.duration_s + SAMPLE
    return table_csv(pl.concat(frames))
