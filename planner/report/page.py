"""What the page says, ready to be set: every number is a text with its unit, every table a list of rows."""

from dataclasses import dataclass

from planner.cell import Cell
from planner.observability import RULES
from planner.plan import Drive, Plan
from planner.report.data import Learnt
from planner.report.picture import Picture
from planner.report.words import certificate, percent, proven, seconds, separation_proof, sized
from planner.separating import Told
from planner.units import to_deg, to_mm

Row = tuple[str, ...]


@dataclass(frozen=True)
class Section:
    """One fixture's drive in words, and its pictures by what they show."""

    fixture: str
    tour_facts: tuple[Row, ...]
    path_facts: tuple[Row, ...]
    tour: Picture
    joints: Picture
    bar: Picture | None
    speeds: Picture

    @property
    def pictures(self) -> tuple[Picture, ...]:
        """All pictures of the drive."""
        of_gauge = () if self.bar is None else (self.bar,)
        return (self.tour, self.joints, *of_gauge, self.speeds)


@dataclass(frozen=True)
class Page:
    """The report without its drawings; tables are rows of texts."""

    title: str
    cell: str
    plan_id: str
    seed: int
    facts: tuple[Row, ...]
    certificate: tuple[str, ...]
    notes: tuple[str, ...]
    sections: tuple[Section, ...]
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


def build_page(plan: Plan, rows: tuple[Learnt, ...], sections: tuple[Section, ...]) -> Page:
    """Set all texts of the report."""
    seen = plan.choice.seen
    return Page(
        title=f"Measuring plan for {plan.cell.robot.title}",
        cell=_cell(plan.cell),
        plan_id=plan.plan_id,
        seed=plan.seed,
        facts=_facts(plan),
        certificate=certificate(plan),
        notes=plan.notes,
        sections=sections,
        learnt=tuple(_learnt(r) for r in rows),
        unseen=tuple((d.name, d.because) for d in seen.dropped),
        weak=tuple(w.name for w in seen.weak),
        indices=_indices(plan),
        programs=tuple((name, ", ".join(f.name for f in files)) for name, files in plan.programs),
        joints=tuple(f"axis {j + 1} (deg)" for j in range(plan.cell.robot.n_joints)),
        poses=tuple(_pose(plan.cell, d, k) for d in plan.drives for k in range(len(d.visits))),
        pose_columns=("fixture", "bar (mm)") if plan.cell.gauge.is_bar else ("ball", "first contact (mm)"),
        bar=plan.cell.gauge.is_bar,
        told=() if plan.separation is None else tuple(_told(t) for t in plan.separation.told),
        told_proof="" if plan.separation is None else separation_proof(plan.separation),
    )


def _told(told: Told) -> Row:
    """A finding, its rival, and how surely they are told apart."""
    named = "named by the identification" if told.named else "would come up with other poses"
    sizes = (f"{v:.3g}" for v in (told.noncentrality, told.before, told.bound))
    return (told.finding, told.rival, named, told.sureness, *sizes)


def _cell(cell: Cell) -> str:
    g, names = cell.gauge, ", ".join(dict.fromkeys(f.name for f in cell.fixtures))
    if g.head is not None:
        return f"cell {cell.name} · head of three indicators on the balls {', '.join(b.name for b in cell.balls)}"
    if not g.is_bar:
        return f"cell {cell.name} · tracker at [{', '.join(f'{v:.0f}' for v in to_mm(cell.fixtures[0].p_BX))}] mm"
    reach = f"{float(to_mm(g.length_min)):g} – {float(to_mm(g.length_max)):g} mm"
    points = f", tool points {', '.join(p.name for p in cell.tool.points)}" if cell.tool.points else ""
    return f"cell {cell.name} · bar {reach} on fixture{'s' if ',' in names else ''} {names}{points}"


def _facts(plan: Plan) -> tuple[Row, ...]:
    """The handful of numbers that a person asks for first: (what, value, remark)."""
    choice, cell, drives = plan.choice, plan.cell, plan.drives
    rule, bound = RULES[choice.index], choice.certificate
    roles = [v.role for d in drives for v in d.visits]
    extra = ", ".join(f"{n} to {r}" for r in ("repeat", "validate") if (n := roles.count(r)))
    made = "calibrate" in roles
    what_for = f"to calibrate{f', {extra}' if extra else ''}" if made else "to validate, at random"
    free = len(choice.seen.names)
    gap = rule.gap(choice.value, bound.value)
    beyond = "better than the bound" if gap < 0 else f"at most {percent(gap)} from the bound"
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
        (choice.index, sized(choice.value, 4), f"{rule.what}, {beyond}"),
        (
            "bound",
            proven(bound.value, rule.maximise),
            f"{'proven' if bound.verified else 'not proven'} {sets} candidates",
        ),
        ("driving", seconds(driving), f"{'both ways, ' if both else ''}{cell.motion.measure}"),
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
    short = "proven: no order is quicker" if tour.optimal else f"no order is quicker than {seconds(tour.lower_bound_s)}"
    return (
        ("solver", tour.solver),
        ("in the order of selection", seconds(tour.unsorted_s)),
        ("in the order of the tour", f"{seconds(tour.cost_s)} ({short})"),
        ("as driven", f"{seconds(drive.trajectory.duration_s)}{', both ways' if returns else ''}"),
    )


def path_facts(cell: Cell, drive: Drive) -> tuple[Row, ...]:
    """What is known of the path: (what, value)."""
    path, g = drive.path, cell.gauge
    direct, supports = sum(leg.direct for leg in path.legs), int((path.node < 0).sum())
    length = f"{float(to_mm(path.length_min)):.1f} – {float(to_mm(path.length_max)):.1f} mm"
    reach = f"{float(to_mm(g.length_min)):g} – {float(to_mm(g.length_max)):g} mm"
    asked = f"{float(to_mm(cell.motion.clearance)):g} mm asked for"
    there = "way without the bar" if g.is_bar else "way to the start"
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
        *([("bar length", f"{length} of {reach}")] if g.is_bar else []),
        *verdicts,
    )


def _learnt(row: Learnt) -> Row:
    """Name, what it is, unit, prior size, standard deviation, their ratio."""
    p = row.parameter
    unit, to = ("mm", to_mm) if p.unit == "m" else (p.unit.replace("rad", "deg"), to_deg)
    return (p.name, row.what, unit, sized(float(to(p.prior))), sized(float(to(row.sigma))), sized(row.share))


def _indices(plan: Plan) -> tuple[Row, ...]:
    """Name, what it is, which way is better, raw, scaled."""
    raw, scaled = plan.choice.raw, plan.choice.scaled
    return tuple(
        (
            name,
            rule.what,
            "higher" if rule.maximise else "lower",
            sized(getattr(raw, name), 4),
            sized(getattr(scaled, name), 4),
        )
        for name, rule in RULES.items()
    )


def _pose(cell: Cell, drive: Drive, k: int) -> Row:
    v = drive.visits[k]
    role = v.role if v.repeats is None else f"{v.role} of {v.repeats}"
    angles = tuple(f"{float(a):.3f}" for a in to_deg(v.q))
    if not cell.gauge.is_bar:
        met = "" if v.contact is None else f"{float(to_mm(v.contact)):.2f}"
        return (str(v.id), cell.balls[v.ball].name if v.ball >= 0 else "", role, met, *angles)
    return (str(v.id), cell.place_name(v.fixture), role, f"{float(to_mm(v.length)):.2f}", *angles)
