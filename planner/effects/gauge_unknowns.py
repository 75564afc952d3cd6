"""What is unknown of a gauge: the parameters that place it, how a late clock shows, and its own errors."""

from abc import ABC, abstractmethod
from collections.abc import Iterator

from planner.cell.gauge import Gauge
from planner.cell.placement import Placement
from planner.effects.catalogue import Excitation
from planner.effects.effect import Effect, Parameter, ParameterMove


class GaugeUnknowns(ABC):
    """What of a gauge enters the model beside the robot's own errors."""

    @abstractmethod
    def parameters(self, setup: Placement, free: frozenset[str]) -> Iterator[Parameter]:
        """Yield the parameters that place the gauge and the targets on the tool."""

    @abstractmethod
    def lag_moves(self) -> tuple[ParameterMove, ...]:
        """Return how a late clock shows in the reading, per second."""

    def errors(self, run: Excitation) -> Iterator[Effect]:
        """Yield the effects of the catalogue that are errors of the gauge itself."""
        return iter(())


def unknowns_of(gauge: Gauge) -> GaugeUnknowns:
    """Return the parameters of a gauge that are unknown.

    Raises:
        TypeError: its class does not say so.
    """
    if not isinstance(gauge, GaugeUnknowns):
        raise TypeError(f"gauge '{gauge.kind}': {type(gauge).__name__} must be a GaugeUnknowns as well")
    return gauge
