"""Writes the table of rooms into ``ARCHITECTURE.md``: ``python -m docs.rooms_table``.

A row is a room and the first sentence of its ``__init__``, in the order of ``tests/test_layers.py``.
"""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "ARCHITECTURE.md"
HEAD = "| Room | One job |\n|---|---|\n"


def rooms_table(rooms: list[str]) -> str:
    """Return the table, a row a room."""
    rows = []
    for room in rooms:
        says = ast.get_docstring(ast.parse((ROOT / "planner" / room / "__init__.py").read_text(encoding="utf-8")))
        rows.append(f"| `{room}` | {' '.join((says or '').split()).replace('``', '`')} |\n")
    return HEAD + "".join(rows)


def with_table(text: str, rooms: list[str]) -> str:
    """Return the page with the table of now in the place of its own."""
    return re.sub(re.escape(HEAD) + r"(\|.*\n)*", lambda _: rooms_table(rooms), text)


if __name__ == "__main__":
    from tests.test_layers import ORDER

    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8"), ORDER), encoding="utf-8")
