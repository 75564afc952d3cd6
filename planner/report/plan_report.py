"""The report of a plan: one page that needs nothing else, and a PNG of each chart."""

from dataclasses import dataclass
from pathlib import Path

from plotly.offline import get_plotlyjs

from planner.cell.cell import Cell
from planner.common.files import write_bytes, write_text
from planner.common.units import to_deg, to_mm
from planner.design.discrimination.power import PairPower
from planner.design.observability.information import INDEX_RULES
from planner.report.cell_view import CellView, build_cell_view
from planner.report.cell_view_rendering import player_json, view_json, view_png
from planner.report.chart import Chart
from planner.report.formatting import (
    bound_text,
    certificate_text,
    duration_text,
    percent_text,
    separation_text,
    significant_text,
)
from planner.report.matplotlib_backend import chart_png
from planner.report.page import FOLDER, load_template, safe_json
from planner.report.plan_charts import (
    bar_chart,
    contact_chart,
    foreseen_error_chart,
    funnel_chart,
    index_chart,
    joint_chart,
    parameter_chart,
    speed_chart,
    tour_chart,
)
from planner.report.plan_data import ParameterForecast, forecast_parameters, sample_drive, tour_orders
from planner.report.plotly_backend import chart_json
from planner.session.plan_types import Drive, Plan

Row = tuple[str, ...]


@dataclass(frozen=True)
class DriveSection:
    """One fixture's drive in words, and its pictures by what they show."""

    fixture: str
    tour_facts: tuple[Row, ...]
    path_facts: tuple[Row, ...]
    tour: Chart
    joints: Chart
    bar: Chart | None
    speeds: Chart

    @property
    def pictures(self) -> tuple[Chart, ...]:
        """All pictures of the drive."""
        of_gauge = () if self.bar is None else (self.bar,)
        return (self.tour, self.joints, *of_gauge, self.speeds)


@dataclass(frozen=True)
class PlanPage:
    """The report without its drawings; tables are rows of texts."""

    title: str
    cell: str
    plan_id: str
    seed: int
    facts: tuple[Row, ...]
    certificate: tuple[str, ...]
    notes: tuple[str, ...]
    sections: tuple[DriveSection, ...]
    learnt: tuple[Row, ...]
    unseen: tuple[Row, ...]
    weak: tuple[str, ...]
    indices: tuple[Row, ...]
    programs: tuple[Row, ...]
    joints: tuple[str, ...]
    poses: tuple[Row, ...]
    pose_columns: tuple[str, str]
    bar: bool
    told: tuple[Row, ...]
    told_proof: str


def build_plan_page(plan: Plan, rows: tuple[ParameterForecast, ...], sections: tuple[DriveSection, ...]) -> PlanPage:
    """Set all texts of the report."""
    seen = plan.choice.seen
    return PlanPage(
        title=f"Measuring plan for {plan.cell.robot.title}",
        cell=_cell(plan.cell),
        plan_id=plan.plan_id,
        seed=plan.seed,
        facts=_facts(plan),
        certificate=certificate_text(plan),
        notes=plan.notes,
        sections=sections,
        learnt=tuple(_learnt(r) for r in rows),
        unseen=tuple((d.name, d.because) for d in seen.dropped),
        weak=tuple(w.name for w in seen.weak),
        indices=_indices(plan),
        programs=tuple((name, ", ".join(f.name for f in files)) for name, files in plan.programs),
        joints=tuple(f"axis {j + 1} (deg)" for j in range(plan.cell.robot.n_joints)),
        poses=tuple(_pose(plan.cell, d, k) for d in plan.drives for k in range(len(d.visits))),
        pose_columns=("fixture", "bar (mm)") if plan.cell.gauge.is_attached else ("ball", "first contact (mm)"),
        bar=plan.cell.gauge.is_attached,
        told=() if plan.separation is None else tuple(_told(t) for t in plan.separation.told),
        told_proof="" if plan.separation is None else separation_text(plan.separation),
    )


def _told(told: PairPower) -> Row:
    """A finding, its rival, and how surely they are told apart."""
    named = "named by the identification" if told.named else "would come up with other poses"
    sizes = (f"{v:.3g}" for v in (told.noncentrality, told.before, told.bound))
    return (told.finding, told.rival, named, told.power_text, *sizes)


def _cell(cell: Cell) -> str:
    g, names = cell.gauge, ", ".join(dict.fromkeys(f.name for f in cell.fixtures))
    if g.head is not None:
        return f"cell {cell.name} · head of three indicators on the balls {', '.join(b.name for b in cell.balls)}"
    if not g.is_attached:
        return f"cell {cell.name} · tracker at [{', '.join(f'{v:.0f}' for v in to_mm(cell.fixtures[0].p_BX))}] mm"
    reach = f"{float(to_mm(g.length_min)):g} – {float(to_mm(g.length_max)):g} mm"
    points = f", tool points {', '.join(p.name for p in cell.tool.points)}" if cell.tool.points else ""
    return f"cell {cell.name} · bar {reach} on fixture{'s' if ',' in names else ''} {names}{points}"


def _facts(plan: Plan) -> tuple[Row, ...]:
    """The handful of numbers that a person asks for first: (what, value, remark)."""
    choice, cell, drives = plan.choice, plan.cell, plan.drives
    rule, bound = INDEX_RULES[choice.index], choice.certificate
    roles = [v.role for d in drives for v in d.visits]
    extra = ", ".join(f"{n} to {r}" for r in ("repeat", "validate") if (n := roles.count(r)))
    made = "calibrate" in roles
    what_for = f"to calibrate{f', {extra}' if extra else ''}" if made else "to validate, at random"
    free = len(choice.seen.names)
    gap = rule.gap(choice.value, bound.value)
    beyond = "better than the bound" if gap < 0 else f"at most {percent_text(gap)} from the bound"
    beyond = beyond if plan.by_index else "did not choose the poses"
    sets = f"for any {bound.poses}" if bound.poses else "for any number"
    verdicts = [v for d in drives for v in d.verdicts]
    engines = ", ".join(dict.fromkeys(v.engine for v in verdicts))
    driving = sum(d.trajectory.duration_s for d in drives)
    both = cell.motion.both_ways and cell.motion.measure == "continuous"
    return (
        ("poses", str(len(choice.q)), what_for),
        *_foreseen(plan),
        ("parameters", f"{free} of {free + len(choice.seen.dropped)}", "can be told apart"),
        (choice.index, significant_text(choice.value, 4), f"{rule.what}, {beyond}"),
        (
            "bound",
            bound_text(bound.value, rule.maximise),
            f"{'proven' if bound.verified else 'not proven'} {sets} candidates",
        ),
        ("driving", duration_text(driving), f"{'both ways, ' if both else ''}{cell.motion.measure}"),
        ("clearance", f"{float(to_mm(min(v.clearance for v in verdicts))):.1f} mm", f"found by {engines}"),
    )


def _foreseen(plan: Plan) -> tuple[Row, ...]:
    """The error that the robot would keep, where the poses were chosen by that."""
    if plan.foresight is None:
        return ()
    left, bound = (f"{float(to_mm(v)):.3f} mm" for v in (plan.foresight.left, plan.foresight.bound))
    return (("error foreseen", left, f"rms, once traced; none leaves less than {bound}"),)


def tour_facts(cell: Cell, drive: Drive) -> tuple[Row, ...]:
    """What is known of the order: (what, value)."""
    tour, returns = drive.tour, len(drive.trajectory.waypoint_time) > len(drive.path.q)
    short = (
        "proven: no order is quicker"
        if tour.optimal
        else f"no order is quicker than {duration_text(tour.lower_bound_s)}"
    )
    return (
        ("solver", tour.solver),
        ("in the order of selection", duration_text(tour.unsorted_s)),
        ("in the order of the tour", f"{duration_text(tour.cost_s)} ({short})"),
        ("as driven", f"{duration_text(drive.trajectory.duration_s)}{', both ways' if returns else ''}"),
    )


def path_facts(cell: Cell, drive: Drive) -> tuple[Row, ...]:
    """What is known of the path: (what, value)."""
    path, g = drive.path, cell.gauge
    direct, supports = sum(leg.direct for leg in path.legs), int((path.node < 0).sum())
    length = f"{float(to_mm(path.length_min)):.1f} – {float(to_mm(path.length_max)):.1f} mm"
    reach = f"{float(to_mm(g.length_min)):g} – {float(to_mm(g.length_max)):g} mm"
    asked = f"{float(to_mm(cell.motion.clearance)):g} mm asked for"
    there = "way without the bar" if g.is_attached else "way to the start"
    ways = ("measuring path", "measuring path", there, there)
    verdicts = [
        (
            f"{way}, judged by {v.engine}",
            f"{'free, proven between the checked states too' if v.clear else 'not proven free'}; "
            f"nearest pair {float(to_mm(v.clearance)):.1f} mm apart ({asked})",
        )
        for way, v in zip(ways, drive.verdicts, strict=True)
    ]
    return (
        (
            "legs",
            f"{len(path.legs)}: {direct} straight in joint space, {len(path.legs) - direct} planned around something",
        ),
        ("support poses", str(supports)),
        *([("bar length", f"{length} of {reach}")] if g.is_attached else []),
        *verdicts,
    )


def _learnt(row: ParameterForecast) -> Row:
    """Name, what it is, unit, prior size, standard deviation, their ratio."""
    p = row.parameter
    unit, to = ("mm", to_mm) if p.unit == "m" else (p.unit.replace("rad", "deg"), to_deg)
    return (
        p.name,
        row.what,
        unit,
        significant_text(float(to(p.prior))),
        significant_text(float(to(row.sigma))),
        significant_text(row.share),
    )


def _indices(plan: Plan) -> tuple[Row, ...]:
    """Name, what it is, which way is better, raw, scaled."""
    raw, scaled = plan.choice.raw, plan.choice.scaled
    return tuple(
        (
            name,
            rule.what,
            "higher" if rule.maximise else "lower",
            significant_text(getattr(raw, name), 4),
            significant_text(getattr(scaled, name), 4),
        )
        for name, rule in INDEX_RULES.items()
    )


def _pose(cell: Cell, drive: Drive, k: int) -> Row:
    v = drive.visits[k]
    role = v.role if v.repeats is None else f"{v.role} of {v.repeats}"
    angles = tuple(f"{float(a):.3f}" for a in to_deg(v.q))
    if not cell.gauge.is_attached:
        met = "" if v.contact is None else f"{float(to_mm(v.contact)):.2f}"
        return (str(v.id), cell.balls[v.ball].name if v.ball >= 0 else "", role, met, *angles)
    return (str(v.id), cell.place_name(v.fixture), role, f"{float(to_mm(v.length)):.2f}", *angles)


def write_report(plan: Plan, folder: Path) -> list[Path]:
    """Write ``report.html`` into an existing folder, and its pictures as PNGs into ``folder/pictures``.

    The same plan gives the same bytes.

    Returns:
        What was written, the page first.

    Raises:
        InputError: the folder does not exist, or may not be written.
    """
    rows = forecast_parameters(plan)
    ahead = (foreseen_error_chart(plan.foresight),) if plan.foresight else ()
    overview = (index_chart(plan), funnel_chart(plan), parameter_chart(rows), *ahead)
    sections = tuple(_section(plan, k) for k in range(len(plan.drives)))
    pictures = (*overview, *(p for s in sections for p in s.pictures))
    stage = build_cell_view(plan)
    page = load_template("report.html.j2").render(
        page=build_plan_page(plan, rows, sections),
        overview={p.name: p for p in overview},
        figures=[(p.name, safe_json(chart_json(p))) for p in pictures],
        view=safe_json(view_json(stage)),
        player_data=safe_json(player_json(stage)),
        player=(FOLDER / "player.js").read_text(encoding="utf-8"),
        plotly=get_plotlyjs(),
    )
    write_text(folder / "report.html", page)
    return [folder / "report.html", *_prints(pictures, stage, folder)]


def _prints(pictures: tuple[Chart, ...], stage: CellView, folder: Path) -> list[Path]:
    place = folder / "pictures"
    if folder.is_dir():
        place.mkdir(exist_ok=True)
    drawn = [("view", view_png(stage)), *((p.name, chart_png(p)) for p in pictures)]
    paths = [place / f"{name}.png" for name, _ in drawn]
    for path, (_, data) in zip(paths, drawn, strict=True):
        write_bytes(path, data)
    return paths


def _section(plan: Plan, k: int) -> DriveSection:
    cell, drive = plan.cell, plan.drives[k]
    way = sample_drive(cell, drive)
    suffix = f"_{k + 1}" if len(plan.drives) > 1 else ""
    return DriveSection(
        fixture=cell.place_name(drive.fixture),
        tour_facts=tour_facts(cell, drive),
        path_facts=path_facts(cell, drive),
        tour=tour_chart(drive, tour_orders(cell, drive), suffix),
        joints=joint_chart(way, drive, suffix),
        bar=bar_chart(cell, way, drive, suffix) if cell.gauge.is_attached else contact_chart(cell, drive, suffix),
        speeds=speed_chart(cell, way, drive, suffix),
    )
