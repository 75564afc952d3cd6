"""The page: one table a paper, pictures, the published method beside the default; as HTML and as Markdown."""

from base64 import b64encode
from pathlib import Path
from typing import Any

from planner.report.page import template_environment
from planner.reproduction.pictures import PICTURES
from planner.reproduction.rows import Numbers, Row, count_verdicts, paper_titles, rows_of

INTRODUCTION = (
    "The planner was made from two papers. This page has each of their tables, figures, equations and claims, in "
    "order, and what the planner says beside it. A verdict with numbers follows from them; where both differ, the "
    "reason stands beside it.",
    "Our robots are simulated: the papers' measured data are not public. Where a paper does not print what decides a "
    "number, our reading of it stands in the cell file.",
)
METHODS = (
    "`edbb plan CELL --as-published -o DIR` follows section 2.1.3 of the EDBB paper in every stage: candidates in the "
    "gauge's shell, pruning by the condition number, order by the slowest axis, support poses, blends, G-code and KRL.",
    "OMPL's PRM joins the roadmap in every plan, the default's too. Each motion that a path uses is proven.",
    "Do not compare O2 of different numbers of poses. The default chooses poses by the expected error of the tool; on "
    "the paper's own cell it uses O2. Minutes are of the drive with the bar, validation poses included. Processor "
    "time depends on the computer.",
)
METHOD_HEAD = ("cell", "method", "poses", "O2 (m, rad)", "drive (min)", "support poses", "processor (s)")
HEAD = ("where", "the paper says", "our command", "ours", "verdict, and why")


def summary_line(rows: tuple[Row, ...]) -> str:
    """Return how many rows agree and differ, as a sentence."""
    count = count_verdicts(rows)
    return (
        f"{len(rows)} rows: {count['agrees']} agree, {count['differs']} differ, {count['not compared']} not compared."
    )


def method_lines(numbers: Numbers) -> list[tuple[str, ...]]:
    """Return the table of the published method beside the default as texts."""
    return [
        (
            r["cell"], r["method"], str(r["poses"]), f"{r['o2']:.1f}", f"{r['minutes']:.0f}", str(r["supports"]),
            f"{r['processor_s']:.0f}",
        )
        for r in numbers["methods"]["rows"]
    ]  # fmt: skip


def page_html(numbers: Numbers, pictures: dict[str, bytes]) -> str:
    """Return the page as HTML; it needs no other file."""
    rows = rows_of(numbers)
    environment = template_environment(Path(__file__).parent)
    content: dict[str, Any] = {
        "introduction": INTRODUCTION,
        "summary": summary_line(rows),
        "papers": [(title, [r for r in rows if r.paper == name]) for name, title in paper_titles().items()],
        "head": HEAD,
        "pictures": [(PICTURES[k][0], b64encode(png).decode("ascii")) for k, png in pictures.items()],
        "methods": [text.replace("`", "") for text in METHODS],
        "method_head": METHOD_HEAD,
        "method_lines": method_lines(numbers),
    }
    return environment.get_template("page.html.j2").render(**content)


def page_markdown(numbers: Numbers) -> str:
    """Return the page as Markdown; its pictures lie in ``pictures/papers_NAME.png``."""
    rows = rows_of(numbers)
    parts = ["# The two papers", "```console\n$ edbb papers -o DIR\n```", *INTRODUCTION, summary_line(rows)]
    for name, title in paper_titles().items():
        lines = [_cells(row) for row in rows if row.paper == name]
        parts += [f"## {title}", _table(HEAD, lines)]
    parts.append("## Pictures")
    for name, (title, group, _) in PICTURES.items():
        if group not in numbers:
            continue
        parts.append(f"{title}:\n\n![{title}](pictures/papers_{name}.png)")
    parts += ["## The published method and the default", *METHODS, _table(METHOD_HEAD, method_lines(numbers))]
    return "\n\n".join(parts) + "\n"


def _cells(row: Row) -> tuple[str, ...]:
    command = f"`{row.command}`" if row.command else ""
    verdict = f"**{row.verdict}**" + (f": {row.why}" if row.why else "")
    return (row.where, row.says, command, row.ours, verdict)


def _table(head: tuple[str, ...], lines: list[tuple[str, ...]]) -> str:
    every = [head, ("---",) * len(head), *lines]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in every)
