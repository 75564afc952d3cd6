"""``python -m docs.options_tables``: writes tables of options and causes, and the gallery, into the pages.

They stand there between two comments, for whoever reads the pages where they lie; the site makes them anew.
"""

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
ON_EVERY_COMMAND = ("--help", "--json", "--verbose", "--force", "--package")  # docs/commands.md has them once


MADE = re.compile(r"<!-- (options|effects|gallery)(?:: ([a-z-]+))? -->\n(?:.*?\n)?<!-- /\1 -->", re.DOTALL)


def on_page_markdown(markdown: str, **_: object) -> str:
    """Return a page of the site with what is made between ``<!-- options: VERB -->`` and ``<!-- /options -->``."""
    return MADE.sub(lambda found: _made(found[1], found[2], " width=420 "), markdown)


def page_in_place(markdown: str) -> str:
    """Return a page as it lies in the repository, what is made in its place between the comments."""
    return MADE.sub(lambda found: _between(found[0].partition("\n")[0], found[1], found[2]), markdown)


def _between(first: str, what: str, verb: str) -> str:
    return f"{first}\n{_made(what, verb)}\n<!-- /{what} -->"


def _made(what: str, verb: str, attributes: str = "") -> str:
    if what == "options":
        return verb_table(verb)
    return effects_table() if what == "effects" else gallery(attributes)


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
        if typed not in ON_EVERY_COMMAND:
            yield f"| `{typed}` | {(getattr(parameter, 'help', '') or '').replace('|', chr(92) + '|')} |"


def effects_table() -> str:
    """Return the table of all causes of the catalogue, by what a run needs to show them."""
    causes: dict[str, list[str]] = {}
    for kind in effect_kinds():
        causes.setdefault(needs_of(kind), []).append(kind)
    rows = [f"| {'poses that excite it' if need == ANY_RUN else need} | {', '.join(c)} |" for need, c in causes.items()]
    return "\n".join(["| what a run needs | causes |", "|---|---|", *rows])


def gallery(attributes: str = "") -> str:
    """Return picture, robot and gauge of every shipped cell; ``attributes``: of pictures, for the site."""
    return "\n\n".join(_shown_cell(name, attributes) for name in shipped_cells())


def _shown_cell(name: str, attributes: str) -> str:
    cell = load_cell(name, planning=False)
    picture = f"pictures/cell_{name.replace('/', '_')}.png"
    image = f"![{name}]({picture})" + (f"{{{attributes}}}" if attributes else "")
    shown = f"{image}\n\n" if (Path(__file__).parent / picture).is_file() else ""
    return f"## {name}\n\n{shown}{cell.robot.title}, gauge `{cell.gauge.kind}`."


if __name__ == "__main__":
    for page in sorted(Path(__file__).parent.rglob("*.md")):
        before = page.read_text(encoding="utf-8")
        if (after := page_in_place(before)) != before:
            page.write_text(after, encoding="utf-8")
            print(page)
