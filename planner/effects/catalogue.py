"""The catalogue: the registry of all effects, and those that a measurement set-up and the logged columns can show.

A file of effects states its basis functions and registers generators of :class:`Effect` under the names of their kinds;
simulation, tracing, the discrimination of rivals and the report find them here. The files in ``SHIPPED`` come with the
package; any other module that registers effects adds to them when it is imported.
"""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module

from planner.cell.setup import MeasurementSetup
from planner.common.errors import InputError, did_you_mean
from planner.effects.effect import Background, Effect
from planner.effects.excitation import Excitation
from planner.runs.run import Samples

SHIPPED = ("compliance", "gears", "backlash", "thermal", "gauge_errors", "sessions", "nonparametric", "steps")
EffectGenerator = Callable[[Excitation], Iterator[Effect]]


@dataclass(frozen=True)
class Registration:
    """Kinds of effects.

    Attributes:
        kinds: their names.
        generator: yields those of them that a run can show.
        needs: what a run needs to show them.
        by_gauge: whether a gauge names the generator among its own errors, see ``Gauge.errors``.
        background: how effects that were not found enter the posterior.
    """

    kinds: tuple[str, ...]
    generator: EffectGenerator
    needs: str
    by_gauge: bool
    background: Background

    @property
    def order(self) -> int:
        """Position of its file among those that come with the package, behind them for any other."""
        module = self.generator.__module__.removeprefix(f"{__package__}.")
        return SHIPPED.index(module) if module in SHIPPED else len(SHIPPED)


_REGISTRY: list[Registration] = []


def register(
    *kinds: str,
    needs: str = "another kind of run",
    by_gauge: bool = False,
    background: Background = Background.BY_KIND,
) -> Callable[[EffectGenerator], EffectGenerator]:
    """Register a generator of effects under the names of the kinds that it yields, see :class:`Registration`."""

    def enter(generator: EffectGenerator) -> EffectGenerator:
        _REGISTRY.append(Registration(kinds, generator, needs, by_gauge, background))
        return generator

    return enter


def registrations() -> list[Registration]:
    """Return all registered effects in the order of the catalogue, which is that of their files."""
    for name in SHIPPED:
        import_module(f"{__package__}.{name}")
    return sorted(_REGISTRY, key=lambda r: r.order)


def effect_kinds() -> tuple[str, ...]:
    """Return the names of all kinds of effects."""
    return tuple(dict.fromkeys(kind for r in registrations() for kind in r.kinds))


def registration_of(kind: str) -> Registration:
    """Return the entry of a kind."""
    return next(r for r in registrations() if kind in r.kinds)


def needs_of(kind: str) -> str:
    """Return what a run needs to show effects of a kind."""
    return next((r.needs for r in registrations() if kind in r.kinds), "another kind of run")


def strip_repeat(name: str) -> str:
    """Return the name of an effect without its number, where it came again: ``gear ripple (2), joint 1``."""
    return re.sub(r" \(\d+\)(?=, |$)", "", name)


def check_effect_name(name: str, n_joints: int, where: str) -> None:
    """Check that an effect is one that there is, on a joint that an arm of ``n_joints`` has.

    Args:
        name: ``encoder once a turn, joint 2``.
        n_joints: joints of the robot.
        where: file and place of the name, for the message.

    Raises:
        InputError: with the nearest kind, or the joints that there are.
    """
    kind, comma, place = strip_repeat(name).partition(", ")
    kinds = effect_kinds()
    if kind not in kinds or not comma:
        allowed = "" if comma else "; it is called KIND, PLACE, like 'backlash, joint 2'"
        raise InputError(
            f"{where}: '{name}' is no effect{did_you_mean(kind, list(kinds))}{allowed} (known kinds:"
            f" {', '.join(kinds)})"
        )
    for part, most in (("joint", n_joints), ("link", n_joints + 1)):
        for number in re.findall(rf"\b{part} (\d+)", place):
            if not 1 <= int(number) <= most:
                raise InputError(f"{where}: '{name}': the robot has {part}s 1 to {most}")


def catalogue(setup: MeasurementSetup, samples: Samples) -> tuple[Effect, ...]:
    """Return every effect that the set-up can have and the samples can tell of.

    What needs a column that was not logged, or that never changes, is left out. Effects stand in a fixed order.
    """
    excitation = Excitation.of(setup, samples)
    return tuple(effect for r in registrations() if not r.by_gauge for effect in r.generator(excitation))
