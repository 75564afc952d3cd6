"""The kinds of gauges by the names that cell files call them."""

from collections.abc import Mapping
from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from typing import ClassVar, Protocol, TypeVar

from pydantic import BaseModel

from planner.common.extensions import is_defined_again, load_extensions


class GaugeKind(Protocol):
    """What a cell file asks of a kind of gauge before it is read, see :class:`planner.cell.gauge.Gauge`."""

    kind: ClassVar[str]
    is_attached: ClassVar[bool]
    unit: ClassVar[str]
    width: ClassVar[int]
    angles: ClassVar[int]
    usual_keys: ClassVar[Mapping[str, Mapping[str, object]]]
    OwnKeys: ClassVar[type[BaseModel] | None]


G = TypeVar("G", bound=type[GaugeKind])
ROOM = "planner.gauges"
_KINDS: dict[str, type[GaugeKind]] = {}


def register_gauge(kind: G) -> G:
    """Make a kind known by its name in cell files; a class decorator. Defined again in its place it is replaced.

    Raises:
        ValueError: another gauge has that name, it lacks methods, or it shows lengths in mrad.
    """
    if kind.unit == "mrad" and kind.angles < kind.width:  # the first number is shown in that unit, angles come last
        raise ValueError(
            f"gauge kind '{kind.kind}' ({kind.__module__}): unit = \"mrad\", but angles = {kind.angles} of width = "
            f"{kind.width}: its readings would be taken for lengths; angles = {kind.width} is needed"
        )
    if not kind.__module__.startswith(f"{ROOM}."):
        _import_shipped_modules()  # so that who takes one of their names is the one who is told
    if kind.kind in _KINDS and not is_defined_again(_KINDS[kind.kind], kind):
        raise ValueError(f"gauge kind '{kind.kind}': {_KINDS[kind.kind].__module__} has registered it already")
    if lacking := sorted(getattr(kind, "__abstractmethods__", ())):
        raise ValueError(
            f"gauge kind '{kind.kind}' ({kind.__module__}): its class lacks {', '.join(lacking)}; the docstrings in "
            "planner.cell.gauge and planner.effects.gauge_unknowns say what each returns"
        )
    _KINDS[kind.kind] = kind
    return kind


def gauge_kinds() -> dict[str, type[GaugeKind]]:
    """Return all kinds by their names: those of ``planner.gauges``, and any registered beside them."""
    _import_shipped_modules()
    load_extensions()
    return _KINDS


def own_keys(kind: object) -> tuple[str, ...]:
    """Return the keys of ``[gauge]`` that only a kind has; none of an unknown one."""
    gauge = gauge_kinds().get(str(kind))
    return () if gauge is None or gauge.OwnKeys is None else tuple(gauge.OwnKeys.model_fields)


@cache  # a cell's file asks some five times, and the folder does not change
def _import_shipped_modules() -> None:
    for module in sorted(m.name for m in iter_modules(import_module(ROOM).__path__) if not m.ispkg):
        import_module(f"{ROOM}.{module}")


def attached_kinds() -> tuple[str, ...]:
    """Names of the kinds that are held between a fixture and the tool."""
    return tuple(name for name, kind in gauge_kinds().items() if kind.is_attached)
