"""Puts the tables of options and of causes, and the gallery of cells, into the pages as they are built."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from planner.cell.reading import load_cell, shipped_cells
from planner.cli.app import load_command
from planner.common.calls import options_table
from planner.effects.catalogue import effect_kinds, needs_of
from planner.workflow.verbs import declared_calls

ANY_RUN = "another kind of run"  # said where nothing but other poses is needed
OF_CLICK = ("--help",)  # not listed


def on_page_markdown(markdown: str, **_: object) -> str:
    """Fill ``<!-- options: VERB -->``, ``<!-- gallery -->`` and ``<!-- effects -->``."""
    text = markdown.replace("<!-- effects -->", effects_table())
    if "<!-- gallery -->" in text:
        text = text.replace("<!-- gallery -->", gallery())
    return re.sub(r"<!-- options: ([a-z-]+) -->", lambda found: verb_table(found[1]), text)


def verb_table(verb: str) -> str:
    """Return the table of a verb's options: of its declaration, or of the command where it has none."""
    return options_table(calls[verb]) if verb in (calls := declared_calls()) else typed_table(verb)


def typed_table(verb: str) -> str:
    """Return the table of what can be typed behind a verb that only the command line has."""
    rows = list(_typed_rows(load_command(verb).params))
    if not rows:
        return "None."
    return "\n".join(["| on the command line | |", "|---|---|", *rows])


def _typed_rows(parameters: list[Any]) -> Iterator[str]:
    for parameter in parameters:
        typed = parameter.metavar if parameter.param_type_name == "argument" else parameter.opts[-1]
        if typed not in OF_CLICK:
            yield f"| `{typed}` | {(getattr(parameter, 'help', '') or '').replace('|', chr(92) + '|')} |"


def effects_table() -> str:
    """Return the table of all causes of the catalogue, and what a run needs beyond poses that excite them."""
    needs = ((kind, needs_of(kind)) for kind in effect_kinds())
    rows = [f"| {kind} | {'' if need == ANY_RUN else need} |" for kind, need in needs]
    return "\n".join(["| cause | what a run needs to show it, beside poses that excite it |", "|---|---|", *rows])


def gallery() -> str:
    """Return picture, title and command of every cell that comes with the planner."""
    return "\n\n".join(map(_shown_cell, shipped_cells()))


def _shown_cell(name: str) -> str:
    about = load_cell(name, planning=False).path.read_text(encoding="utf-8").splitlines()[0].removeprefix("# ")
    picture = f"pictures/cell_{name.replace('/', '_')}.png"
    command = f"```console\n$ edbb plan {name} -o out\n```"
    shown = f"![{name}]({picture}){{ width=420 }}\n\n" if (Path(__file__).parent / picture).is_file() else ""
    return f"## {name}\n\n{shown}{about}\n\n{command}"
