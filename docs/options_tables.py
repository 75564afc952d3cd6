"""Puts the tables of the declared options into the pages, as they are built."""

import re

from planner.common.calls import options_table
from planner.workflow.verbs import CALLS, DECLARED


def on_page_markdown(markdown: str, **_: object) -> str:
    """Fill ``<!-- options: VERB -->`` and ``<!-- commands -->``."""
    every = "\n\n".join(f"## edbb {c.verb}\n\n{c.line}\n\n<!-- options: {c.verb} -->" for c in CALLS)
    text = markdown.replace("<!-- commands -->", every)
    return re.sub(r"<!-- options: ([a-z-]+) -->", lambda found: options_table(DECLARED[found[1]]), text)
