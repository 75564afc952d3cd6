"""The URDF that a template makes with its own default arguments (the language: wiki.ros.org/xacro).

Elements are copied in order from the template to the URDF; those of the template's own language act instead. Nothing
that stands in the template is run: see :mod:`planner.kinematics.xacro.expressions`.
"""

import re
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping
from pathlib import Path

from planner.common.errors import InputError
from planner.common.files import INPUTS
from planner.kinematics.packages import Packages
from planner.kinematics.xacro.expressions import Evaluator, Names
from planner.kinematics.xacro.scope import (
    Macro,
    Parameter,
    Scope,
    Unevaluated,
    check_name,
    read_literal,
    read_parameters,
    read_switch,
)
from planner.kinematics.xacro.template_files import TemplateFiles
from planner.kinematics.xacro.values import LETTERS_A_STEP, XacroError, to_text

ELEMENT_STEPS = 10  # of work for each element and each attribute that is written
PREFIX = "xacro:"
DOLLARS = re.compile(r"\$+")
TOLD = ("xacro.message", "xacro.warning", "xacro.error", "xacro.print_location")


def expand_template(path: Path, packages: Packages) -> bytes:
    """Return the URDF that the template at ``path`` makes.

    Raises:
        InputError: the template is wrong, asks for a file outside its folder and the named packages, for the
            environment, for a function that is none of arithmetic, or for more work than a robot needs.
    """
    expander = _Expander(path, packages)
    try:
        root = expander.expand()
        return bytes(ET.tostring(root, encoding="utf-8"))
    except (XacroError, RecursionError) as err:
        reason = "it is nested too deeply" if isinstance(err, RecursionError) else err
        raise InputError(f"{path}: cannot be expanded: {reason} (at {expander.place})") from err
    except InputError as err:
        raise InputError(f"{path}: cannot be expanded: {err} (at {expander.place})") from err


class _Arguments(Names):
    """The names of an expression ``$(eval …)``: the template's arguments."""

    def __init__(self, arguments: Mapping[str, str]) -> None:
        self._arguments = arguments

    def find(self, name: str) -> object:
        """Return an argument, as the number that it may be."""
        return read_literal(name if name in ("true", "false") else self._arguments[name])


class _Expander:
    """The state of one expansion: arguments, files that are open, and the work that is left."""

    def __init__(self, path: Path, packages: Packages) -> None:
        self._path, self._packages = path.resolve(), packages
        self._files = TemplateFiles(path, packages, lambda letters: self._spend(letters // LETTERS_A_STEP))
        self._open = [self._path]
        self._arguments: dict[str, str] = {}
        self._left, self._level = 2_000_000, 0  # steps of work, a few seconds; ur_description takes 16 000 for an arm
        self._element: ET.Element | None = None
        self._evaluator = Evaluator(self._functions(), self._spend)

    @property
    def place(self) -> str:
        """Where the work is: file and element."""
        element = self._element
        name = "" if element is None else "".join(f" {k}='{v[:40]}'" for k, v in list(element.attrib.items())[:1])
        return f"{self._open[-1].name}{'' if element is None else f', <{element.tag[:60]}{name}>'}"

    def expand(self) -> ET.Element:
        """Return the root of the URDF; its own attributes are evaluated last, for they may name arguments."""
        source, scope = self._files.document(self._path), Scope(self._evaluate)
        target = ET.Element(source.tag)
        self._fill(source, target, scope)
        self._copy_attributes(source, target, scope)
        return target

    def _spend(self, steps: int) -> None:
        self._left -= steps
        if self._left < 0:
            raise XacroError(
                "it asks for more work than any robot needs: a macro, file or list that grows without end?"
            )

    # -- elements

    def _fill(self, source: ET.Element, target: ET.Element, scope: Scope) -> None:
        """Write what the content of ``source`` makes into ``target``."""
        most_levels = 60  # of macros, files and elements in one another; robots have about ten
        self._level += 1
        if self._level > most_levels:
            raise XacroError(f"more than {most_levels} macros, files and elements stand in one another")
        self._write_text(source.text, target, scope)
        for element in source:
            self._write(element, target, scope)
            self._write_text(element.tail, target, scope)
        self._level -= 1

    def _write_text(self, text: str | None, target: ET.Element, scope: Scope) -> None:
        if not text:
            return
        written = to_text(self._evaluate(text, scope))
        before = (target[-1].tail if len(target) else target.text) or ""
        self._spend(len(before) // 1000)  # letters that are copied, each time, while a step of work is done
        if len(target):
            target[-1].tail = before + written
        else:
            target.text = before + written

    def _write(self, element: ET.Element, target: ET.Element, scope: Scope) -> None:
        self._element = element
        self._spend(ELEMENT_STEPS)
        if not element.tag.startswith(PREFIX):
            copy = ET.SubElement(target, element.tag)
            self._copy_attributes(element, copy, scope)
            self._fill(element, copy, scope)
            return
        act = self._ACTS.get(element.tag.removeprefix(PREFIX))
        if act is None:
            self._call(element, element.tag.removeprefix(PREFIX), element.attrib, target, scope)
        else:
            act(self, element, target, scope)

    def _copy_attributes(self, element: ET.Element, copy: ET.Element, scope: Scope) -> None:
        for name, text in element.attrib.items():
            if not name.startswith((PREFIX, "xmlns:xacro")):
                self._spend(ELEMENT_STEPS)
                copy.set(name, to_text(self._evaluate(text, scope)))

    def _include(self, element: ET.Element, target: ET.Element, scope: Scope) -> None:
        path = self._files.find(self._attribute(element, "filename", scope), self._open[-1].parent)
        inside = scope
        if (space := element.get("ns")) is not None:
            inside = scope.nest(is_namespace=True)
            scope.values[check_name(to_text(self._evaluate(space, scope)))] = inside
        if element.get("optional") == "true" and not (INPUTS.allows(path) and path.is_file()):
            return
        document = self._files.document(path)
        self._open.append(path)
        self._fill(document, target, inside)
        self._open.pop()

    def _property(self, element: ET.Element, _: ET.Element, scope: Scope) -> None:
        name = check_name(self._attribute(element, "name", scope))
        given = [key for key in ("value", "default", "remove") if element.get(key) is not None]
        if len(given) > 1:
            raise XacroError(f"the property '{name}' has {' and '.join(given)}: one of them is needed")
        if self._switch(element, "remove", "false", scope):
            scope.remove(name)
            return
        text = element.get("value", element.get("default"))
        if element.get("default") is not None and name in scope:
            return
        place = scope.enclosing(str(element.get("scope"))) if element.get("scope") in ("parent", "global") else scope
        if place is None:
            return
        if text is None:
            place.values[f"**{name}"] = element
        elif place is scope and self._switch(element, "lazy_eval", "true", scope):
            literal = read_literal(text)
            place.values[name] = Unevaluated(literal) if isinstance(literal, str) else literal
        else:
            place.values[name] = read_literal(self._evaluate(text, scope))

    def _macro(self, element: ET.Element, _: ET.Element, scope: Scope) -> None:
        name = str(element.get("name")).removeprefix(PREFIX)
        if name in self._ACTS or "." in name:
            raise XacroError(f"'{name[:60]}' is no name of a macro")
        scope.macros[name] = Macro(read_parameters(element.get("params", "")), element)

    def _argument(self, element: ET.Element, _: ET.Element, scope: Scope) -> None:
        name, default = str(element.get("name")), element.get("default")
        if name not in self._arguments and default is not None:
            self._arguments[name] = to_text(self._evaluate(default, scope))

    def _if(self, element: ET.Element, target: ET.Element, scope: Scope) -> None:
        if self._switch(element, "value", None, scope) == (element.tag == f"{PREFIX}if"):
            self._fill(element, target, scope)

    def _insert_block(self, element: ET.Element, target: ET.Element, scope: Scope) -> None:
        name = self._attribute(element, "name", scope)
        for stars in ("**", "*"):
            if stars + name in scope:
                block = scope.find(stars + name)
                assert isinstance(block, ET.Element)  # nothing else has a name with stars
                (self._fill if stars == "**" else self._write)(block, target, scope)
                return
        raise XacroError(f"there is no block '{name}'")

    def _make_element(self, element: ET.Element, target: ET.Element, scope: Scope) -> None:
        made = ET.Element(self._attribute(element, f"{PREFIX}name", scope))
        if not re.fullmatch(r"[A-Za-z_][\w.:-]*", made.tag):
            raise XacroError(f"'{made.tag[:60]}' is no name of an element")
        made.attrib = {k: v for k, v in element.attrib.items() if k != f"{PREFIX}name"}
        made.text = element.text
        made.extend(element)
        self._write(made, target, scope)

    def _make_attribute(self, element: ET.Element, target: ET.Element, scope: Scope) -> None:
        name, value = (self._attribute(element, key, scope) for key in ("name", "value"))
        if not re.fullmatch(r"[A-Za-z_][\w.:-]*", name):
            raise XacroError(f"'{name[:60]}' is no name of an attribute")
        target.set(name, value)

    def _dynamic_call(self, element: ET.Element, target: ET.Element, scope: Scope) -> None:
        given = {k: v for k, v in element.attrib.items() if k != "macro"}
        self._call(element, self._attribute(element, "macro", scope), given, target, scope)

    _ACTS: Mapping[str, Callable[["_Expander", ET.Element, ET.Element, Scope], None]] = {
        "include": _include,
        "property": _property,
        "macro": _macro,
        "arg": _argument,
        "if": _if,
        "unless": _if,
        "insert_block": _insert_block,
        "element": _make_element,
        "attribute": _make_attribute,
        "call": _dynamic_call,
    }

    # -- macros

    def _call(self, element: ET.Element, name: str, given: Mapping[str, str], target: ET.Element, scope: Scope) -> None:
        found = scope.find_macro(name)
        if found is None:
            raise XacroError(f"there is no macro '{name[:60]}'")
        macro, seen = found
        inside, known = seen.nest(), {p.name: p for p in macro.parameters}
        for key, text in given.items():
            if key.startswith("xmlns:"):
                continue
            if key not in known:
                raise XacroError(f"the macro '{name}' has no parameter '{key[:60]}' ({', '.join(known)})")
            inside.values[key] = read_literal(self._evaluate(text, scope))
        blocks = ET.Element("blocks")
        self._fill(element, blocks, scope)
        self._element, waiting = element, list(blocks)
        for parameter in macro.parameters:
            if parameter.name.startswith("*"):
                if not waiting:
                    raise XacroError(f"the macro '{name}' needs a block for '{parameter.name}'")
                inside.values[parameter.name] = waiting.pop(0)
            elif parameter.name not in inside.values:
                inside.values[parameter.name] = self._default(name, parameter, scope)
        if waiting:
            raise XacroError(f"the macro '{name}' has no parameter for the block <{waiting[0].tag[:60]}>")
        self._fill(macro.body, target, inside)

    def _default(self, macro: str, parameter: Parameter, scope: Scope) -> object:
        if parameter.forwards and parameter.name in scope:
            return scope.find(parameter.name)
        if parameter.default is None:
            raise XacroError(f"the macro '{macro}' needs '{parameter.name[:60]}'")
        return read_literal(self._evaluate(parameter.default, scope))

    # -- texts

    def _attribute(self, element: ET.Element, key: str, scope: Scope) -> str:
        text = element.get(key)
        if not text:
            raise XacroError(f"<{element.tag}> has no {key}")
        return to_text(self._evaluate(text, scope))

    def _switch(self, element: ET.Element, key: str, default: str | None, scope: Scope) -> bool:
        text = element.get(key, default)
        if text is None:
            raise XacroError(f"<{element.tag}> has no {key}")
        return read_switch(self._evaluate(text, scope), text)

    def _evaluate(self, text: str, scope: Scope) -> object:
        """Return a text with the values of its expressions ``${…}`` and ``$(…)``; the value itself where it is one."""
        self._spend(1 + len(text) // LETTERS_A_STEP)
        parts, start = list[object](), 0
        while (at := text.find("$", start)) >= 0:
            self._spend(1)
            run = DOLLARS.match(text, at)
            opening = run.end() if run else at
            bracket = text[opening : opening + 1]
            parts += [text[start:at]] if at > start else []
            if bracket not in ("{", "("):
                parts.append(text[at:opening])
                start = opening
            elif opening > at + 1:  # two of them stand for one that means nothing
                parts.append(text[at + 1 : opening + 1])
                start = opening + 1
            else:
                end = text.find("}" if bracket == "{" else ")", opening)
                if end < 0:
                    raise XacroError(f"'{text[at : at + 60]}' is never closed")
                inside = to_text(self._evaluate(text[opening + 1 : end], scope))
                parts.append(self._evaluator.evaluate(inside, scope) if bracket == "{" else self._substitute(inside))
                start = end + 1
        parts += [text[start:]] if start < len(text) else []
        return parts[0] if len(parts) == 1 else "".join(map(to_text, parts))

    def _substitute(self, text: str) -> str:
        """Return the value of ``$(text)``."""
        word, _, rest = text.strip().partition(" ")
        rest = rest.strip()
        if word == "arg":
            return self._find_argument(rest)
        if word == "find":
            return str(self._packages.find(rest))
        if word == "dirname":
            return str(self._open[-1].parent)
        if word == "eval":
            return to_text(self._evaluator.evaluate(rest, _Arguments(self._arguments)))
        if word in ("env", "optenv"):
            raise XacroError(f"'$({text[:60]})' asks for the environment, which is not read: write the value out")
        raise XacroError(f"'$({text[:60]})' is none of $(find …), $(arg …), $(eval …) and $(dirname)")

    def _find_argument(self, name: object) -> str:
        if name not in self._arguments:
            raise XacroError(f"the argument '{to_text(name)[:60]}' has no default: <xacro:arg name=… default=…>")
        return self._arguments[to_text(name)]

    # -- functions of expressions

    def _functions(self) -> dict[str, Callable[..., object]]:
        return {
            "load_yaml": self._load_yaml,
            "xacro.load_yaml": self._load_yaml,
            "xacro.arg": self._find_argument,
            "arg": lambda name: read_literal(self._find_argument(name)),
            "xacro.dotify": lambda table: table,
            "xacro.tokenize": _tokenize,
            "xacro.fatal": _fail,
            **dict.fromkeys(TOLD, lambda *_: ""),
        }

    def _load_yaml(self, name: object) -> object:
        path = self._files.find(to_text(name), self._open[-1].parent)
        return self._files.table(path, lambda text: self._evaluator.evaluate(text, _Arguments({})))


def _tokenize(text: object, signs: object = ",; ", skip_empty: object = True) -> list[str]:
    words = re.split(f"[{re.escape(to_text(signs))}]", to_text(text))
    return [word for word in words if word or not skip_empty]


def _fail(*words: object) -> object:
    raise XacroError(" ".join(map(to_text, words)))
