"""Functions that act at one place alone: the errors of one gauge, where another one stands elsewhere."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.common.units import Array
from planner.effects.basis import BasisFunction, EffectVariable
from planner.effects.context import Context
from planner.effects.effect import Effect, Parameter, Place


class WherePlaced(BasisFunction, key="where:INDEX:PHI", static=False, gauge=True):
    """φ = PHI where the gauge stands at this place, else 0."""

    place: int
    phi: BasisFunction

    def __call__(self, c: Context) -> Array:
        """Return the function where it acts."""
        return np.where(c.samples.place == self.place, c.value(self.phi), 0.0)

    def plot_variable(self, c: Context) -> EffectVariable | None:
        """Draw it against what its own function is drawn against."""
        return self.phi.plot_variable(c)


def restrict_to_places(parameter: Parameter, places: Sequence[int], label: str) -> Parameter:
    """Return the parameter as it acts at some places alone; ``label`` tells it from the same one elsewhere."""
    moves = tuple(replace(m, phi=WherePlaced(place, m.phi)) for m in parameter.moves for place in places)
    return replace(parameter, name=f"{parameter.name}_{label}", what=f"{parameter.what} ({label})", moves=moves)


def effect_at(effect: Effect, places: Sequence[int], label: str) -> Effect:
    """Return the effect as it acts at some places alone, such as the scale of the gauge that stands there."""
    own = effect.parameters
    made = (
        (lambda value: tuple(restrict_to_places(p, places, label) for p in own(value)))
        if callable(own)
        else tuple(restrict_to_places(p, places, label) for p in own)
    )
    place = Place(f"{effect.place.part} ({label})", effect.place.number, effect.place.driver)
    return replace(effect, place=place, parameters=made)
