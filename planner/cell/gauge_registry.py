"""The kinds of gauges by the names that cell files call them."""

from importlib import import_module
from pkgutil import iter_modules
from typing import TYPE_CHECKING, TypeVar

from planner.common.extensions import load_extensions

if TYPE_CHECKING:
    from planner.cell.gauge import Gauge

G = TypeVar("G", bound="type[Gauge]")
ROOM = "planner.gauges"
_KINDS: dict[str, type["Gauge"]] = {}


def register_gauge(kind: G) -> G:
    """Make a kind known by its name in cell files; a class decorator.

    Raises:
        ValueError: another gauge has that name.
    """
    if not kind.__module__.startswith(f"{ROOM}."):
        _import_shipped()  # so that who takes one of their names is the one who is told
    if kind.kind in _KINDS:
        raise ValueError(f"gauge kind '{kind.kind}': {_KINDS[kind.kind].__module__} has registered it already")
    _KINDS[kind.kind] = kind
    return kind


def gauge_kinds() -> dict[str, type["Gauge"]]:
    """Return all kinds by their names: those of ``planner.gauges``, and any registered beside them."""
    _import_shipped()
    load_extensions()
    return _KINDS


def _import_shipped() -> None:
    for module in sorted(m.name for m in iter_modules(import_module(ROOM).__path__) if not m.ispkg):
        import_module(f"{ROOM}.{module}")


def attached_kinds() -> tuple[str, ...]:
    """Names of the kinds that are held between a fixture and the tool."""
    return tuple(name for name, kind in gauge_kinds().items() if kind.is_attached)
