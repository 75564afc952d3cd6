"""Modules that not every system has, imported by the test that first uses one; without it the test is skipped."""

from importlib import import_module
from typing import Any

import pytest

__all__ = ["MODULES", "fcl", "nc_gcode_interpreter", "pin", "require_planning", "resource", "ruckig", "tty"]

MODULES = {
    "pinocchio", "coal", "fcl", "ompl", "ruckig", "nc_gcode_interpreter", "resource", "tty", "termios", "pty", "fcntl",
    "pwd", "msvcrt",
}  # fmt: skip
"""What no test may import at its head: the packages of planning, and modules of one system."""


class Module:
    """A module that is imported with the first look at a name of it."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, key: str) -> Any:
        try:
            return getattr(import_module(self._name), key)
        except ModuleNotFoundError:
            pytest.skip(f"{self._name} is not installed here, or not for this system", allow_module_level=True)


pin: Any = Module("pinocchio")
fcl: Any = Module("fcl")
ruckig: Any = Module("ruckig")
resource: Any = Module("resource")
tty: Any = Module("tty")
nc_gcode_interpreter: Any = Module("nc_gcode_interpreter")


def require_planning() -> None:
    """Skip where paths cannot be judged, for want of a package."""
    pin.Model, fcl.CollisionObject  # noqa: B018
