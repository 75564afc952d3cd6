"""Basis functions φ of an effect: what multiplies a parameter, sample by sample (value = nominal + Σ φ·p).

Each class states its key, the name that it has in files. A key is a word and its arguments, for instance
``hysteresis:JOINT:NUMBER``; the arguments are the fields of the class, in order.
"""

import re
from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from functools import cached_property
from typing import ClassVar, dataclass_transform

import numpy as np
from numpy.polynomial.legendre import legval

from planner.common.extensions import is_defined_again
from planner.common.units import Array
from planner.effects.context import Context

FUNCTIONS: list[type["BasisFunction"]] = []
COUNTED_FROM_ONE = ("JOINT", "LINK")


@dataclass(frozen=True)
class EffectVariable:
    """What an effect is drawn against: values (n,) in the unit of ``label``, folded at ``period`` where it repeats."""

    label: str
    values: Array
    period: float | None = None

    @property
    def folded_values(self) -> Array:
        """Values within one period."""
        return self.values if self.period is None else np.mod(self.values, self.period)


@dataclass_transform(frozen_default=True)
@dataclass(frozen=True)
class BasisFunction(ABC):
    """A basis function; each subclass is a frozen dataclass, whose fields are the arguments of its key.

    Attributes:
        pattern: of the keys: a word, which may offer alternatives in parentheses (the first field says which), then the
            kinds of the arguments: NUMBER any number, PHI another key (always last), else an index, see
            :data:`planner.effects.phi_keys.INDEX_RANGES`.
        is_static: whether it depends on joint angles and loads alone, so that targets can be compensated for it.
        needs_loads: whether it needs to know how the base stands and what the tool weighs.
        of_gauge: whether it belongs to the gauge, not to the robot.
        of_run: whether it depends on the clock or the sessions of one run and means nothing for another.
        column: of the samples, without which it has no value; empty where angles and loads are enough.
        plot_label: of what it is drawn against, if that is the function itself times ``plot_factor``; JOINT stands for
            its joint.
        uncorrected: what a corrected program leaves as it is where the function is not static.
    """

    pattern: ClassVar[str] = ""
    is_static: ClassVar[bool] = True
    needs_loads: ClassVar[bool] = False
    of_gauge: ClassVar[bool] = False
    of_run: ClassVar[bool] = False
    column: ClassVar[str] = ""
    plot_label: ClassVar[str] = ""
    plot_factor: ClassVar[float] = 1.0
    uncorrected: ClassVar[str] = ""

    def __init_subclass__(
        cls,
        key: str = "",
        *,
        static: bool = True,
        loads: bool = False,
        gauge: bool = False,
        run: bool = False,
        column: str = "",
    ) -> None:
        super().__init_subclass__()
        dataclass(frozen=True)(cls)
        cls.pattern, cls.is_static, cls.needs_loads, cls.of_gauge, cls.of_run = key, static, loads, gauge, run
        cls.column = column
        if not key:
            return
        for k, other in enumerate(FUNCTIONS):
            if taken := set(key_words(key)) & set(key_words(other.pattern)):
                if other.pattern == key and is_defined_again(other, cls):  # a cell of a notebook runs twice
                    FUNCTIONS[k] = cls
                    return
                raise ValueError(f"basis function '{taken.pop()}': {other.__module__}.{other.__name__} has that key")
        FUNCTIONS.append(cls)

    @abstractmethod
    def __call__(self, c: Context) -> Array:
        """Return φ for every sample, (n,) or (1,)."""

    @cached_property
    def looks_at_samples_alone(self) -> bool:
        """Whether the value of a sample is the same whatever other samples there are."""
        inside = (getattr(self, f.name) for f in fields(self))
        return self.is_static and all(v.looks_at_samples_alone for v in inside if isinstance(v, BasisFunction))

    @property
    def key(self) -> str:
        """Name in files, for instance ``torque:2``; it tells the function from every other."""
        word, *kinds = self.pattern.split(":")
        values = [getattr(self, f.name) for f in fields(self)]
        if "(" in word:
            word = re.sub(r"\(.*\)", values.pop(0), word)
        return ":".join([word, *(_text(kind, value) for kind, value in zip(kinds, values, strict=False))])

    def plot_variable(self, c: Context) -> EffectVariable | None:
        """Return the quantity that the effect is drawn against; ``None`` if it depends on several quantities."""
        if not self.plot_label:
            return None
        label = self.plot_label.replace("JOINT", str(getattr(self, "joint", 0) + 1))
        return EffectVariable(label, self.plot_factor * self(c))


def legendre(degree: int, u: Array) -> Array:
    """Return Legendre's polynomial P_degree(u), beyond −1 … 1 as at these ends."""
    return np.asarray(legval(np.clip(u, -1.0, 1.0), np.eye(degree + 1)[degree]))


def key_words(pattern: str) -> list[str]:
    """Return every word with which a key of this pattern may begin: ``(a|b)_joint:…`` gives two."""
    word = pattern.split(":")[0]
    match = re.search(r"\((.*)\)", word)
    return [word] if match is None else [word.replace(match[0], w) for w in match[1].split("|")]


def _text(kind: str, value: "int | float | BasisFunction") -> str:
    if isinstance(value, BasisFunction):
        return value.key
    if kind == "NUMBER":
        return repr(value)
    return str(int(value) + (kind in COUNTED_FROM_ONE))


class One(BasisFunction, key="1"):
    """φ = 1: a geometric error, an offset of the gauge."""

    def __call__(self, c: Context) -> Array:
        """Return one."""
        return np.ones(1)


class Times(BasisFunction, key="times:NUMBER:PHI"):
    """φ times a number."""

    factor: float
    phi: BasisFunction

    def __call__(self, c: Context) -> Array:
        """Return the product."""
        return self.factor * self.phi(c)


class Less(BasisFunction, key="less:NUMBER:PHI"):
    """φ less a number, such as its mean."""

    about: float
    phi: BasisFunction

    def __call__(self, c: Context) -> Array:
        """Return the difference."""
        return np.asarray(self.phi(c) - self.about)

    def plot_variable(self, c: Context) -> EffectVariable | None:
        """Draw it against what its own function is drawn against."""
        return self.phi.plot_variable(c)


class AtPlace(BasisFunction, key="place:INDEX", static=False, gauge=True):
    """φ = ±1 where the gauge stands at this place (fixture, plate, stand of a tracker), else 0."""

    place: int
    sign: float = 1.0

    def __call__(self, c: Context) -> Array:
        """Return the indicator."""
        return np.where(c.samples.place == self.place, self.sign, 0.0)


class AtPoint(BasisFunction, key="point:INDEX", static=False, gauge=True):
    """φ = 1 where this target on the tool was measured, else 0."""

    point: int

    def __call__(self, c: Context) -> Array:
        """Return the indicator."""
        point = c.samples.point
        return np.full(1, float(self.point == 0)) if point is None else (point == self.point).astype(float)


ONE = One()
