"""``papers()``: computes the numbers of the two papers' page and writes it.

Computes the numbers of the rows, group by group: some take seconds, the others minutes.

The page: one table a paper, pictures, the published method beside the default; as HTML and as Markdown.
"""

from base64 import b64encode
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from planner.common.calls import called_with
from planner.common.files import write_bytes, write_text
from planner.common.progress import Stages
from planner.common.result import FolderResult
from planner.common.summary import Summary
from planner.report.page import template_environment
from planner.reproduction.papers_call import PapersCall
from planner.reproduction.pictures import PICTURES
from planner.reproduction.rows import Numbers, Row, count_verdicts, paper_titles, rows_of, stored_numbers

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


QUICK = {
    "model": "planner.reproduction.edbb_model:model_numbers",
    "kuka": "planner.reproduction.trical:table_numbers",
}  # seconds each
LONG = {
    "plan": "planner.reproduction.edbb_plan:plan_numbers",
    "loaded": "planner.reproduction.loaded_bar:loaded_numbers",
    "accuracy": "planner.reproduction.trical:accuracy_numbers",
    "methods": "planner.reproduction.methods:method_numbers",
}  # minutes each


def compute_group(name: str) -> Mapping[str, Any]:
    """Compute one group of numbers, rounded as it is kept."""
    module, _, function = {**QUICK, **LONG}[name].partition(":")
    make: Callable[[], Mapping[str, Any]] = getattr(import_module(module), function)
    return {key: _round(value) for key, value in make().items()}


def compute_numbers(stages: Stages, quick: bool) -> Numbers:
    """Compute every group, or with ``quick`` those that take seconds; the others are as they were stored."""
    groups = QUICK if quick else {**QUICK, **LONG}
    out = dict(stored_numbers())
    for name in groups:
        with stages.stage(name):
            out[name] = compute_group(name)
    return out


def _round(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.6g}")  # digits that are kept
    if isinstance(value, list | tuple):
        return [_round(v) for v in value]
    return {k: _round(v) for k, v in value.items()} if isinstance(value, dict) else value


@dataclass(frozen=True)
class PapersResult(FolderResult):
    """Every statement of the papers beside ours; ``numbers`` by group and name.

    Example:
        >>> papers(quick=True).numbers["model"]  # doctest: +SKIP
    """

    main_file = "numbers.json"
    numbers: Numbers

    def overview(self) -> Summary:
        """Return how many rows agree, and which differ."""
        rows = rows_of(self.numbers)
        count = count_verdicts(rows)
        facts = [(name, str(count[name])) for name in ("agrees", "differs", "not compared")]
        details = [("differs", f"{row.where}: {row.says}") for row in rows if row.verdict == "differs"]
        return Summary(f"The two papers: {len(rows)} rows", facts, details=details)

    def content(self) -> Mapping[str, Any]:
        """Return what ``numbers.json`` says."""
        return self.numbers

    def fill(self, draft: Path) -> None:
        """Write the page and its pictures."""
        from planner.reproduction.pictures import draw_pictures  # plotting takes long to load

        pictures = draw_pictures(self.numbers)
        write_text(draft / "report.html", page_html(self.numbers, pictures))
        (draft / "pictures").mkdir()
        for name, png in pictures.items():
            write_bytes(draft / "pictures" / f"{name}.png", png)

    def files(self, folder: Path) -> str:
        """Name what is written."""
        return "report.html, numbers.json, pictures"


@called_with(PapersCall)
def papers(asked: PapersCall) -> PapersResult:
    """Compute the numbers of the papers' page.

    Raises:
        MissingProgramError: a package of planning is not installed.

    Example:
        >>> papers(quick=True).write("papers")  # doctest: +SKIP
    """
    return PapersResult(compute_numbers(Stages(asked.progress), asked.quick))
