"""Plain values of a template and what can be done with them: every result is bounded before it is made.

Only numbers, texts, lists and tables are values; no object of Python with attributes of its own is among them.
"""

import ast
import math
import operator
from collections.abc import Callable, Mapping, Sequence

LETTERS_A_STEP = 16  # of a text that are worth a step of work
MOST_LETTERS = 20_000  # of a text that an expression makes
MOST_ENTRIES = 1000  # of a list that an expression makes

Function = Callable[..., object]


class XacroError(Exception):
    """What is wrong with a template."""


def check_value(value: object) -> object:
    """Return a value that is a plain one of sensible size.

    Raises:
        XacroError: it is not.
    """
    if isinstance(value, bool) or value is None or isinstance(value, dict):
        return value
    if isinstance(value, int) and abs(value) > (2**63):  # of a whole number
        raise XacroError("a whole number is too large")
    if isinstance(value, float) and not math.isfinite(value):
        raise XacroError("a number is not finite")
    if isinstance(value, str) and len(value) > MOST_LETTERS:
        raise XacroError(f"a text is longer than {MOST_LETTERS} letters")
    if isinstance(value, list | tuple) and len(value) > MOST_ENTRIES:
        raise XacroError(f"a list has more than {MOST_ENTRIES} entries")
    if not isinstance(value, int | float | str | list | tuple):
        raise XacroError(f"a value is neither a number, a text, a list nor a table ({type(value).__name__})")
    return value


def to_text(value: object) -> str:
    """Return a value as it stands in the URDF.

    Raises:
        XacroError: it is a table, or a list of tables.
    """
    if isinstance(value, str):
        return value
    if isinstance(value, list | tuple):
        return "[" + ", ".join(repr(check_scalar(v)) for v in value) + "]"
    return str(check_scalar(value))


def check_scalar(value: object) -> object:
    """Refuse what has parts: to compare or write it could take for ever."""
    if value is None or isinstance(value, int | float | str):
        return value
    raise XacroError("a table or list stands where a number or a text is needed")


def _number(value: object) -> int | float:
    if isinstance(value, int | float):
        return value
    raise XacroError(f"{to_text(value)!r} stands where a number is needed")


def _add(a: object, b: object) -> object:
    if (isinstance(a, str) and isinstance(b, str)) or (isinstance(a, list) and isinstance(b, list)):
        return a + b  # type: ignore[operator]
    if isinstance(a, str) or isinstance(b, str):
        raise XacroError("a text and a number cannot be added; str(…) makes a text of a number")
    return _number(a) + _number(b)


def _multiply(a: object, b: object) -> object:
    for text, count in ((a, b), (b, a)):
        if isinstance(text, str) and isinstance(count, int):
            if len(text) * max(count, 0) > MOST_LETTERS:
                raise XacroError(f"a text is longer than {MOST_LETTERS} letters")
            return text * count
    return _number(a) * _number(b)


def _power(a: object, b: object) -> object:
    base, exponent = _number(a), _number(b)
    whole = isinstance(base, int) and isinstance(exponent, int)
    if whole and int(base).bit_length() * exponent > 64:  # bits of a power of whole numbers
        raise XacroError("a whole number is too large")
    return base**exponent


def _contains(a: object, b: object) -> bool:
    if isinstance(b, str):
        if not isinstance(a, str):
            raise XacroError("only a text can be in a text")
        return a in b
    if isinstance(b, dict):
        return check_scalar(a) in b
    if isinstance(b, list | tuple):
        return any(_is_equal(a, v) for v in b if not isinstance(v, dict | list | tuple))
    raise XacroError("'in' needs a text, a list or a table")


def _is_equal(a: object, b: object) -> bool:
    return check_scalar(a) == check_scalar(b)


def _compare_alike(compare: Callable[[float, float], bool]) -> Callable[[object, object], bool]:
    def compare_alike(a: object, b: object) -> bool:
        """Compare two values of one kind."""
        if isinstance(a, str) and isinstance(b, str):
            return compare(a, b)  # type: ignore[arg-type]
        return compare(_number(a), _number(b))

    return compare_alike


def _of_numbers(function: Function) -> Function:
    return lambda *numbers: function(*map(_number, numbers))


BINARY: Mapping[type, Function] = {
    ast.Add: _add,
    ast.Mult: _multiply,
    ast.Pow: _power,
    **{k: _of_numbers(f) for k, f in {
        ast.Sub: operator.sub, ast.Div: operator.truediv, ast.FloorDiv: operator.floordiv, ast.Mod: operator.mod
    }.items()},
}  # fmt: skip
UNARY: Mapping[type, Function] = {
    ast.USub: _of_numbers(operator.neg),
    ast.UAdd: _of_numbers(operator.pos),
    ast.Not: operator.not_,
}
COMPARE: Mapping[type, Callable[[object, object], bool]] = {
    ast.Eq: _is_equal,
    ast.NotEq: lambda a, b: not _is_equal(a, b),
    ast.Is: lambda a, b: a is b or (type(a) is type(b) and _is_equal(a, b)),
    ast.IsNot: lambda a, b: not (a is b or (type(a) is type(b) and _is_equal(a, b))),
    ast.In: _contains,
    ast.NotIn: lambda a, b: not _contains(a, b),
    ast.Lt: _compare_alike(operator.lt),
    ast.LtE: _compare_alike(operator.le),
    ast.Gt: _compare_alike(operator.gt),
    ast.GtE: _compare_alike(operator.ge),
}


def _entries(values: tuple[object, ...]) -> Sequence[object]:
    """Return what ``min`` and the like are called with: one list, or the values themselves."""
    if len(values) == 1 and isinstance(values[0], list | tuple):
        return values[0]
    return values


def _extreme(choose: Function) -> Function:
    def extreme(*values: object) -> object:
        """Return the smallest or the largest of some values."""
        entries = _entries(values)
        texts = len(entries) > 0 and all(isinstance(v, str) for v in entries)
        return choose(entries if texts else [_number(v) for v in entries])

    return extreme


def _round(value: object, digits: object = None) -> object:
    most_digits = 20  # to which a number can be rounded
    if digits is None:
        return round(_number(value))
    if not isinstance(digits, int) or abs(digits) > most_digits:
        raise XacroError(f"a number is rounded to at most {most_digits} digits")
    return round(_number(value), digits)


def _range(*bounds: object) -> object:
    whole = [b for b in bounds if isinstance(b, int)]
    if len(whole) < len(bounds):
        raise XacroError("range needs whole numbers")
    found = range(*whole)
    if len(found) > MOST_ENTRIES:
        raise XacroError(f"a list has more than {MOST_ENTRIES} entries")
    return list(found)


def _length(value: object) -> int:
    if isinstance(value, str | list | tuple | dict):
        return len(value)
    raise XacroError("a number has no length")


def _to_list(value: object = ()) -> list[object]:
    if isinstance(value, str | list | tuple | dict):
        return list(value)
    raise XacroError("a number is no list")


def _to_int(value: object) -> int:
    return int(value) if isinstance(value, str) else int(_number(value))


def _to_float(value: object) -> float:
    return float(value) if isinstance(value, str) else float(_number(value))


BUILTIN: Mapping[str, Function] = {
    "abs": _of_numbers(abs),
    "min": _extreme(min),
    "max": _extreme(max),
    "sum": lambda *v: math.fsum(_number(x) for x in _entries(v)),
    "round": _round,
    "int": _to_int,
    "float": _to_float,
    "bool": lambda value=False: bool(value),
    "str": lambda value="": to_text(value),
    "len": _length,
    "list": _to_list,
    "dict": lambda **entries: dict(entries),
    "range": _range,
}
MATH: Mapping[str, Function] = {
    name: _of_numbers(getattr(math, name))
    for name in (
        "acos", "acosh", "asin", "asinh", "atan", "atan2", "atanh", "ceil", "copysign", "cos", "cosh", "degrees", "exp",
        "fabs", "floor", "fmod", "hypot", "log", "log10", "log2", "pow", "radians", "sin", "sinh", "sqrt", "tan",
        "tanh", "trunc",
    )
}  # fmt: skip
CONSTANTS = {"pi": math.pi, "e": math.e, "tau": math.tau}


def _replace(text: str, old: object, new: object) -> str:
    a, b = to_text(old), to_text(new)
    if len(text) + (len(text) + 1) * len(b) > MOST_LETTERS * 10:
        raise XacroError(f"a text is longer than {MOST_LETTERS} letters")
    return text.replace(a, b)


def _join(text: str, parts: object) -> str:
    if not isinstance(parts, list | tuple):
        raise XacroError("join needs a list")
    words = [to_text(p) for p in parts]
    if sum(map(len, words)) + len(text) * len(words) > MOST_LETTERS:
        raise XacroError(f"a text is longer than {MOST_LETTERS} letters")
    return text.join(words)


TEXT_METHODS: Mapping[str, Function] = {
    **{name: getattr(str, name) for name in ("lower", "upper", "strip", "lstrip", "rstrip", "split", "rsplit")},
    **{name: getattr(str, name) for name in ("startswith", "endswith", "find", "count", "isdigit", "capitalize")},
    "replace": _replace,
    "join": _join,
}
TABLE_METHODS: Mapping[str, Function] = {
    "keys": lambda table: list(table.keys()),
    "values": lambda table: list(table.values()),
    "items": lambda table: [list(item) for item in table.items()],
    "get": lambda table, key, default=None: table.get(check_scalar(key), default),
}
