"""Reads TOML and JSON files into pydantic models, and says which key is wrong in one clear sentence."""

from planner.schema.reading import Strict, read_json, read_toml, validate

__all__ = ["Strict", "read_json", "read_toml", "validate"]
