"""How many lines a capability costs, as ARCHITECTURE.md states it: ``python -m docs.capability_lines``.

Counted are lines of code and of docstrings, without blank lines and comments; of several alike, the median.
"""

import ast
import io
import tokenize
from pathlib import Path
from statistics import median

from planner.common.extensions import load_extensions
from planner.effects.catalogue import effect_kinds, registrations
from planner.workflow.verbs import declared_calls

ROOT = Path(__file__).parents[1]


def code_lines(text: str) -> int:
    """Return the lines of Python that hold more than a comment."""
    skip = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
    lines = set[int]()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in skip:
            lines.update(range(token.start[0], token.end[0] + 1))
    return len(lines)


def text_lines(path: Path) -> int:
    """Return the lines of a text that are neither blank nor a comment."""
    return sum(1 for line in path.read_text().splitlines() if line.strip() and not line.strip().startswith("#"))


def lines_of_an_effect() -> int:
    """Lines of the files with registered effects, a kind."""
    files = {_file_of(r.generator.__module__) for r in registrations()}
    return round(sum(code_lines(f.read_text()) for f in files) / len(effect_kinds()))


def lines_of_a_dialect() -> int:
    """Lines of ``dialect.toml`` and ``program.j2``."""
    folders = [p.parent for p in (ROOT / "g-code").glob("*/dialect.toml")]
    return round(median(sum(text_lines(f) for f in folder.iterdir() if f.is_file()) for folder in folders))


def lines_of_a_gauge() -> int:
    """Lines of a file with a registered gauge."""
    files = [f for f in (ROOT / "planner" / "gauges").glob("*.py") if "@register_gauge" in f.read_text()]
    return round(median(code_lines(f.read_text()) for f in files))


def lines_of_a_command() -> int:
    """Lines of a declaration, and of the function that it names."""
    load_extensions()
    return round(median(_declared(call) + _named(call.function) for call in declared_calls().values()))


def _declared(call: type) -> int:
    return _lines_of(_file_of(call.__module__), call.__name__)


def _named(function: str) -> int:
    module, name = function.split(":")
    return _lines_of(_file_of(module), name)


def _file_of(module: str) -> Path:
    """File of a module of the planner."""
    return ROOT.joinpath(*module.split(".")).with_suffix(".py")


def _lines_of(path: Path, name: str) -> int:
    """Lines of a class or function of a file."""
    text = path.read_text()
    found = next(n for n in ast.walk(ast.parse(text)) if getattr(n, "name", "") == name)
    first, last = min(n.lineno for n in (found, *found.decorator_list)), found.end_lineno
    return code_lines("\n".join(text.splitlines()[first - 1 : last]) + "\n")


def rows() -> list[tuple[str, int]]:
    """Return what each capability costs: (what, lines)."""
    return [
        ("an effect", lines_of_an_effect()),
        ("a dialect", lines_of_a_dialect()),
        ("a gauge", lines_of_a_gauge()),
        ("a command", lines_of_a_command()),
    ]


if __name__ == "__main__":
    for what, lines in rows():
        print(f"{what:<12}{lines:>5}")
