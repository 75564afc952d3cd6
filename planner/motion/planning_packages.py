"""The compiled packages that planning alone needs, each imported when it is first used; nobody else names them.

They have no wheels for every system (docs/install.md). Whoever does not plan never gets here, so that a run is
identified, a program corrected and a page written on the computer beside the robot, whatever that is.
"""

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from planner.common.advice import Occasion, advice
from planner.common.errors import MissingProgramError
from planner.common.lazy_modules import LazyModule

__all__ = [
    "can_plan",
    "coal",
    "fcl",
    "has_judges",
    "is_installed",
    "ob",
    "og",
    "ou",
    "pin",
    "require_planning_packages",
    "ruckig",
]

DISTRIBUTIONS = {"pinocchio": "pin", "coal": "coal", "fcl": "python-fcl", "ompl": "ompl", "ruckig": "ruckig"}
"""Names to import: names to install."""
JUDGES = ("pinocchio", "coal", "fcl")  # the two collision engines, the first with the model that it moves
ELSEWHERE = (
    "plan on a computer that has all of them (Linux, macOS, WSL on Windows, or the container; docs/install.md) and "
    "bring its folder here"
)


class PlanningPackage(LazyModule):
    """A package of planning; who uses it where it is not installed is told in one sentence what to do.

    Raises:
        MissingProgramError: with the first look at a name of it, where it is not installed.
        ImportError: it is there and cannot be loaded, for want of memory for instance.
    """

    def __getattr__(self, key: str) -> Any:
        try:
            module = import_module(self._name)
        except ImportError as err:
            if is_installed(self._name.partition(".")[0]):
                raise
            raise _missing(_absent_packages()) from err
        self.__dict__[key] = found = getattr(module, key)
        return found


def has_judges() -> bool:
    """Tell whether a drive can be judged here: both collision engines are installed; none is imported."""
    return all(map(is_installed, JUDGES))


def can_plan() -> bool:
    """Tell whether planning is possible here: OMPL finds the ways, and without a judge no path is proven."""
    return has_judges() and is_installed("ompl")


def is_installed(name: str) -> bool:
    """Tell whether a package can be imported; it is not."""
    try:
        return find_spec(name) is not None
    except ImportError:
        return False


def require_planning_packages() -> None:
    """Refuse to begin what cannot be ended here.

    Where ruckig is missing its profile is written down in closed form.

    Raises:
        MissingProgramError: one of them is not installed; which, and where planning is possible.
    """
    if not can_plan():
        raise _missing(_absent_packages())


def _absent_packages() -> list[str]:
    return [name for name in DISTRIBUTIONS if not is_installed(name)]


def _missing(absent: list[str]) -> MissingProgramError:
    names = ", ".join(DISTRIBUTIONS[name] for name in absent)
    server = advice(Occasion.PLANNING_ELSEWHERE)
    are = "packages {}, which are" if len(absent) > 1 else "package {}, which is"
    return MissingProgramError(f"planning needs the Python {are.format(names)} not installed here: {ELSEWHERE}{server}")


if TYPE_CHECKING:
    import coal
    import fcl
    import pinocchio as pin
    import ruckig
    from ompl import base as ob
    from ompl import geometric as og
    from ompl import util as ou
else:
    coal, fcl, ruckig = PlanningPackage("coal"), PlanningPackage("fcl"), PlanningPackage("ruckig")
    pin = PlanningPackage("pinocchio")
    ob, og, ou = PlanningPackage("ompl.base"), PlanningPackage("ompl.geometric"), PlanningPackage("ompl.util")
