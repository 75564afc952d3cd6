"""Reads TOML and JSON files into pydantic models, and says which key is wrong in one clear sentence."""

import json
import re
import tomllib
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Annotated, ClassVar, TypeVar, cast, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    ValidationError,
    model_serializer,
)
from pydantic_core import ErrorDetails

from planner.common.errors import InputError, did_you_mean, is_printable_line
from planner.common.files import MOST_TOML, read_utf8

MOST = 1e6  # mm, degrees, mm/min, µm …: a kilometre; nothing that a file says of a cell is more
Coordinate = Annotated[float, Field(ge=-MOST, le=MOST)]
PositiveFloat = Annotated[float, Field(gt=0, le=MOST)]
NonNegativeFloat = Annotated[float, Field(ge=0, le=MOST)]
OneLine = Annotated[str, AfterValidator(lambda text: _check_line(text))]
HIDDEN = r"\x00-\x1f\x7f-\x9f\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff"  # steer, end lines, turn or join
PLAIN, SEEN = rf"^[^{HIDDEN}]*$", rf"^[^{HIDDEN}]*[^{HIDDEN}\s][^{HIDDEN}]*$"
_PLAINLY = BeforeValidator(lambda text: _check_plain(text))
Statement = Annotated[str, Field(max_length=200, pattern=PLAIN), _PLAINLY]
ReasonText = Annotated[str, Field(min_length=3, max_length=500, pattern=SEEN), _PLAINLY]
KeyPath = tuple[str | int, ...]
MOST_NAME = 200  # letters of a name
TABLE = "table"
NEEDED = {  # by pydantic's name of the fault
    **dict.fromkeys(("model_type", "model_attributes_type", "dict_type"), TABLE),
    **dict.fromkeys(("tuple_type", "list_type"), "list"),
    "string_type": "text in quotation marks",
    **dict.fromkeys(("int_type", "int_parsing", "int_from_float"), "whole number"),
    **dict.fromkeys(("float_type", "float_parsing"), "number"),
    "finite_number": "finite number",
    **dict.fromkeys(("bool_type", "bool_parsing"), "switch (true or false)"),
}


def _check_line(text: str) -> str:
    if len(text) > MOST_NAME or not is_printable_line(text):
        raise ValueError(f"a name on one line is needed, with at most {MOST_NAME} letters and no control signs")
    return text


def _check_plain(text: object) -> object:
    if isinstance(text, str) and not re.fullmatch(PLAIN, text):
        raise ValueError("one line of text is needed, without signs that cannot be seen")
    return text


def describe_faults(err: ValidationError, data: object, model: type[BaseModel], toml: bool) -> str:
    """Say in one sentence for each of the first faults which key is wrong, what was found and what is allowed.

    Args:
        err: of ``model`` on ``data``.
        data: what the file holds.
        model: what it should hold.
        toml: whether tables are to be called as TOML writes them, ``[[balls]] number 1``.
    """
    faults = dict[KeyPath, list[ErrorDetails]]()
    for e in err.errors():
        faults.setdefault(_key_path(data, e["loc"], e["type"] == "missing"), []).append(e)
    if ("schema",) in faults:  # a file of another kind: nothing else that it lacks matters
        said = _sentence(("schema",), faults["schema",], model, toml, data) + _expected_schema(faults["schema",], model)
        return said + _schema_hint(data, model)
    above = {path[:k] for path in faults for k in range(len(path))}
    deepest = [path for path in faults if path not in above]
    # 3: faults that one message tells
    return "; ".join(_sentence(path, faults[path], model, toml, data) for path in deepest[:3])


def _key_path(data: object, loc: Sequence[str | int], missing: bool) -> KeyPath:
    """Return the keys and numbers on the way to what is wrong, without pydantic's names of alternatives between."""
    out: list[str | int] = []
    for k, part in enumerate(loc):
        inside = isinstance(part, int) and part < len(data) if isinstance(data, list | tuple) else False
        if inside or (isinstance(data, dict) and part in data):
            data = data[part]  # type: ignore[index]
        elif not (missing and k == len(loc) - 1):
            continue
        out.append(part)
    return tuple(out)


def _number_in_file(data: object, path: KeyPath, found: object) -> object:
    """Return a number as the file has it: in memory it may be in another unit."""
    if isinstance(found, bool) or not isinstance(found, int | float):
        return found
    for part in path:
        try:
            data = data[part]  # type: ignore[index]
        except (KeyError, IndexError, TypeError):
            return found
    return data if isinstance(data, int | float) else found


def _sentence(path: KeyPath, faults: list[ErrorDetails], model: type[BaseModel], toml: bool, data: object) -> str:
    """Say one fault; ``faults``: of all alternatives, where the same key may be written in several ways."""
    kinds, found = [e["type"] for e in faults], _number_in_file(data, path, faults[0]["input"])
    place, key = _name_place(path, toml, isinstance(found, dict) and kinds[0] != "missing")
    if kinds[0] == "extra_forbidden":
        known = _keys_beside(model, path, data)
        return (
            f"{place}unknown key {key}{did_you_mean(str(path[-1]), known)} (allowed here: {', '.join(sorted(known))})"
        )
    if kinds[0] == "missing":
        return f"{place}the key {key} is missing" if isinstance(path[-1], str) else f"{place}{key} is missing"
    own = [e for e in faults if e["type"] not in NEEDED]
    if not own:
        needed = dict.fromkeys(f"a {NEEDED[kind]}" for kind in kinds)
        text = " or ".join(needed) if toml else " or ".join(needed).replace("a table", "an object { … }")
        return f"{place}{_state_value(key, found, toml)}{text} is needed"
    if isinstance(found, dict):
        return f"{place}{key}{': ' if key else ''}{_fault_message(own[0])}"
    return f"{place}{_state_value(key, found, toml)}{_fault_message(own[0])}"


def _fault_message(error: ErrorDetails) -> str:
    context = error.get("ctx", {})
    if error["type"] in ("too_short", "too_long"):
        many = context.get("min_length", context.get("max_length"))
        entries = f"{many} {'entry is' if many == 1 else 'entries are'}"
        return f"at least {entries} needed" if error["type"] == "too_short" else f"at most {entries} allowed"
    text = error["msg"].removeprefix("Value error, ").replace("Input should be", "must be")
    return text[0].lower() + text[1:]


def _state_value(key: str, found: object, toml: bool) -> str:
    shown_entries = 10  # of a list in a message
    text = ("a table" if toml else "an object") if isinstance(found, dict) else repr(found)
    if isinstance(found, list) and len(found) > shown_entries:
        text = f"{len(found)} entries"
    return f"{key} = {text}: " if key else f"{text}: "


def _name_place(path: KeyPath, toml: bool, table: bool) -> tuple[str, str]:
    """Return the place in lists, counted from 1, as ``"[[balls]] number 2: "``, and the key there, quoted.

    ``table``: whether there is a table at the end of the path.
    """
    place, start = "", 0
    for k in (k for k, part in enumerate(path) if isinstance(part, int)):
        name, last = ".".join(str(p) for p in path[start:k]), k == len(path) - 1
        inner = not last and isinstance(path[k + 1], str)
        called = f"[[{name}]]" if toml and (inner or (last and table)) else repr(name)
        place += f"{called if name else ','} number {int(path[k]) + 1}{': ' if inner else ''}"
        start = k + 1
    rest = ".".join(str(p) for p in path[start:])
    return (place, repr(rest)) if rest else ("", place)


def _expected_schema(faults: list[ErrorDetails], model: type[BaseModel]) -> str:
    """Name the schema that a file without one should have; of a wrong one it is said anyway."""
    if faults[0]["type"] != "missing":
        return ""
    allowed = [repr(a) for f in model.model_fields.values() if f.alias == "schema" for a in get_args(f.annotation)]
    return f" ({', '.join(allowed)} is expected)" if allowed else ""


def _schema_hint(data: object, model: type[BaseModel]) -> str:
    """Say whether a file is one of another kind, or of another version of the planner."""
    found = str(data.get("schema", "")) if isinstance(data, dict) else ""
    wanted = [str(a) for f in model.model_fields.values() if f.alias == "schema" for a in get_args(f.annotation)]
    if not wanted or not found.startswith("edbb-"):
        return ""
    is_a, needed = (name.removeprefix("edbb-").partition("/")[0] for name in (found, wanted[0]))
    if is_a == needed:
        return "; another version of the planner has written it: make it anew with this one"
    return f"; the file is of the kind '{is_a}', and one of the kind '{needed}' is needed here"


def _keys_beside(model: type[BaseModel], path: KeyPath, data: object) -> list[str]:
    """Return the keys allowed in the section of ``data`` that ``path`` points into."""
    here: type[BaseModel] | None = model
    for part in path[:-1]:
        data = data[part]  # type: ignore[index]
        if isinstance(part, int) or here is None:
            continue
        field = here.model_fields.get(part)
        inner = [] if field is None else _models_in(field.annotation)
        here = inner[0] if inner else here
    if here is not None and issubclass(here, StrictModel):
        return here.allowed_keys(data)
    return [] if here is None else [f.alias or name for name, f in here.model_fields.items()]


def _models_in(annotation: object) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [m for a in getattr(annotation, "__args__", ()) for m in _models_in(a)]


class PartialModel(BaseModel):
    """A part of a file: what is needed of it is checked, the rest is passed over."""

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)


def check_pattern(text: str) -> str:
    """Return ``text`` if it is a regular expression.

    Raises:
        ValueError: it is none.
    """
    try:
        re.compile(text)
    except (re.error, RecursionError, OverflowError) as err:
        raise ValueError(f"is no regular expression: {err}") from err
    return text


class StrictModel(BaseModel):
    """Base of every file section: unknown keys are errors, numbers are finite, values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @classmethod
    def allowed_keys(cls, data: object) -> list[str]:
        """Return the keys that the section may have, for messages; in some they depend on what ``data`` has."""
        return [f.alias or name for name, f in cls.model_fields.items()]


class OptionalKeys(StrictModel):
    """A section with keys that came later: they are written only where they are set, so that older cells stay alike."""

    LATER: ClassVar[tuple[str, ...]] = ()

    @model_serializer(mode="wrap")
    def _as_before(self, handler: SerializerFunctionWrapHandler) -> dict[str, object]:
        return self._set_keys(handler(self))

    def _set_keys(self, out: dict[str, object]) -> dict[str, object]:
        fields = type(self).model_fields
        names = {f.alias or name: name for name, f in fields.items()}  # of a key as it is written

        def is_set(key: str) -> bool:
            """Tell whether a file says the key."""
            name = names.get(key, key)
            return name not in self.LATER or getattr(self, name) != fields[name].default

        return {k: v for k, v in out.items() if is_set(k)}


SchemaModel = TypeVar("SchemaModel", bound=BaseModel)


def read_toml(path: Path, model: type[SchemaModel]) -> SchemaModel:
    """Read the TOML file at ``path`` into ``model``.

    Raises:
        InputError: the file is missing, is no TOML, or a key is unknown, missing or out of range.
    """
    return validate(read_toml_content(path), model, str(path))


def read_toml_again(path: Path, model: type[SchemaModel]) -> SchemaModel:
    """Read a TOML file that one command asks for many times: anew only where its text has changed."""
    return cast(SchemaModel, _read_text(path, model, read_utf8(path, MOST_TOML)))


@lru_cache(maxsize=100)
def _read_text(path: Path, model: type[BaseModel], _text: str) -> BaseModel:
    return read_toml(path, model)


def read_toml_content(path: Path) -> dict[str, object]:
    """Read the TOML file at ``path`` as it is.

    Raises:
        InputError: the file is missing or is no TOML.
    """
    content = _parse(path, "TOML", _load_toml)
    assert isinstance(content, dict)
    return content


_LONG_KEY = re.compile(r"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){16}""")


def _load_toml(text: str) -> dict[str, object]:
    """Read TOML of which no key has more parts than any file of ours: each part of a long one costs all before it."""
    if found := _LONG_KEY.search(text):
        line = text.count("\n", 0, found.start()) + 1
        raise ValueError(f"a key has more than 16 parts (at line {line}), no more than 8 are needed")
    return tomllib.loads(text)


def read_json(path: Path) -> object:
    """Read the JSON file at ``path``.

    Raises:
        InputError: the file is missing or is no JSON.
    """
    return _parse(path, "JSON", json.loads)


def _parse(path: Path, language: str, parse: Callable[[str], object]) -> object:
    try:
        return parse(read_utf8(path, MOST_TOML))
    except RecursionError as err:
        raise InputError(f"{path}: is nested too deeply for {language}") from err
    except ValueError as err:
        because = "it holds a whole number of thousands of digits" if "int_max_str_digits" in str(err) else str(err)
        raise InputError(f"{path}: is not valid {language}: {because}{_other_file_hint(path, language)}") from err


def _other_file_hint(path: Path, language: str) -> str:
    """Say what another file is likely to be that stands in the place of a cell, a robot or a plan."""
    text = read_utf8(path, MOST_TOML).strip()
    if not text:
        return "; the file is empty"
    if path.suffix.lower() != f".{language.lower()}":
        named = {".toml": "a cell or a robot", ".json": "a plan or an identification", ".csv": "a run"}
        is_a = named.get(path.suffix.lower(), "another file")
        return f"; a .{language.lower()} file is needed here, and '{path.name}' is called like {is_a}"
    cut_off = language == "JSON" and text.startswith("{") and not text.endswith("}")
    return "; its end is missing: copy it again, or make it anew" if cut_off else ""


def validate(data: object, model: type[SchemaModel], where: str) -> SchemaModel:
    """Check ``data`` against ``model``; ``where`` names the file in the message.

    Raises:
        InputError: with the first offending keys, what was found and what is allowed.
    """
    toml = not where.endswith(".json")
    try:
        made = model.model_validate(data)
    except ValidationError as err:
        raise InputError(f"{where}: {describe_faults(err, data, model, toml)}") from err
    if (path := _switch_as_number(data, made)) is not None:
        place, key = _name_place(path, toml, table=False)
        raise InputError(f"{where}: {place}{key} is a switch (true or false): a number is needed")
    return made


def _switch_as_number(data: object, made: object) -> KeyPath | None:
    """Return the way to the first switch of a file that was taken for a number."""
    if isinstance(data, bool):
        return () if type(made) in (int, float) else None
    parts: list[tuple[str | int, object, object]] = []
    if isinstance(data, dict) and isinstance(made, BaseModel):
        names = {f.alias or name: name for name, f in type(made).model_fields.items()}
        parts = [(key, value, getattr(made, names[key])) for key, value in data.items() if key in names]
    elif isinstance(data, dict) and isinstance(made, dict):
        parts = [(key, value, made.get(key)) for key, value in data.items()]
    elif isinstance(data, list) and set(map(type, data)) <= {float, str}:  # rows of a matrix: quick
        return None
    elif isinstance(data, list) and isinstance(made, list | tuple) and len(data) == len(made):
        parts = [(k, *pair) for k, pair in enumerate(zip(data, made, strict=True))]
    found = ((key, _switch_as_number(value, beside)) for key, value, beside in parts)
    return next(((key, *path) for key, path in found if path is not None), None)
