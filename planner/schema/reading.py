"""Reads a TOML or JSON file, and checks it against a pydantic model."""

import json
import tomllib
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from planner.errors import InputError
from planner.schema.telling import told


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
        InputError: with the first offending keys, what was found and what is allowed.
    """
    try:
        return model.model_validate(data)
    except ValidationError as err:
        raise InputError(f"{where}: {told(err, data, model, toml=not where.endswith('.json'))}") from err
