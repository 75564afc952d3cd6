"""Reads a TOML file into a pydantic model, and says which key is wrong in one clear sentence."""

import json
import tomllib
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from planner.errors import InputError, nearest


class Strict(BaseModel):
    """Base of every file section: unknown keys are errors, numbers are finite, values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


M = TypeVar("M", bound=BaseModel)


def read_toml(path: Path, model: type[M]) -> M:
    """Read the TOML file at ``path`` into ``model``.

    Raises:
        InputError: the file is missing, is no TOML, or a key is unknown, missing or out of range.
    """
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as err:
        raise InputError(f"{path}: cannot be read ({err.strerror or err})") from err
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as err:
        raise InputError(f"{path}: is not valid TOML: {err}") from err
    return validate(data, model, str(path))


def read_json(path: Path) -> object:
    """Read the JSON file at ``path``.

    Raises:
        InputError: the file is missing or is no JSON.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as err:
        raise InputError(f"{path}: cannot be read ({err.strerror or err})") from err
    except ValueError as err:
        raise InputError(f"{path}: is not valid JSON: {err}") from err


def validate(data: object, model: type[M], where: str) -> M:
    """Check ``data`` against ``model``; ``where`` names the file in the message.

    Raises:
        InputError: with the first offending key, what was found and what is allowed.
    """
    try:
        return model.model_validate(data)
    except ValidationError as err:
        raise InputError(f"{where}: " + "; ".join(_sentence(e, model) for e in err.errors()[:3])) from err


def _sentence(error: object, model: type[BaseModel]) -> str:
    loc, kind, message = (error[k] for k in ("loc", "type", "msg"))  # type: ignore[index]
    key = ".".join(str(part) for part in loc)
    if kind == "extra_forbidden":
        known = _keys_beside(model, loc)
        return f"unknown key '{key}'{nearest(str(loc[-1]), known)} (allowed here: {', '.join(sorted(known))})"
    if kind == "missing":
        return f"the key '{key}' is missing"
    found = error["input"]  # type: ignore[index]
    found_text = repr(found) if not isinstance(found, dict) else "a table"
    return f"'{key}' = {found_text}: {message[0].lower() + message[1:]}".replace("value error, ", "")


def _keys_beside(model: type[BaseModel], loc: tuple[str | int, ...]) -> list[str]:
    """Return the keys allowed in the section that ``loc`` points into."""
    here: type[BaseModel] | None = model
    for part in loc[:-1]:
        if isinstance(part, int) or here is None:
            continue
        field = here.model_fields.get(part)
        inner = [] if field is None else _models_in(field.annotation)
        here = inner[0] if inner else here
    return [] if here is None else [f.alias or name for name, f in here.model_fields.items()]


def _models_in(annotation: object) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [m for a in getattr(annotation, "__args__", ()) for m in _models_in(a)]
