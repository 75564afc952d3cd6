"""Values of the expressions in a template: arithmetic, names, tables and a fixed list of functions, nothing else.

Python's own parser makes the tree, and only the kinds of nodes below are evaluated.
"""

import ast
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping

from planner.kinematics.xacro.values import (
    BINARY,
    BUILTIN,
    COMPARE,
    CONSTANTS,
    LETTERS_A_STEP,
    MATH,
    TABLE_METHODS,
    TEXT_METHODS,
    UNARY,
    Function,
    XacroError,
    check_scalar,
    check_value,
    to_text,
)


class Names(ABC):
    """Where the names of an expression are looked up; a namespace of a template is one too."""

    @abstractmethod
    def find(self, name: str) -> object:
        """Return the value of a name.

        Raises:
            KeyError: there is none.
        """


class Evaluator:
    """Evaluates expressions.

    Args:
        functions: beside those above, by their whole names such as ``xacro.load_yaml``.
        spend: told the work of every value, so that the whole is bounded.
    """

    def __init__(self, functions: Mapping[str, Function], spend: Callable[[int], None]) -> None:
        self._spend = spend
        self._functions = {
            **BUILTIN,
            **MATH,
            **{f"python.{name}": f for name, f in BUILTIN.items()},
            **{f"math.{name}": f for name, f in MATH.items()},
            **functions,
        }

    def evaluate(self, text: str, names: Names) -> object:
        """Return the value of an expression; ``names`` go before constants.

        Raises:
            XacroError: it is none, holds what is not evaluated here, or has no value.
        """
        most_shown = 100  # letters of an expression in a message
        most_letters = 2000  # of one expression
        shown = text if len(text) <= most_shown else f"{text[:most_shown]}…"
        if len(text) > most_letters:
            raise XacroError(f"the expression '{shown}' is longer than {most_letters} letters")
        try:
            return _Evaluation(self._functions, names, self._spend).value(ast.parse(text.strip(), mode="eval").body)
        except KeyError as err:
            raise XacroError(f"in the expression '{shown}': there is no {err}") from err
        except (XacroError, ArithmeticError, TypeError, ValueError, IndexError, SyntaxError) as err:
            raise XacroError(f"in the expression '{shown}': {err}") from err
        except (RecursionError, MemoryError) as err:
            raise XacroError(f"the expression '{shown}' is nested too deeply") from err


class _Evaluation:
    """One expression with the names that hold where it stands."""

    def __init__(self, functions: Mapping[str, Function], names: Names, spend: Callable[[int], None]) -> None:
        self._functions, self._names, self._spend = functions, names, spend

    def value(self, node: ast.expr) -> object:
        """Return the value of a node of the expression."""
        value = check_value(self._raw_value(node))
        self._spend(1 + _size_of(value))
        return value

    def _raw_value(self, node: ast.expr) -> object:
        if isinstance(node, ast.Constant):
            return node.value
        found = self._KINDS.get(type(node))
        if found is None:
            raise _evaluation_error(node)
        return found(self, node)

    def _operation(self, node: ast.UnaryOp | ast.BinOp) -> object:
        if isinstance(node, ast.UnaryOp):
            parts, table = [node.operand], UNARY
        else:
            parts, table = [node.left, node.right], BINARY
        if type(node.op) not in table:
            raise _evaluation_error(node)
        return table[type(node.op)](*(self.value(p) for p in parts))

    def _choice(self, node: ast.IfExp) -> object:
        return self.value(node.body if self.value(node.test) else node.orelse)

    def _list(self, node: ast.List | ast.Tuple) -> object:
        return [self.value(entry) for entry in node.elts]

    def _name(self, node: ast.Name) -> object:
        name = node.id
        try:
            return self._names.find(name)
        except KeyError:
            if name in CONSTANTS:
                return CONSTANTS[name]
            raise XacroError(f"the name '{name}' is not known") from None

    def _any_or_all(self, node: ast.BoolOp) -> object:
        value: object = None
        for part in node.values:
            value = self.value(part)
            if bool(value) is isinstance(node.op, ast.Or):
                break
        return value

    def _compare(self, node: ast.Compare) -> bool:
        left = self.value(node.left)
        for op, part in zip(node.ops, node.comparators, strict=True):
            right = self.value(part)
            if not COMPARE[type(op)](left, right):
                return False
            left = right
        return True

    def _entry(self, node: ast.Subscript) -> object:
        value = self.value(node.value)
        if isinstance(node.slice, ast.Slice):
            return self._part(value, node.slice)
        key = self.value(node.slice)
        if isinstance(value, dict):
            return value[check_scalar(key)]
        if isinstance(value, str | list | tuple) and isinstance(key, int):
            return value[key]
        raise XacroError(f"{to_text(key)!r} is no place in it")

    def _part(self, value: object, place: ast.Slice) -> object:
        if place.step is not None or not isinstance(value, str | list | tuple):
            raise XacroError("only texts and lists have parts from one place to another")
        ends = [None if p is None else self.value(p) for p in (place.lower, place.upper)]
        whole = [p for p in ends if p is None or isinstance(p, int)]
        if len(whole) < len(ends):
            raise XacroError("places in a list are whole numbers")
        return value[whole[0] : whole[1]]

    def _attribute(self, node: ast.Attribute) -> object:
        if isinstance(node.value, ast.Name):
            if node.value.id == "math" and node.attr in CONSTANTS:
                return CONSTANTS[node.attr]
            try:
                found = self._names.find(node.value.id)
            except KeyError:
                raise XacroError(f"the name '{node.value.id}' is not known") from None
            if isinstance(found, Names):
                return found.find(node.attr)
        value = self.value(node.value)
        if isinstance(value, dict):
            return value[node.attr]
        raise XacroError(f"'.{node.attr}' is no entry of a table")

    def _call(self, node: ast.Call) -> object:
        if any(isinstance(a, ast.Starred) for a in node.args) or any(k.arg is None for k in node.keywords):
            raise XacroError("a list of arguments by * is not evaluated")
        arguments = [self.value(a) for a in node.args]
        named = {str(k.arg): self.value(k.value) for k in node.keywords}
        called = ast.unparse(node.func)
        if called in self._functions:
            return self._functions[called](*arguments, **named)
        if isinstance(node.func, ast.Attribute):
            value = self.value(node.func.value)
            methods = TEXT_METHODS if isinstance(value, str) else TABLE_METHODS if isinstance(value, dict) else {}
            if node.func.attr in methods and not named:
                return methods[node.func.attr](value, *arguments)
        raise XacroError(f"the function '{called[:60]}' is not among those that are evaluated")

    _KINDS: Mapping[type, Callable[..., object]] = {
        ast.Name: _name,
        ast.UnaryOp: _operation,
        ast.BinOp: _operation,
        ast.BoolOp: _any_or_all,
        ast.Compare: _compare,
        ast.IfExp: _choice,
        ast.List: _list,
        ast.Tuple: _list,
        ast.Subscript: _entry,
        ast.Attribute: _attribute,
        ast.Call: _call,
    }


def _size_of(value: object) -> int:
    """Return the steps of work that are about what a value took."""
    if isinstance(value, str):
        return len(value) // LETTERS_A_STEP
    return len(value) // 4 if isinstance(value, list | tuple) else 0  # entries of a list are worth a step of work


def _evaluation_error(node: ast.expr) -> XacroError:
    return XacroError(f"'{ast.unparse(node)[:60]}' is not evaluated: only arithmetic, names and known functions are")
