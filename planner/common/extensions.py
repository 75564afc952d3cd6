"""What is built on the core: effects, gauges, commands, registered when the modules that bring them are imported.

Those that come with the planner are the modules of ``planner.wings``; other packages name theirs under the entry point
``edbb.extensions``.
"""

from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from importlib.util import find_spec
from pkgutil import iter_modules

from planner.common.errors import DeclarationError, InputError

GROUP = "edbb.extensions"
SHIPPED = "planner.wings"
HINT = f"; one that is not shipped comes with an installed package whose entry point '{GROUP}' names its module"


def shipped_extensions() -> tuple[str, ...]:
    """Return the modules of the shipped extensions; none where their folder was left out of the installation."""
    if find_spec(SHIPPED) is None:
        return ()
    return tuple(sorted(f"{SHIPPED}.{m.name}" for m in iter_modules(import_module(SHIPPED).__path__)))


def section_owner(key: str) -> str:
    """Return the shipped extension that reads a section of cell files, installed or not; empty where none does."""
    owners: dict[str, str] = {} if find_spec(SHIPPED) is None else import_module(SHIPPED).SECTIONS
    return owners.get(key, "")


@dataclass(frozen=True)
class BrokenExtension:
    """An extension of another package that could not be used: the sentence that says why.

    ``is_command_alone``: whether only the declaration of a command is wrong. Of any other it is not known whether it
    would have brought an effect or a gauge, without which a result would be another one.
    """

    said: str
    is_command_alone: bool


def load_extensions() -> None:
    """Import the shipped extensions, then those that installed packages name, by their names.

    Raises:
        InputError: one that may bring effects or gauges cannot be imported, or registers a name that is taken.
    """
    for broken in broken_extensions():
        if not broken.is_command_alone:
            raise InputError(broken.said)


@cache
def broken_extensions() -> tuple[BrokenExtension, ...]:
    """Import all extensions, and return those that cannot be used.

    The folder says which are shipped, not the metadata of an installation: a checkout has none, or that of another day.
    """
    broken = []
    for module in shipped_extensions():
        import_module(module)
    for point in sorted(entry_points(group=GROUP)):
        if point.module.startswith(f"{SHIPPED}."):
            continue
        try:
            point.load()
        except Exception as err:
            declared = isinstance(err, DeclarationError)
            why = str(err) if declared else f"{type(err).__name__}: {err}"
            broken.append(BrokenExtension(f"extension '{point.name}' ({point.value}): {why}", declared))
    return tuple(broken)


def is_defined_again(before: object, now: object) -> bool:
    """Tell whether a function or class is that of the same place, defined anew: a cell of a notebook runs twice."""
    place = [(getattr(each, "__module__", None), getattr(each, "__qualname__", None)) for each in (before, now)]
    return before is not now and None not in place[0] and place[0] == place[1]
