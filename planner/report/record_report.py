"""The report of a robot's record: its history, and how its axes have drifted by the checks."""

from typing import Literal

import numpy as np

from planner.instruments.record import RobotRecord
from planner.report.chart import JOINTS, RED, Chart, Panel, ReferenceLine, Series
from planner.report.page import Report, Row

MARKS: tuple[Literal["line", "points"], ...] = ("line", "points")


def drift_chart(record: RobotRecord) -> Chart | None:
    """Draw each axis' zero by every check as motion of the tool, and how sure it is that anything has changed."""
    checks = record.checks
    if not checks:
        return None
    first = record.entries[0].file.circumstances.date
    days = np.array([float((when - first).days) for when, _ in checks])
    series = tuple(
        Series(d.name if mark == "line" else "", days, np.array(d.motions)[:, 0], JOINTS[k % len(JOINTS)], mark)
        for k, d in enumerate(record.drifts)
        for mark in MARKS
    )
    sure = np.array([c.decades for _, c in checks])
    alarm = Series("", days, sure, RED, "points")
    panels = (
        Panel("", "days since the first entry", "motion of the tool (mm)", series),
        Panel(
            "", "days since the first entry", "powers of ten beyond chance", (alarm,), (ReferenceLine(0.0, "alarm"),)
        ),
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


def report_record(record: RobotRecord) -> Report:
    """Return the page of a record and its picture."""
    chart = drift_chart(record)
    due = f"next check due {record.due_text}" if record.due_text else "no entry yet"
    page: dict[str, object] = {
        "title": f"Robot {record.file.serial}",
        "model": record.file.robot,
        "due": due,
        "head": HEAD,
        "rows": record_rows(record),
    }
    gauges = [e.file.circumstances.gauge for e in record.entries if e.file.circumstances.gauge]
    identity = (f"robot {record.file.robot}, serial number {record.file.serial}", *gauges[-1:])
    charts = () if chart is None else (chart,)
    return Report("record.html.j2", page, charts, identity=identity, simulated=record.simulated)
