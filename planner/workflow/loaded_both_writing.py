"""Writes a session with both bars: two plans, the cell of their common fit, and what each would know."""

import json
from dataclasses import replace
from pathlib import Path

from planner.cell import Cell
from planner.cell.file import CellFile
from planner.files import write_bytes, write_text
from planner.schema import validate
from planner.study.softness.both_results import both_content
from planner.workflow.circle_writing import write_circular_plan
from planner.workflow.loaded_both import BothPlan
from planner.workflow.planning import Stages
from planner.workflow.writing import cell_text, drafted, move_all, write_plan

UNLOADED, LOADED = "unloaded", "loaded"  # folders of the two plans


def write_both(done: BothPlan, folder: Path, stages: Stages) -> list[Path]:
    """Write ``unloaded/`` and ``loaded/``, each a whole plan, ``cell.toml`` of the fit, ``both.json``, its picture."""
    from planner.report.printed import picture_png
    from planner.study.softness.pictures import known_by_both  # plotting: other commands start quicker without

    with drafted(folder) as draft:
        if done.unloaded is not None:
            write_plan(done.unloaded, draft / UNLOADED, stages)
        write_circular_plan(done.loaded, draft / LOADED, stages)
        with stages.stage("report"):
            write_text(draft / "cell.toml", cell_text(fit_cell(done.free.cell, done.loaded.cell), draft))
            write_text(draft / "both.json", both_text(done))
            (draft / "pictures").mkdir()
            write_bytes(draft / "pictures" / "known.png", picture_png(known_by_both(done.known)))
            return move_all(draft, folder)


def both_text(done: BothPlan) -> str:
    """Return ``both.json``."""
    return json.dumps(content_of(done), indent=1, ensure_ascii=False) + "\n"


def content_of(done: BothPlan) -> dict[str, object]:
    """Return the content of ``both.json``."""
    poses, circles = len(done.free.q), [a.circle.name for a in done.arcs]
    return both_content(done.known, done.loaded.cell.robot.name, poses, circles, session(done))


def session(done: BothPlan) -> tuple[str, ...]:
    """Say in which order everything is done, and with which files."""
    first = f"{done.source.parent.name}/{done.source.name}" if done.source is not None else UNLOADED
    return (
        f"the bar without load: the program of {first}, its log is the run FREE.csv",
        f"the loaded bar: the program of {LOADED}, which tells where it stands and when the load changes; its log with "
        "force_N is the run LOADED.csv",
        "both in one fit: edbb loaded LOADED.csv --with FREE.csv --cell cell.toml -o DIR",
        "the corrected robot: edbb identify DIR/joint.csv --cell cell.toml -o CALIBRATED",
    )


def fit_cell(free: Cell, loaded: Cell) -> Cell:
    """Return the cell of the common fit: the loaded circles, all fixtures, a gauge that reaches as far as both bars."""
    content = loaded.file.model_dump(mode="json", by_alias=True, exclude_none=True)
    other = free.file.model_dump(mode="json", by_alias=True, exclude_none=True)
    content["fixtures"] += [{k: v for k, v in f.items() if k != "mount_deg"} for f in other["fixtures"]]
    gauges = content["gauge"], other["gauge"]
    lengths = [length for g in gauges for length in g["length_mm"]]
    content["gauge"] |= {
        "length_mm": [min(lengths), max(lengths)],
        "noise_um": max(g.get("noise_um", 1.0) for g in gauges),
    }
    return replace(loaded, file=validate(content, CellFile, str(loaded.path)))
