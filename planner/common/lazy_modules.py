"""Libraries that few commands need, imported when they are first used."""

from importlib import import_module
from typing import Any


class LazyModule:
    """A module that is imported with the first look at one of its names; its annotations must be strings."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, key: str) -> Any:
        return getattr(import_module(self._name), key)
