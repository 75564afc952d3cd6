"""The expected error against minutes or poses, and which poses were worth most."""

import numpy as np

from planner.common.units import to_mm
from planner.release.error_history import ErrorHistory, error_history
from planner.report.calibration_data import CalibrationFacts
from planner.report.chart import BLUE, GREY, ORANGE, Chart, Panel, Series
from planner.report.formatting import digits


def history_charts(facts: CalibrationFacts) -> tuple[Chart, ...]:
    """Return the chart of a run of poses at rest; none of a run on the way, or where no robot was released."""
    c = facts.calibration
    if c.released is None or c.run.continuous:
        return ()
    found = error_history(c.released, c.run.samples)
    return () if found is None else (_chart(facts, found),)


def _chart(facts: CalibrationFacts, found: ErrorHistory) -> Chart:
    c = facts.calibration
    n = len(found.error)
    counted = found.minutes is None
    x = np.arange(1.0, n + 1.0) if found.minutes is None else found.minutes
    label = "poses" if counted else "minutes"
    error = to_mm(found.error)
    reached = Series("reached", x, error, BLUE)
    lines = [reached]
    session = c.run.samples.session_numbers
    for k, planned in enumerate(c.planned_errors):
        own = np.flatnonzero(session == k)[: len(planned)]
        if len(own):
            name = "planned" if k == 0 else f"planned, run {k + 1}"
            lines.append(Series(name, x[own], to_mm(np.array(planned[: len(own)])), GREY, dashed=True))
    drawn = np.concatenate([s.y for s in lines])
    span = (0.7 * float(drawn.min()), 1.3 * float(drawn.max()))
    curve = Panel("", label, "expected error (mm, logarithmic)", tuple(lines), log_y=True, y_range=span)
    # 5: poses that are named as worth most
    share, best = 100 * found.worth, np.argsort(-found.worth)[:5]
    names = tuple(_pose_name(facts, k) for k in range(n))
    worth = Series("a pose", x, share, BLUE, "points", hover=names, size=5.0, opacity=0.6)
    most = Series("worth most", x[best], share[best], ORANGE, "points", hover=tuple(names[k] for k in best))
    points = Panel("", label, "more error without it (%)", (worth, most), y_range=(0.0, 1.15 * float(share.max())))
    said = ", ".join(names[k] for k in sorted(best.tolist()))
    caption = (
        "The expected error over the workspace after each reading, with the sizes of all errors from the whole run. "
        f"It ends at the stated {digits(float(error[-1]))} mm. Below it, by how much the "
        f"mean square error would be larger without each pose. Worth most: {said}."
    )
    return Chart("history", "What the poses were worth", caption, (curve, points))


def _pose_name(facts: CalibrationFacts, k: int) -> str:
    samples = facts.calibration.run.samples
    number = k + 1 if samples.pose is None else int(samples.pose[k])
    place = facts.calibration.run.places[samples.place[k]]
    return f"pose {number}" + (f" at {place}" if len(facts.calibration.run.places) > 1 else "")
