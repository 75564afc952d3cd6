"""Names of a template at one place: properties, macros, blocks and namespaces, each hiding those further out."""

import keyword
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Self

from planner.kinematics.xacro.expressions import Names
from planner.kinematics.xacro.values import XacroError


@dataclass(frozen=True)
class Parameter:
    """A parameter of a macro: ``name``, ``*name`` for a block or ``**name`` for the content of one.

    ``default`` is evaluated where the macro is called; ``forwards`` takes the caller's property of that name first.
    """

    name: str
    default: str | None = None
    forwards: bool = False


@dataclass(frozen=True)
class Macro:
    """A macro: its parameters and the element whose content is its body."""

    parameters: tuple[Parameter, ...]
    body: ET.Element


@dataclass(frozen=True)
class Unevaluated:
    """A property whose text is evaluated when it is first used."""

    text: str


@dataclass
class Scope(Names):
    """The names at one place.

    Attributes:
        evaluate: evaluates a text with the names of a scope.
        parent: the place around.
        is_namespace: whether an include with a name has made it.
    """

    evaluate: Callable[[str, "Scope"], object]
    parent: Self | None = None
    is_namespace: bool = False
    values: dict[str, object] = field(default_factory=dict)
    macros: dict[str, Macro] = field(default_factory=dict)

    def nest(self, is_namespace: bool = False) -> "Scope":
        """Return a place within."""
        return Scope(self.evaluate, self, is_namespace)

    def _holder(self, name: str) -> "Scope | None":
        place: Scope | None = self
        while place is not None and name not in place.values:
            place = place.parent
        return place

    def __contains__(self, name: str) -> bool:
        """Tell whether a name is known here."""
        return self._holder(name) is not None

    def find(self, name: str) -> object:
        """Return the value of a name; a property is evaluated where it stands.

        Raises:
            KeyError: there is none.
            XacroError: it is defined by itself.
        """
        place = self._holder(name)
        if place is None:
            raise KeyError(name)
        value = place.values[name]
        if isinstance(value, Unevaluated):
            place.values[name] = _BEING_EVALUATED
            value = place.values[name] = read_literal(self.evaluate(value.text, place))
        if value is _BEING_EVALUATED:
            raise XacroError(f"the property '{name}' is defined by itself")
        return value

    def find_macro(self, name: str) -> "tuple[Macro, Scope] | None":
        """Return a macro, perhaps one of a namespace (``arm.link``), and the place whose names it sees."""
        place: Scope | None = self
        while place is not None:
            if name in place.macros:
                return place.macros[name], self
            place = place.parent
        first, _, rest = name.partition(".")
        try:
            space = self.find(first) if rest else None
        except KeyError:
            return None
        return space.find_macro(rest) if isinstance(space, Scope) else None

    def remove(self, name: str) -> None:
        """Remove a name from this scope and from all that enclose it."""
        while (place := self._holder(name)) is not None:
            del place.values[name]

    def enclosing(self, which: str) -> "Scope | None":
        """Return the place that ``scope = "parent"`` or ``"global"`` means."""
        place: Scope | None = self
        if which == "global":
            while place is not None and place.parent is not None:
                place = place.parent
            return place
        place = self.parent
        while place is not None and place.is_namespace and not self.is_namespace:
            place = place.parent
        return place


_BEING_EVALUATED = object()


def check_name(name: str) -> str:
    """Return the name of a property.

    Raises:
        XacroError: an expression could not use it.
    """
    if not name.isidentifier() or keyword.iskeyword(name) or name.startswith("__"):
        raise XacroError(f"'{name[:60]}' is no name of a property (letters, digits and _)")
    return name


def read_literal(value: object) -> object:
    """Return the number or truth value that a text is, or what stands in its quotation marks, or itself."""
    if not isinstance(value, str):
        return value
    if len(value) > 1 and value[0] == value[-1] == "'":
        return value[1:-1]
    if value in ("true", "True", "false", "False"):
        return value.lower() == "true"
    if "_" in value or len(value) > 40:  # letters of a number
        return value
    for read in (int, float):
        try:
            number = read(value)
        except ValueError:
            continue
        return number if abs(number) < float("inf") else value
    return value


def read_switch(value: object, text: str) -> bool:
    """Return whether a condition holds.

    Raises:
        XacroError: its value is neither a number nor a truth value.
    """
    found = read_literal(value)
    if isinstance(found, str):
        raise XacroError(f"the condition '{text[:60]}' is '{found[:60]}', neither true nor false")
    return bool(found)


def read_parameters(text: str) -> tuple[Parameter, ...]:
    """Return the parameters that a macro's ``params`` lists: ``a b:=2 c:='two words' d:=^|3 *block **content``."""
    most_letters = 20_000  # of the parameters of a macro
    if len(text) > most_letters:
        raise XacroError(f"the parameters '{text[:60]}…' are longer than {most_letters} letters")
    out = []
    for word in _split_words(text):
        name, equals, default = word.partition("=")
        forwards = default.startswith("^")
        default = default[1:].removeprefix("|") if forwards else default
        stated = default if equals and (default or not forwards) else None
        out.append(Parameter(name.removesuffix(":"), stated, forwards))
    return tuple(out)


CLOSING = {"'": "'", '"': '"', "${": "}", "$(": ")"}


def _split_words(text: str) -> list[str]:
    """Split at white space outside of quotation marks and expressions, but not beside the sign before a default."""
    words, word, k = list[str](), "", 0
    while k < len(text):
        if text[k].isspace():
            k += len(text[k:]) - len(text[k:].lstrip())
            if word and not word.endswith("=") and not text[k:].startswith((":=", "=")):
                words, word = [*words, word], ""
            continue
        opening = text[k] if text[k] in CLOSING else text[k : k + 2]
        end = text.find(CLOSING[opening], k + len(opening)) if opening in CLOSING else k
        if end < 0:
            raise XacroError(f"the parameters '{text[:60]}' leave {opening} open")
        word, k = word + text[k : end + 1], end + 1
    return [*words, word] if word else words
