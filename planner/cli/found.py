"""What ``edbb identify`` tells at the end: the error stage by stage, what was found, what to know."""

from pathlib import Path

from planner.cli.screen import errors
from planner.identification import Calibration, Metrics
from planner.identification.leftover import Leftover
from planner.units import MM

NAMED = 3  # rivals that are listed by name


def identification_summary(found: Calibration, left: Leftover, folder: Path) -> None:
    """Say in a few lines how far off the robot is before and after, and why."""
    wide = 2 + max(26, *(len(s.name) for s in found.stages))
    fitted = sum(e.identifiable for e in found.estimates)
    lines = [
        f"{found.run.name}: {len(found.run)} samples, {found.n_groups} {_several(found.split_by)}, "
        f"{100 * found.hold_out:.0f} % held out at a time, {fitted} parameters",
        f"  {'':<{wide}}{'held out: rms':>14}{'mean':>10}{'largest':>10}"
        + (f"{'validation: mean':>20}" if _judged(found) else ""),
    ]
    for stage in found.stages:
        lines.append(f"  {stage.name:<{wide}}{_row(stage.held_out)} mm" + _mean(stage.validation))
    if found.traced is not None:
        lines += [f"  found       {f.note}" + _rivals(f.rivals) for f in found.traced.findings]
        lines += [] if found.traced.findings else ["  found       nothing beyond noise that the catalogue can name"]
    lines.append(f"  left        {left.sentence}")
    lines += [f"  note        {w}" for w in found.warnings]
    lines.append(f"  written to  {folder}: identification.json, residuals.csv, report.html" + _robot(found, folder))
    errors.print("\n".join(lines), markup=False)


def _several(group: str) -> str:
    return f"{group}es" if group.endswith("ch") else f"{group}s"


def _judged(found: Calibration) -> bool:
    return found.stages[-1].validation is not None


def _row(m: Metrics) -> str:
    return f"{m.rms / MM:14.4f}{m.mean / MM:10.4f}{m.largest / MM:10.4f}"


def _mean(m: Metrics | None) -> str:
    return "" if m is None else f"{m.mean / MM:13.4f} mm"


def _rivals(names: tuple[str, ...]) -> str:
    if not names:
        return ""
    more = f" or {len(names) - NAMED} more" if len(names) > NAMED else ""
    return f"; or {', or '.join(names[:NAMED])}{more}: the run cannot tell them apart"


def _robot(found: Calibration, folder: Path) -> str:
    if found.problems:
        return ""
    return ", robot.toml" + (", robot.urdf" if (folder / "robot.urdf").exists() else "")
