"""The report of a check: readings against what is expected, and how well each possible change explains them."""

import numpy as np

from planner.common.units import UM, to_mm
from planner.instruments.check.evaluation import CheckVerdict
from planner.instruments.check.results import verdict_lines
from planner.report.chart import BLUE, GREEN, GREY, ORANGE, Chart, Panel, ReferenceLine, Series, list_panel, zero_line
from planner.report.formatting import chance_text
from planner.report.page import Report, Row


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
    said = [line.strip() for line in verdict_lines(verdict) if not line.startswith("  note")]
    rows: list[Row] = [
        (
            j.change.name, chance_text(j.test.p_value), f"{to_mm(j.motion):.3f}", f"{to_mm(j.motion_std):.3f}",
            f"{to_mm(j.detectable):.3f}", j.change.advice,
        )
        for j in verdict.judged
    ]  # fmt: skip
    page: dict[str, object] = {
        "title": f"Check of {robot}",
        "run": verdict.run,
        "sentences": said,
        "notes": verdict.notes,
        "table": "Every possible change, the best explanation first (motion of the tool in mm, rms over the workspace)",
        "head": ("change", "by chance", "motion", "σ", "would be found from", "what to do"),
        "rows": rows,
    }
    return Report("check.html.j2", page, (check_chart(verdict),))
