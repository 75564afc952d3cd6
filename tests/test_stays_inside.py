"""Tests, examples and the documentation's programs look at no file outside the repository but temporary ones."""

import ast
from itertools import chain
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FILES = sorted(chain.from_iterable((ROOT / name).rglob("*.py") for name in ("tests", "examples", "docs")))
HOMES = ("Path.home", "expanduser", "XDG_")
DEVICES = tuple(f"{call}('/{top}" for call in ("Path", "open") for top in ("proc", "dev", "tmp"))
ASKS_THAT_NO_PAGE_NAMES_IT = "tests/report/test_page.py"


def depth_of(node, depths):
    """How many folders below the repository's an expression points to; ``None`` where that is not known.

    ``depths``: that of names; ``__file__`` is one.
    """
    match node:
        case ast.Name(id=name):
            return depths.get(name)
        case ast.Attribute(value=ast.Name(id="planner"), attr="__file__"):
            return len(("planner", "__init__.py"))
        case ast.Call(func=ast.Name(id="Path"), args=[argument]):
            return depth_of(argument, depths)
        case ast.Call(func=ast.Attribute(value=value, attr="resolve" | "absolute" | "with_name" | "with_suffix")):
            return depth_of(value, depths)
        case ast.Attribute(value=value, attr="parent"):
            known, up = depth_of(value, depths), 1
        case ast.Subscript(value=ast.Attribute(value=value, attr="parents"), slice=ast.Constant(value=k)):
            known, up = depth_of(value, depths), k + 1
        case ast.BinOp(left=left, op=ast.Div(), right=ast.Constant(value=str(text))):
            known = depth_of(left, depths)
            for part in Path(text).parts if known is not None else ():
                if known >= 0:  # once it is outside it stays there: /.. and back in again leads to a neighbour
                    known += -1 if part == ".." else 1
            return known
        case _:
            return None
    return None if known is None else known - up


def looks_outside(text, path):
    """Yield each expression of a file, by its place in the repository, that points above it or to a home."""
    tree, homes = ast.parse(text), () if str(path) == ASKS_THAT_NO_PAGE_NAMES_IT else HOMES
    depths = {"__file__": len(path.parts), "ROOT": 0}
    for node in tree.body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            depth = depth_of(node.value, depths)
            if depth is not None:
                depths[node.targets[0].id] = depth
    for node in ast.walk(tree):
        depth = depth_of(node, depths)
        told = ast.unparse(node) if isinstance(node, ast.Attribute | ast.Call) else ""
        opened = told.startswith(("Path('/", "open('/")) and not told.startswith(DEVICES)
        if (depth is not None and depth < 0) or opened or any(home in told for home in homes):
            yield f"{path}:{getattr(node, 'lineno', 0)}: {ast.unparse(node)}"


@pytest.mark.slow
def test_no_file_of_the_tests_looks_outside_the_repository():
    mine = Path(__file__)
    assert len(FILES) > 400
    texts = {path.relative_to(ROOT): path.read_text() for path in FILES if path != mine}
    assert not [place for path, text in texts.items() for place in looks_outside(text, path)]


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("Path(__file__).parents[2] / 'robots'", False),
        ("Path(__file__).parents[3] / 'robots'", True),
        ("HERE = Path(__file__).parent\nx = HERE.parent.parent.resolve()", False),
        ("HERE = Path(__file__).parent\nx = HERE.parent.parent.parent.resolve()", True),
        ("x = ROOT / '../shared/a.csv'", True),
        ("x = ROOT / 'robots/../g-code'", False),
        ("x = Path.home() / '.cache'", True),
        ("x = Path(planner.__file__).parents[1] / 'g-code'", False),
        ("x = Path(planner.__file__).parents[2]", True),
        ("x = open('/proc/self/statm')", False),
        ("x = open('/srv/data.csv')", True),
        ("x = Path('/srv')", True),
    ],
)
def test_what_looks_outside_is_found(text, found):
    assert bool(list(looks_outside(text, Path("tests/cell/test_x.py")))) is found
