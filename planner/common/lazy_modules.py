"""Libraries that few commands need, imported when they are first used."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__all__ = ["LazyModule", "optimize", "pl", "psutil", "stats"]


class LazyModule:
    """A module that is imported with the first look at one of its names; its annotations must be strings."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, key: str) -> Any:
        self.__dict__[key] = found = getattr(import_module(self._name), key)  # the next look is an attribute's
        return found


if TYPE_CHECKING:
    import polars as pl
    import psutil
    from scipy import optimize, stats
else:
    pl, psutil = LazyModule("polars"), LazyModule("psutil")
    optimize, stats = LazyModule("scipy.optimize"), LazyModule("scipy.stats")  # they take most of a second
