"""The report of a validation by a tracker, or of repeated centrings."""

import numpy as np

from planner.accuracy.assumptions import FRAMES
from planner.accuracy.precision import RepeatedCentrings
from planner.accuracy.validation import ErrorFigures, ModelErrors, Validation
from planner.common.numbers import number_of
from planner.common.units import UM, to_mm
from planner.report.chart import BLUE, ORANGE, Chart, Panel, ReferenceLine, Series, histogram_outline, list_panel
from planner.report.formatting import in_um
from planner.report.page import Report, Row, report_judged_run


def error_histogram(found: Validation) -> Chart:
    """Errors before and after calibration, each on an axis of its own."""
    both = (("by the data sheet", ORANGE, found.before), ("calibrated", BLUE, found.after))
    caption = (
        "Distance between where the tracker saw the reflector and where the robot's model has it, one a pose; dotted: "
        "mean and largest. The tracker's frame comes from the nests, never from these poses."
    )
    panels = tuple(_panel(name, colour, judged) for name, colour, judged in both if judged is not None)
    return Chart("accuracy", f"Position errors at {number_of(len(found.run), 'pose')}", caption, panels)


def _panel(name: str, colour: str, judged: ModelErrors) -> Panel:
    bins = 25  # of the histogram
    size = to_mm(np.linalg.norm(judged.error, axis=1))
    edges = np.linspace(0.0, float(size.max()), bins + 1)
    counts = np.histogram(size, edges)[0].astype(float)
    mean, largest = float(to_mm(judged.figures.mean)), float(to_mm(judged.figures.largest))
    bars = (Series(name, *histogram_outline(edges, counts), colour, filled=True),)
    lines = tuple(ReferenceLine(v, f"{what} {v:.3f}", upright=True) for what, v in (("mean", mean), ("max", largest)))
    # 1.25: of the highest bar, for what is written beside the lines
    x_range, y_range = (0.0, 1.12 * largest), (0.0, 1.25 * float(counts.max()))
    return Panel(name, "position error (mm)", "poses", bars, lines, x_range=x_range, y_range=y_range, height=240)


def centring_chart(found: RepeatedCentrings) -> Chart:
    """How far every repeated centring is from the mean of its pose, one row a pose."""
    poses = list(dict.fromkeys(int(p) for p in found.pose))
    size = np.linalg.norm(found.off, axis=1) / UM
    place = np.array([poses.index(int(p)) for p in found.pose], dtype=float)
    ball = dict(zip(found.pose.tolist(), found.ball, strict=True))
    hover = tuple(f"pose {p}: {v:.1f} µm" for p, v in zip(found.pose, size, strict=True))
    names = [f"pose {p}, ball {ball[p]}" for p in poses]
    points = Series("", size, place, BLUE, "points", hover=hover)
    limit = ReferenceLine(
        FRAMES.centring_tolerance / UM,
        f"centred to {FRAMES.centring_tolerance / UM:g} µm by the indicators",
        upright=True,
    )
    reach = (0.0, 1.15 * max(float(size.max()), 2 * FRAMES.centring_tolerance / UM))
    label = "distance from the mean of the pose (µm)"
    panel = list_panel("", label, names, [points], rest=40, limits=(limit,), x_range=reach)
    caption = (
        "Each centring from the mean of all of its pose. The arm's own repeatability, which its joint angles do not "
        "show, is part of it: the indicators alone agree much more closely."
    )
    return Chart("accuracy", "Repeated centrings", caption, (panel,))


def report_accuracy(title: str, found: Validation | RepeatedCentrings) -> Report:
    """Return the page of a tracker's run or of repeated centrings, and its picture."""
    if isinstance(found, Validation):
        before, after = found.before.figures, found.after
        head = ("robot", "poses", "mean", "maximum", "std", *(f"{p} % within" for p, _ in before.percentiles))
        rows = [_figures("by the data sheet", before)] + ([] if not after else [_figures("calibrated", after.figures)])
        table = ("Position errors, in mm", head, rows)
        said, chart = _validation_sentences(found), error_histogram(found)
        return report_judged_run(f"Accuracy of {title}", found.run.name, said, found.notes, table, chart)
    head = ("pose", "ball", "centring", "x", "y", "z", "distance")
    table = ("Centrings, in µm", head, _centrings(found))
    said, chart = _precision_sentences(found), centring_chart(found)
    return report_judged_run(f"Precision of centring on {title}", found.run.name, said, found.notes, table, chart)


def _validation_sentences(found: Validation) -> list[str]:
    misses = ", ".join(f"{n} by {m / UM:.0f} µm" for n, m in zip(found.nests, found.frame.misses, strict=True))
    before, after = found.before.figures, None if found.after is None else found.after.figures
    said = [f"Mean position error {_mm(before.mean)} mm, at most {_mm(before.largest)} mm, by the data sheet."]
    if after is not None:
        said.append(
            f"Calibrated: mean {_mm(after.mean)} mm, at most {_mm(after.largest)} mm, standard deviation "
            f"{_mm(after.std)} mm."
        )
    said += [
        f"{name}: {m.performance.text()}."
        for name, m in (("Data sheet", found.before), ("Calibrated", found.after))
        if m is not None and m.performance is not None
    ]
    said.append(f"The tracker's frame was found from {len(found.nests)} nests; it misses {misses}.")
    return [*said, f"{found.floor.text()}."]


def _precision_sentences(found: RepeatedCentrings) -> list[str]:
    s, master = found.summary, found.master
    said = [
        f"{s.centrings} centrings of {s.poses} poses: at most {in_um(s.largest)} µm from the mean of a pose, "
        f"rms {in_um(s.rms)} µm, two of one pose at most {in_um(s.apart)} µm apart.",
        "The robot's repeatability and the gauge's noise, as declared, let expect an rms of "
        f"{in_um(found.expected)} µm.",
        f"The TriCal paper's Table 3 has three centrings within about {FRAMES.published_centring_um:g} µm of the "
        "master ball, by a CMM: there the arm had no part in it; here what its joint angles do not show counts too.",
    ]
    return said if master is None else [*said, f"{master.text()[0].upper()}{master.text()[1:]}."]


def _figures(name: str, f: ErrorFigures) -> Row:
    return (name, str(f.count), _mm(f.mean), _mm(f.largest), _mm(f.std), *(_mm(v) for _, v in f.percentiles))


def _centrings(found: RepeatedCentrings) -> list[Row]:
    """One row a centring, pose by pose."""
    rows, seen = list[Row](), dict[int, int]()
    for k in np.argsort(found.pose, kind="stable"):
        pose = int(found.pose[k])
        seen[pose] = seen.get(pose, 0) + 1
        off = [f"{round(v / UM, 1) + 0.0:+.1f}" for v in found.off[k]]
        rows.append((str(pose), found.ball[k], str(seen[pose]), *off, in_um(float(np.linalg.norm(found.off[k])))))
    return rows


def _mm(value: float) -> str:
    return f"{float(to_mm(value)):.3f}"
