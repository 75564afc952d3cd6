"""What is in a measured run, before it is used."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from pydantic import Field

from planner import load_run
from planner.cell.cell import Cell
from planner.common.units import Array, to_deg, to_mm
from planner.runs.run import Run
from planner.service.job_requests import ServiceModel

SERIES = 600  # samples shown


class RunSeries(ServiceModel):
    """One quantity of a run, thinned."""

    name: str
    unit: str
    values: list[float | None]


class RunCheck(ServiceModel):
    """What a run holds."""

    samples: int
    sessions: int
    kind: str
    plan_id: str | None
    robot: str | None
    duration_s: float | None
    at: list[float] = Field(description="time [s], or number of the sample where there is no clock")
    series: list[RunSeries]
    warnings: list[str]


def check_run(paths: Sequence[Path], cell: Cell) -> RunCheck:
    """Return what is in measured runs of the robot of ``cell``."""
    runs = [load_run(p, cell.robot.n_joints) for p in paths]
    first, samples = runs[0], sum(len(r) for r in runs)
    s = first.samples
    shown = np.unique(np.linspace(0, len(first) - 1, min(SERIES, len(first))).astype(int))
    at = s.t[shown] if s.t is not None else shown.astype(float)
    return RunCheck(
        samples=samples,
        sessions=sum(1 if r.samples.session is None else len(np.unique(r.samples.session)) for r in runs),
        kind="continuous" if first.continuous else "poses at rest",
        plan_id=first.plan_id,
        robot=first.robot,
        duration_s=None if s.t is None else float(s.t.max() - s.t.min()),
        at=[float(v) for v in at],
        series=_series(first, shown),
        warnings=[w for r in runs for w in r.warnings],
    )


def _series(run: Run, shown: Array) -> list[RunSeries]:
    s, r = run.samples, run.readings
    columns = [(f"axis {k + 1}", "deg", to_deg(s.q[:, k])) for k in range(s.q.shape[1])]
    if r.length is not None:
        columns.insert(0, ("length", "mm", to_mm(r.length)))
    if r.position is not None:
        columns = [(x, "mm", to_mm(r.position[:, k])) for k, x in enumerate("xyz")] + columns
    if s.temperature is not None:
        columns.append(("temperature", "°C", s.temperature))
    return [
        RunSeries(name=n, unit=u, values=[float(x) if np.isfinite(x) else None for x in v[shown]])
        for n, u, v in columns
    ]
