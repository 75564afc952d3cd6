"""Where a name of a RAPID file is known: a routine's own data hide the module's, which hide those of other modules."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import planner.programs.languages.statements as st

_MODULE = re.compile(r"(?<!END)\bMODULE\s+(\w+)", re.IGNORECASE)
_VALUELESS = re.compile(r"\b(?:VAR|PERS)\s+(?P<kind>\w+)\s+(?P<name>\w+)\s*(?:\{[^}]*\})?\s*$", re.IGNORECASE)
_PARAMETERS = re.compile(r"\b(?:VAR\s+|PERS\s+|INOUT\s+)?(\w+)\s+(\w+)\s*(?:\{[^}]*\})?\s*(?=[,)|\\])", re.IGNORECASE)


@dataclass(frozen=True)
class Placed:
    """A statement, and the module and the routine that it stands in, either of them empty."""

    statement: st.Statement
    module: str
    routine: str


def place(statements: Sequence[st.Statement]) -> Iterator[Placed]:
    """Yield the statements with their scopes."""
    module = routine = ""
    for statement in statements:
        if match := _MODULE.search(statement.text):
            module, routine = match[1].lower(), ""
        if isinstance(statement, st.Routine):
            routine = statement.name
        yield Placed(statement, module, routine)
        if isinstance(statement, st.RoutineEnd):
            routine = ""


class Names:
    """What the names of a file stand for: each declaration has a key of its own."""

    def __init__(self, placed: Sequence[Placed]) -> None:
        self._modules: list[str] = []
        self._keys: set[str] = set()
        for p in placed:
            if p.module not in self._modules:
                self._modules.append(p.module)
            self._keys.update(_key(p.module, p.routine, name) for name in _declared_names(p.statement))

    def own(self, p: Placed, name: str) -> str:
        """Return the key of ``name`` as it is declared in this statement."""
        return _key(p.module, p.routine, name)

    def resolve(self, p: Placed, name: str) -> str:
        """Return the key of ``name`` as it is used in this statement, or the bare name if the file does not have it."""
        name = name.lower()
        for key in (_key(p.module, p.routine, name), _key(p.module, "", name)):
            if key in self._keys:
                return key
        others = [key for module in self._modules if (key := _key(module, "", name)) in self._keys]
        return others[0] if len(others) == 1 else name


def _key(module: str, routine: str, name: str) -> str:
    return f"{module}.{routine}.{name.lower()}"


def _declared_names(statement: st.Statement) -> Iterator[str]:
    """Yield the names that a statement declares: data with or without a value, or parameters."""
    match statement:
        case st.Assignment(kind=kind, name=name) if kind:
            yield name
        case st.Routine(text=text):
            yield from (name for _, name in _PARAMETERS.findall(text.partition("(")[2]))
        case _ if match_ := _VALUELESS.search(statement.text):
            yield match_["name"]
