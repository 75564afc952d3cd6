"""What is built on the core: effects, gauges, commands, registered when the modules that bring them are imported.

Those that come with the planner are the modules of ``planner.wings``; other packages name theirs under the entry point
``edbb.extensions``.
"""

from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from importlib.util import find_spec
from pkgutil import iter_modules

from planner.common.errors import InputError

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


@cache
def load_extensions() -> None:
    """Import the shipped extensions, then those that installed packages name, by their names.

    The folder says which are shipped, not the metadata of an installation: a checkout has none, or that of another day.

    Raises:
        InputError: one cannot be imported, or registers a name that is taken.
    """
    for module in shipped_extensions():
        import_module(module)
    for point in sorted(entry_points(group=GROUP)):
        if point.module.startswith(f"{SHIPPED}."):
            continue
        try:
            point.load()
        except Exception as err:
            raise InputError(f"extension '{point.name}' ({point.value}): {type(err).__name__}: {err}") from err
