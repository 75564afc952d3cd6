"""An effect: a physical cause at one place, with the parameters by which it enters the model; those of the geometry."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from enum import Flag, auto
from functools import cached_property
from typing import Literal

import numpy as np

from planner.cell.cell import MeasurementSetup
from planner.cell.placement import N_BASE_TRANSFORMS, Placement
from planner.common.units import DEG, MM, UM, Array, display_unit, si_unit
from planner.effects.basis import ONE, AtPoint, BasisFunction
from planner.kinematics.robot import Robot


@dataclass(frozen=True)
class ParameterMove:
    """What a parameter moves, an elementary transform of the chain or a number of the reading, times ``phi``."""

    on: Literal["transform", "reading"]
    index: int
    phi: BasisFunction = ONE


@dataclass(frozen=True)
class Parameter:
    """One error parameter.

    Attributes:
        name: for instance ``alpha2``, ``fixture_A_x``, ``map_z``, ``zero``, ``compliance2``.
        unit: of its value: m, rad, s, or a quotient such as rad/Nm.
        prior: one-sigma size expected before any measurement, in that unit.
        what: what it is, in a mechanic's words.
        moves: all that it moves; most parameters move one thing.
        group: ``gauge`` (it places the gauge), ``geometry``, or the effect it belongs to.
    """

    name: str
    unit: str
    prior: float
    what: str
    moves: tuple[ParameterMove, ...]
    group: str = "geometry"

    def __post_init__(self) -> None:
        try:
            si = si_unit(self.unit)[0]
        except ValueError as err:
            raise ValueError(f"parameter '{self.name}': unit '{self.unit}': {err}") from err
        if si != self.unit:
            raise ValueError(f"parameter '{self.name}': unit '{self.unit}' is none of the SI; '{si}' would be")

    def with_prior(self, prior: float) -> "Parameter":
        """Return it with another prior sigma, its unit known to be right."""
        if prior == self.prior:
            return self
        out = object.__new__(Parameter)
        out.__dict__.update(self.__dict__, prior=prior)
        return out

    @property
    def main_move(self) -> ParameterMove:
        """The first thing it moves."""
        return self.moves[0]

    @property
    def is_effect(self) -> bool:
        """Whether it neither places the gauge nor belongs to the geometry."""
        return self.group not in ("gauge", "geometry")


def unit_spellings(p: Parameter) -> dict[str, float]:
    """Return how a parameter's unit may stand in a key, and its factor to SI; the first is how it is written."""
    known = {
        "m": {"mm": MM, "um": UM, "m": 1.0},
        "rad": {"deg": DEG, "mrad": 1e-3, "urad": 1e-6, "rad": 1.0},
        "rad/Nm": {"urad_Nm": 1e-6, "deg_Nm": DEG, "rad_Nm": 1.0},
    }
    return known.get(p.unit, {p.unit.replace("/", "_"): 1.0})


def parameter_keys(p: Parameter) -> list[tuple[str, float]]:
    """Return the keys that give a parameter a value, such as ``theta2_deg``, and the factor of each to SI."""
    return [(f"{p.name}_{spelling}", factor) for spelling, factor in unit_spellings(p).items()]


def transform_move(index: int, phi: BasisFunction = ONE) -> tuple[ParameterMove, ...]:
    """Return the move of one transform."""
    return (ParameterMove("transform", index, phi),)


def reading_move(phi: BasisFunction = ONE, index: int = 0) -> tuple[ParameterMove, ...]:
    """Move one number of the reading."""
    return (ParameterMove("reading", index, phi),)


@dataclass(frozen=True)
class BaseMotion:
    """Shift of the base along an axis, or its turn about one: ``x`` … ``rz``, in words, and its transform."""

    name: str
    words: str
    index: int

    def times(self, phi: BasisFunction) -> tuple[ParameterMove, ...]:
        """Move the base so, times φ."""
        return transform_move(self.index, phi)


BASE_SHIFTS = tuple(BaseMotion(a, f"along {a}", k) for k, a in enumerate("xyz"))
BASE_TURNS = tuple(BaseMotion(f"r{a}", f"about {a}", 3 + k) for k, a in enumerate("xyz"))


def tool_point_parameters(name: str) -> list[str]:
    """Return the names of the three parameters that place a tool point; a lone one has an empty name."""
    return [f"map_{name}_{axis}" if name else f"map_{axis}" for axis in "xyz"]


def tool_parameters(setup: Placement) -> Iterator[Parameter]:
    """Where the targets sit on the tool."""
    for t, name in enumerate(setup.point_names):
        phi = AtPoint(t) if len(setup.point_names) > 1 else ONE
        for axis, parameter in zip("xyz", tool_point_parameters(name), strict=True):
            what = f"tool point {name} along {axis} of the flange".replace("  ", " ")
            moves = transform_move(setup.chain.index(f"map_{axis}"), phi)
            yield Parameter(parameter, "m", setup.tool_prior, what, moves, "gauge")


def geometry_group(robot: Robot, transform: int) -> str:
    """Return the group of a geometric error that a fleet has one size for: ``lengths, joint 3`` or ``angles, joint 3``.

    A joint has those of its row of the table, or of the link that it carries.
    """
    t = robot.transforms[transform]
    link = int(np.searchsorted(robot.link_end, transform, side="right"))
    number = min(t.joint + 1 if t.joint is not None else link, robot.n_joints)
    return f"{'lengths' if t.kind == 'translation' else 'angles'}, joint {number}"


def robot_parameters(setup: MeasurementSetup) -> list[Parameter]:
    """Errors of the robot's own transforms; transforms that are ``fixed`` have none.

    The last joint's angle comes last: a point on the last axis cannot see it.
    """
    robot = setup.robot
    out: list[Parameter] = []
    last: list[Parameter] = []
    for k, t in enumerate(robot.transforms):
        if t.fixed:
            continue
        if t.joint is not None:
            what = f"zero of joint {t.joint + 1}"
        else:
            link = int(np.searchsorted(robot.link_end, k, side="right"))
            what = f"{'shift along' if t.kind == 'translation' else 'turn about'} {'xyz'[t.axis]}, link {link}"
        prior = robot.priors.length if t.kind == "translation" else robot.priors.angle
        prior *= robot.priors.factor(geometry_group(robot, k))
        parameter = Parameter(
            t.name, "m" if t.kind == "translation" else "rad", prior, what, transform_move(N_BASE_TRANSFORMS + k)
        )
        (last if t.joint == robot.n_joints - 1 else out).append(parameter)
    return out + last


class Role(Flag):
    """What the search for effects must know of a kind beyond its columns."""

    ORDINARY = 0
    COMPLIANCE = auto()
    """Compliance of a joint: every arm has it, and masses of links other than stated show through it."""
    LIKE_COMPLIANCE = auto()
    """Explains much of what the compliances of the joints on which it acts explain, and is less likely."""
    LIKE_ANY_COMPLIANCE = auto()
    """The same of the compliances of all joints."""
    YIELDING = auto()
    """A joint gives way under one measure of its load: of two such effects at a joint only one can be the cause."""
    GEAR_WAVE = auto()
    """One wave of a gear's error, which a curve of the whole error may replace."""
    GEAR_CURVE = auto()
    """The whole error of a gear over its angle."""
    REPEATABLE = auto()
    """May come more than once at a place, each time with another value of its nonlinear parameter."""
    UNTRACED = auto()
    """Never looked for: it shows through other effects only."""
    SAME_LAW = auto()
    """By the same law at the same place as another cause: found in its name, and a rival that no reading tells from it.

    It is untraced as well, so that what both explain is counted once.
    """
    NONPARAMETRIC = auto()
    """A smooth correction without a physical cause."""
    CHANGE = auto()
    """Something that stood otherwise before a sample that the search found, or a single wrong row."""

    SET_UP = auto()
    """Something of the set-up that the cell holds for known: where one thing is off, others easily are."""


@dataclass(frozen=True)
class Place:
    """What an effect acts on.

    Attributes:
        part: ``joint`` or ``link`` where it has a ``number``; else ``base``, ``gauge``, ``all joints`` and the like.
        number: of the joint or link, from 0.
        driver: the joint that moves this one, from 0, where another one does.
    """

    part: str
    number: int | None = None
    driver: int | None = None

    def __str__(self) -> str:
        number = "" if self.number is None else f" {self.number + 1}"
        return f"{self.part}{number}" + ("" if self.driver is None else f" by joint {self.driver + 1}")

    @property
    def joint(self) -> int | None:
        """Number of the joint, from 0, where it is one."""
        return self.number if self.part == "joint" else None


def joint_place(joint: int, driver: int | None = None) -> Place:
    """Return the place of a joint, from 0, moved by itself or by another one."""
    return Place("joint", joint, None if driver == joint else driver)


@dataclass(frozen=True)
class ShapeParameter:
    """A number inside the basis functions that is not known beforehand: a frequency, a time constant, a width.

    Attributes:
        name, unit: for instance ``frequency`` and ``1/turn``.
        values: the grid that is scanned, fine enough that neighbours look alike, (m,).
        log: whether the grid's steps grow with the value.
    """

    name: str
    unit: str
    values: Array
    log: bool = False

    @cached_property
    def _ascending_grid(self) -> Array:
        return np.sort(self.values)

    def spacing(self, at: float) -> float:
        """Distance of the neighbours of a value on the grid."""
        return float(self.spacings(np.array([at]))[0])

    def spacings(self, at: Array) -> Array:
        """Return the spacing at several values (k,)."""
        grid = self._ascending_grid
        if len(grid) < 2:
            return np.abs(at) * 0.1
        k = np.clip(np.searchsorted(grid, at), 1, len(grid) - 1)
        return np.asarray(grid[k] - grid[k - 1])

    def clip(self, value: float) -> float:
        """Keep a value inside the grid: beyond it other effects begin."""
        return float(np.clip(value, self.values.min(), self.values.max()))


Parameters = Callable[[float], Iterable[Parameter]]


@dataclass(frozen=True)
class Effect:
    """One physical cause at one place.

    Attributes:
        kind: its name in findings, in ``[plan] effects`` and in ``TRUTH.toml``, for instance ``gear ripple``.
        place: what it acts on.
        parameters: those by which it enters the model; with a nonlinear parameter, a function of its value.
        sentence: what a mechanic would say, with ``{size}`` and, with a nonlinear parameter, ``{inner}`` to fill in;
            ``{more}`` and ``{grow}`` read less and shrink where the size is negative.
        largest: size beyond which it is not plausible, in the unit of its parameters.
        literature: where kind and size come from.
        nonlinear: the number to be scanned.
        role: in the search.
        repeat: 2 and more for those that come again at the same place.
        scanned: how many samples and things it was chosen from, beside what the catalogue offers.
        odds: of a cause of the same law, over the one in whose name it is found: how often it is met for each of that.
    """

    kind: str
    place: Place
    parameters: tuple[Parameter, ...] | Parameters
    sentence: str
    largest: float
    literature: str
    nonlinear: ShapeParameter | None = None
    role: Role = Role.ORDINARY
    repeat: int = 1
    scanned: int = 1
    odds: float = 1.0

    @cached_property
    def family(self) -> str:
        """Kind and place, such as ``gear ripple, joint 3``: the name, unless several effects share kind and place."""
        return f"{self.kind}, {self.place}"

    @cached_property
    def name(self) -> str:
        """Name, for instance ``gear ripple, joint 3``, or ``gear ripple (2), joint 3`` for the second one."""
        return self.family if self.repeat == 1 else f"{self.kind} ({self.repeat}), {self.place}"

    @property
    def unit(self) -> str:
        """Unit of the effect's size."""
        return self.make(self.grid[0])[0].unit

    @property
    def grid(self) -> tuple[float | None, ...]:
        """Values of the nonlinear parameter that are scanned, ``None`` alone where there is none."""
        return (None,) if self.nonlinear is None else tuple(float(v) for v in self.nonlinear.values)

    def has(self, role: Role) -> bool:
        """Tell whether it has any of the roles."""
        return bool(self.role & role)

    def make(self, value: float | None = None) -> tuple[Parameter, ...]:
        """Return its parameters at a value of the nonlinear one."""
        if callable(self.parameters):
            assert value is not None
            made = tuple(self.parameters(value))
        else:
            made = self.parameters
        suffix = "" if self.repeat == 1 else f"_{self.repeat}"
        return tuple(replace(p, name=f"{p.name}{suffix}", group=self.family) for p in made)


def implausible_text(effect: Effect, size: float) -> str:
    """Say that an effect of this size is refused because no arm or gauge has it."""
    unit, factor = display_unit(effect.unit, size)
    size_text, most = (f"{abs(v) * factor:.4g} {unit}" for v in (size, effect.largest))
    what = f"the {effect.kind}" if effect.place.number is None else f"the {effect.kind} of {effect.place}"
    return f"{what} would have to be {size_text}, which is not plausible: at most {most} ({effect.literature})"
