"""What other packages bring: effects, basis functions and gauges, registered when their modules are imported."""

from functools import cache
from importlib.metadata import entry_points

from planner.common.errors import InputError

GROUP = "edbb.extensions"
HINT = f"; one that is not shipped comes with an installed package whose entry point '{GROUP}' names its module"


@cache
def load_extensions() -> None:
    """Import the modules that installed packages name under the entry point ``edbb.extensions``, by their names.

    Raises:
        InputError: one cannot be imported, or registers a name that is taken.
    """
    for point in sorted(entry_points(group=GROUP)):
        try:
            point.load()
        except Exception as err:
            raise InputError(f"extension '{point.name}' ({point.value}): {type(err).__name__}: {err}") from err
