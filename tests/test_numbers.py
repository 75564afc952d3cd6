"""Numbers at the level of a module are few, and each says in which unit it is and why it is what it is."""

import ast
from pathlib import Path

import pytest

import planner

ROOT = Path(planner.__file__).parent
MOST_NUMBERS = 500  # it only ever goes down
ROOMS = sorted(p.name for p in ROOT.iterdir() if p.is_dir() and (p / "__init__.py").exists())


FUNCTIONS = ("float", "int", "tuple", "frozenset", "range", "dict", "MappingProxyType")
NOTHING = ("empty", "arange(0)", "zeros(0)")  # arrays without a number


def is_number(value):
    """Tell whether a value is a number, a sum of some, what a function of numbers gives, or a table with some."""
    match value:
        case ast.Constant(value=number):
            return isinstance(number, (int, float)) and not isinstance(number, bool)
        case ast.UnaryOp(operand=operand):
            return is_number(operand)
        case ast.BinOp(left=left, right=right):
            texts = any(
                isinstance(side, (ast.JoinedStr, ast.Constant)) and not is_number(side) for side in (left, right)
            )
            return not texts and (is_number(left) or is_number(right))
        case ast.Tuple(elts=entries) | ast.List(elts=entries) | ast.Set(elts=entries) | ast.Dict(values=entries):
            return any(is_number(entry) for entry in entries)
        case ast.Call(func=function, args=arguments):
            name = ast.unparse(function)
            empty = any(nothing in ast.unparse(value) for nothing in NOTHING)
            of_numbers = name in FUNCTIONS or name.startswith(("np.", "math."))
            return of_numbers and not empty and any(is_number(argument) for argument in arguments)
    return False


def numbers_of(text):
    """Each assignment of numbers at the level of a module: its node and the names, ``A, B = 1, 2`` being two.

    Tables, arrays and what is computed of a number count as one.
    """
    for node in ast.parse(text).body:
        if isinstance(node, ast.Assign):
            target, value = node.targets[0], node.value
        elif isinstance(node, ast.AnnAssign) and node.value is not None:
            target, value = node.target, node.value
        else:
            continue
        pairs = [(target, value)]
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            pairs = list(zip(target.elts, value.elts, strict=True))
        names = [getattr(name, "id", "?") for name, number in pairs if is_number(number)]
        if names:
            yield node, names


def has_reason(lines, node):
    """Whether a comment stands in the assignment, or above it or above others in the same block, or a text below."""
    if any("#" in line for line in lines[node.lineno - 1 : node.end_lineno]):
        return True
    below = lines[node.end_lineno] if node.end_lineno < len(lines) else ""
    above = lines[node.lineno - 2] if node.lineno > 1 else ""
    return below.startswith('"""') or above.startswith("#")


@pytest.mark.slow
def test_numbers_of_modules_are_few():
    count = sum(len(names) for p in ROOT.rglob("*.py") for _, names in numbers_of(p.read_text()))
    assert count <= MOST_NUMBERS, f"{count} numbers: one that is used once stands where it is used, with its reason"


@pytest.mark.parametrize("room", ROOMS)
def test_each_number_says_its_reason(room):
    bare = []
    for path in sorted((ROOT / room).rglob("*.py")):
        text = path.read_text()
        lines = text.splitlines()
        bare += [f"{path}:{n.lineno} {', '.join(names)}" for n, names in numbers_of(text) if not has_reason(lines, n)]
    assert not bare, "no comment and no docstring says unit and reason:\n" + "\n".join(bare)


@pytest.mark.parametrize(
    ("text", "names", "explained"),
    [
        ("A = 1  # [m] why\n", ["A"], True),
        ("A = 1\n", ["A"], False),
        ("A, B = 1, -2.0\n", ["A", "B"], False),
        ('A: float = 2**3\n"""Why."""\n', ["A"], True),
        ("# why\nA = (1, 2)\n", ["A"], True),
        ("A = np.deg2rad(5.0)  # why\n", ["A"], True),
        ("A = float(np.log(0.01))\n", ["A"], False),
        ("A = np.array([1.0, 2.0]) * MM  # why\n", ["A"], True),
        ('A = {"m": 1.0, "mm": MM}  # why\n', ["A"], True),
        ('A = ("once", 1), ("twice", 2)  # why\n', ["A"], True),
    ],
)
def test_what_counts_as_a_number_with_a_reason(text, names, explained):
    ((node, found),) = numbers_of(text)
    assert (found, has_reason(text.splitlines(), node)) == (names, explained)


@pytest.mark.parametrize(
    "text",
    [
        "A = True\n",
        'A = "1"\n',
        "A = f(1)\n",
        "A = ()\n",
        "A = np.empty((0, 3))\n",
        'A = "0" * 12\n',
        "def f():\n    A = 1\n",
    ],
)
def test_what_is_no_number(text):
    assert not list(numbers_of(text))
