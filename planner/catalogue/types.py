"""An entry of the catalogue: a physical cause, and the parameters with which it would enter the model."""

from collections.abc import Callable
from dataclasses import dataclass

from planner.model import Parameter
from planner.units import Array


@dataclass(frozen=True)
class Inner:
    """A number inside the basis functions that is not known beforehand: a frequency, a time constant, a lag.

    Attributes:
        name, unit: for instance ``frequency`` and ``1/turn``.
        values: the grid that is scanned, fine enough that neighbours look alike, (m,).
        log: whether the grid's steps grow with the value.
    """

    name: str
    unit: str
    values: Array
    log: bool = False


@dataclass(frozen=True)
class Entry:
    """One physical cause at one place.

    Attributes:
        kind: for instance ``gear ripple``; ``on``: ``joint 3``, ``base``, ``gauge``.
        make: its parameters for a value of the inner number (``None`` where there is none).
        sentence: what a mechanic would say, with ``{size}`` and, where there is one, ``{inner}`` to be filled in.
        largest: size beyond which it is not plausible, in the unit of its parameters.
        source: where kind and size come from.
        inner: the number to be scanned.
        static: whether it depends on joint angles and loads alone, so that targets can be compensated for it.
    """

    kind: str
    on: str
    make: Callable[[float | None], tuple[Parameter, ...]]
    sentence: str
    largest: float
    source: str
    inner: Inner | None = None
    static: bool = True

    @property
    def name(self) -> str:
        """``gear ripple, joint 3``: the group of its parameters."""
        return f"{self.kind}, {self.on}"
