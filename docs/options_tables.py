"""Puts the tables of the declared options and of the causes into the pages, as they are built."""

import re

from planner.common.calls import options_table
from planner.effects.catalogue import effect_kinds, needs_of
from planner.workflow.verbs import CALLS, DECLARED

ANY_RUN = "another kind of run"  # said where nothing but other poses is needed


def on_page_markdown(markdown: str, **_: object) -> str:
    """Fill ``<!-- options: VERB -->``, ``<!-- commands -->`` and ``<!-- effects -->``."""
    every = "\n\n".join(f"## edbb {c.verb}\n\n{c.line}\n\n<!-- options: {c.verb} -->" for c in CALLS)
    text = markdown.replace("<!-- commands -->", every).replace("<!-- effects -->", effects_table())
    return re.sub(r"<!-- options: ([a-z-]+) -->", lambda found: options_table(DECLARED[found[1]]), text)


def effects_table() -> str:
    """Return the table of all causes of the catalogue, and what a run needs beyond poses that excite them."""
    needs = ((kind, needs_of(kind)) for kind in effect_kinds())
    rows = [f"| {kind} | {'' if need == ANY_RUN else need} |" for kind, need in needs]
    return "\n".join(["| cause | what a run needs to show it, beside poses that excite it |", "|---|---|", *rows])
