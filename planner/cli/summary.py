"""What the commands tell at the end: a few lines for a person, or JSON for a program."""

import json
import sys
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from planner.cli.screen import errors
from planner.observability import RULES
from planner.plan import Plan
from planner.program import dialects
from planner.robot import load_robot, shipped_robots


def plan_summary(plan: Plan, folder: Path) -> None:
    """Say in a few lines what was planned, how good it provably is, and where it lies."""
    choice, drives = plan.choice, plan.drives
    gap = RULES[choice.index].gap
    bound = choice.certificate.value
    tour_s, unsorted_s = sum(d.tour.cost_s for d in drives), sum(d.tour.unsorted_s for d in drives)
    clearance = min(d.path.clearance for d in drives) * 1e3
    lines = [
        f"{plan.cell.name}: {len(choice.q)} poses for {choice.seen.rank} parameters, plan {plan.plan_id}",
        f"  candidates  {plan.pool.funnel.text()}",
        f"  {choice.index:<10}  {choice.value:#.4g}; of the candidates no such set is better than {bound:#.4g}"
        f" (theirs {choice.on_grid_value:#.4g}, gap {100 * gap(choice.on_grid_value, bound):.1f} %)",
        f"  tour        {unsorted_s:.1f} s unsorted, {tour_s:.1f} s sorted"
        f" ({'proven shortest' if all(d.tour.optimal for d in drives) else 'not proven shortest'}),"
        f" {sum(d.trajectory.duration_s for d in drives) / 60:.1f} min as driven",
        f"  path        {clearance:.1f} mm clearance, proven continuously by coal and judged again by fcl",
    ]
    lines += [f"  tells apart {text}" for text in plan.separation.texts()] if plan.separation else []
    lines += [f"  left out    {d.name}: {d.because}" for d in choice.seen.dropped]
    lines += [f"  note        {note}" for note in plan.notes]
    lines.append(
        f"  written to  {folder}: " + ", ".join(f.name for _, files in plan.programs for f in files) + ", report.html"
    )
    errors.print("\n".join(lines), markup=False)


def robot_table(cells: tuple[str, ...], as_json: bool) -> None:
    """Print the shipped robots with their cells."""
    rows = []
    for name in shipped_robots():
        robot = load_robot(name)
        own = [c for c in cells if c.startswith(f"{name}/")]
        rows.append(
            {"name": name, "title": robot.title, "joints": robot.n_joints, "cells": own, "payload_kg": robot.payload}
        )
    if as_json:
        sys.stdout.write(json.dumps(rows, indent=1, ensure_ascii=False) + "\n")
        return
    table = Table("robot", "title", "joints", "payload", "cells", box=None)
    for row in rows:
        payload = "" if row["payload_kg"] is None else f"{row['payload_kg']:g} kg"
        table.add_row(row["name"], row["title"], str(row["joints"]), payload, ", ".join(row["cells"]))  # type: ignore[arg-type]
    Console(width=120).print(table)


def dialect_table(as_json: bool) -> None:
    """Print the dialects."""
    infos = dialects()
    if as_json:
        rows = [
            {
                "name": i.name,
                "title": i.title,
                "units": i.units,
                "max_joints": i.max_joints,
                "resolution_deg": float(10.0**-i.decimals),
                "logs_at_rest": i.logs_axes,
                "logs_in_passing": i.logs_passing,
                "trace": i.trace,
            }
            for i in infos
        ]
        sys.stdout.write(json.dumps(rows, indent=1, ensure_ascii=False) + "\n")
        return
    table = Table("dialect", "title", "axes", "resolution", "blending", "logs its axes", box=None)
    for i in infos:
        axes = f"{i.min_joints}–{i.max_joints}"
        table.add_row(i.name, i.title, axes, f"{np.power(10.0, -i.decimals):g}°", i.blend_kind, i.logging)
    Console(width=120).print(table)
