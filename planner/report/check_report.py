"""Reports of a robot over the years: a check, with what explains it best, and the robot's record."""

from typing import Literal

import numpy as np

from planner.checks.evaluation import CheckVerdict
from planner.checks.record import RobotRecord
from planner.checks.results import verdict_overview
from planner.common.units import UM, to_mm
from planner.model.finding import percent
from planner.report.chart import (
    BLUE,
    GREEN,
    GREY,
    JOINTS,
    ORANGE,
    RED,
    Chart,
    Panel,
    ReferenceLine,
    Series,
    list_panel,
    zero_line,
)
from planner.report.formatting import chance_text
from planner.report.page import Report, Row, report_judged_run


def check_chart(verdict: CheckVerdict) -> Chart:
    """Draw readings less expectation within two standard deviations, and the probability of every change."""
    x = np.arange(len(verdict.poses), dtype=float)
    wide = 2 * verdict.std[:, :3].max(axis=1) / UM
    bands = tuple(Series(n, x, s * wide, GREY, dashed=True) for n, s in (("expected, 2σ", 1), ("", -1)))
    axes = verdict.difference[:, :3].T / UM
    names = ["read less expected"] if len(axes) == 1 else [f"read less expected, {a}" for a in "xyz"]
    points = (Series(n, x, v, c, "points") for n, v, c in zip(names, axes, (BLUE, ORANGE, GREEN), strict=False))
    readings = Panel("", "reading", "µm", (*bands, zero_line(x), *points))
    each = sorted(verdict.judged, key=lambda j: j.test.p_value)
    surprise = np.array([-np.log10(max(j.test.p_value, 1e-300)) for j in each])
    texts = tuple(chance_text(j.test.p_value) for j in each)
    bars = Series("", surprise, np.arange(len(each), dtype=float), ORANGE, "bars", texts=texts)
    alarm = float(-np.log10(verdict.threshold))
    changes = [j.change.name for j in each]
    tests = list_panel(
        "", "−log₁₀ of the probability that chance alone looks so much like it", changes, [bars],
        limits=(ReferenceLine(alarm, "alarm", upright=True),), x_range=(0.0, 1.3 * max(alarm, float(surprise.max()))),
    )  # fmt: skip
    caption = "Above: readings against the calibrated robot. Below: what each possible change would explain of them."
    return Chart("check", "What has changed", caption, (readings, tests))


def report_check(robot: str, verdict: CheckVerdict) -> Report:
    """Return the page of a check and its picture."""
    shown = verdict_overview(verdict)
    said = [shown.title, *(f"{key}: {text}" for key, text in shown.facts)]
    rows: list[Row] = []
    for j in verdict.judged:
        sizes = (f"{to_mm(size):.3f}" for size in (j.motion, j.motion_std, j.detectable))
        told = (percent(j.probability), chance_text(j.test.p_value))
        rows.append((j.change.name, *told, *sizes, j.change.advice))
    what = "Every possible change, the likeliest first (motion of the tool in mm, rms over the workspace)"
    head = ("change", "probability", "by chance", "motion", "σ", "would be found from", "what to do")
    title, chart = f"Check of {robot}", check_chart(verdict)
    return report_judged_run(title, verdict.run, said, verdict.notes, (what, head, rows), chart, numbers=5)


MARKS: tuple[Literal["line", "points"], ...] = ("line", "points")


def drift_chart(record: RobotRecord) -> Chart | None:
    """Draw each axis' zero by every check as motion of the tool, and how sure it is that anything has changed."""
    checks = record.checks
    if not checks:
        return None
    first = record.valid_entries[0].file.circumstances.date
    days = np.array([float((when - first).days) for when, _ in checks])
    series = tuple(
        Series(d.name if mark == "line" else "", days, np.array(d.motions)[:, 0], JOINTS[k % len(JOINTS)], mark)
        for k, d in enumerate(record.drifts)
        for mark in MARKS
    )
    sure = np.array([c.decades for _, c in checks])
    beyond, alarm = Series("", days, sure, RED, "points"), ReferenceLine(0.0, "alarm")
    label = "days since the first entry"
    panels = (
        Panel("", label, "motion of the tool (mm)", series),
        Panel("", label, "powers of ten beyond chance", (beyond,), (alarm,)),
    )
    caption = (
        "By the checks, against the calibration before. Above: the zero of each axis, as if it alone had moved. Below: "
        "over the line something has changed."
    )
    return Chart("drift", "Drift since the first entry", caption, panels)


def record_rows(record: RobotRecord) -> list[Row]:
    """Return one row an entry, as the page and the table show it."""
    moved: dict[int, list[str]] = {}
    for number, text in record.differences():
        moved.setdefault(number, []).append(text)
    rows: list[Row] = []
    for e in record.entries:
        c = e.file.circumstances
        temperature = "" if c.temperature_degC is None else f"{c.temperature_degC:g}"
        what = "; ".join([e.sentence, *moved.get(e.number, [])])
        gauge = " ".join(filter(None, (c.gauge, c.certificate and f"({c.certificate})")))
        rows.append((str(e.number), c.date.isoformat(), e.file.kind, what, c.operator, temperature, c.tool, gauge))
    return rows


HEAD = ("entry", "date", "kind", "result", "operator", "temperature_degC", "tool", "gauge")
SHOWN_HEAD = (*HEAD[:5], "temperature (°C)", *HEAD[6:])


def report_record(record: RobotRecord) -> Report:
    """Return the page of a record and its picture."""
    chart, file = drift_chart(record), record.file
    due = f"next check due {record.due_text}" if record.due_text else "no entry that counts"
    page = {
        "title": f"Robot {file.serial}",
        "model": file.robot,
        "due": due,
        "head": SHOWN_HEAD,
        "rows": record_rows(record),
    }
    gauges = [e.file.circumstances.gauge for e in record.valid_entries if e.file.circumstances.gauge]
    identity = (f"robot {file.robot}, serial number {file.serial}", *gauges[-1:])
    charts = () if chart is None else (chart,)
    return Report("record.html.j2", page, charts, identity=identity, simulated=record.simulated)
