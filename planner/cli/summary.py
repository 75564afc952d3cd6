"""What ``edbb plan`` tells at the end, in a few lines."""

from pathlib import Path

from planner.cli.screen import errors
from planner.cli.written import written_line
from planner.foresight import foreseen
from planner.observability import RULES
from planner.plan import Plan


def plan_summary(plan: Plan, folder: Path) -> None:
    """Say in a few lines what was planned, how good it provably is, and where it lies."""
    choice, drives = plan.choice, plan.drives
    gap = RULES[choice.index].gap
    bound = choice.certificate.value
    tour_s, unsorted_s = sum(d.tour.cost_s for d in drives), sum(d.tour.unsorted_s for d in drives)
    clearance = min(d.path.clearance for d in drives) * 1e3
    proof = (
        f"of the candidates no such set is better than {bound:#.4g} (theirs {choice.on_grid_value:#.4g}, gap "
        f"{100 * gap(choice.on_grid_value, bound):.1f} %)"
        if plan.by_index
        else f"it did not choose the poses (of the candidates no such set is better than {bound:#.4g})"
    )
    lines = [
        f"{plan.cell.name}: {len(choice.q)} poses for {choice.seen.rank} parameters, plan {plan.plan_id}",
        f"  candidates  {plan.pool.funnel.text()}",
        f"  {choice.index:<10}  {choice.value:#.4g}; {proof}",
        f"  tour        {unsorted_s:.1f} s unsorted, {tour_s:.1f} s sorted"
        f" ({'proven shortest' if all(d.tour.optimal for d in drives) else 'not proven shortest'}),"
        f" {sum(d.trajectory.duration_s for d in drives) / 60:.1f} min as driven",
        f"  path        {clearance:.1f} mm clearance, proven continuously by coal and judged again by fcl",
    ]
    lines += [f"  foresees    {foreseen(plan.foresight)}"] if plan.foresight else []
    lines += [f"  tells apart {text}" for text in plan.separation.texts()] if plan.separation else []
    lines += [f"  left out    {d.name}: {d.because}" for d in choice.seen.dropped]
    lines += [f"  note        {note}" for note in plan.notes]
    lines.append(written_line(folder, [f.name for _, files in plan.programs for f in files]))
    errors.print("\n".join(lines), markup=False)
