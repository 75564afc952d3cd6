"""Causes where and by what the catalogue's act, but by a law that it lacks: what a named cause has to be held against.

A joint that softens and then meets a stop is no compliance, though it turns with its load. A dent in a bearing is no
wobble, though it tips the axis as it turns. Each part moves here as any smooth function of the loads upon it, of its
joint's angle or of time: polynomials and waves, the quicker the smaller. Over an angle there are stiff laws as well:
over half a turn a slow curve of any origin is as good as a wave once a turn.
Links as beams are laws that have a name.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import product

import numpy as np

from planner.common.units import Array
from planner.effects.backlash import TorqueSign
from planner.effects.basis import BasisFunction, legendre
from planner.effects.catalogue import Excitation
from planner.effects.compliance import LEAST_LOAD, LINK_BENDING, LoadMoment, LoadTorque, twist_moves
from planner.effects.context import Context
from planner.effects.effect import BASE_TURNS, Parameter, ParameterMove, transform_move
from planner.effects.gears import WAVES, JointAngle, JointWave
from planner.effects.sizes import LOAD_TURN
from planner.effects.thermal import ElapsedTime

Mover = Callable[[BasisFunction], tuple[ParameterMove, ...]]
"""From φ to what it moves."""


class LegendreOf(BasisFunction):
    """φ = product of Legendre polynomials of functions over their largest values, of mean square about 1 each."""

    functions: tuple[BasisFunction, ...]
    middle: tuple[float, ...]
    reach: tuple[float, ...]
    degrees: tuple[int, ...]

    def __call__(self, c: Context) -> Array:
        """Return the product."""
        out: Array = np.ones(1)
        for phi, middle, reach, degree in zip(self.functions, self.middle, self.reach, self.degrees, strict=True):
            out = out * legendre(degree, (c.value(phi) - middle) / reach) * np.sqrt(2 * degree + 1)
        return out


def free_laws(run: Excitation) -> Iterator[tuple[str, tuple[Parameter, ...]]]:
    """Yield the parameters of each law by where it acts and by what: ``joint 2 by its load``."""
    moment_degree = 3  # of those of two moments together
    law_degree = 5  # of the polynomials of one load or of time
    for joint in run.turning:
        turn = partial(transform_move, run.rotation(joint))
        if run.setup.weighs:
            sides = (TorqueSign(joint),)
            yield from _polynomials(
                run, f"joint {joint + 1} by its load", [turn], [LoadTorque(joint)], law_degree, sides
            )
        if run.varies("t"):
            yield from _polynomials(run, f"joint {joint + 1} over time", [turn], [ElapsedTime(run.start)], law_degree)
    for joint in run.moving_joints:
        turn = partial(transform_move, run.rotation(joint))
        yield _waves(f"joint {joint + 1} by its own angle", joint, [turn])
        angle = JointAngle(joint, 0.0)
        yield from _polynomials(run, f"joint {joint + 1} by its own angle", [turn], [angle], 3)  # degree of a stiff law
        yield _waves(f"axis of joint {joint + 1} by its own angle", joint, _tilts(run, joint + 1, joint))
    if run.setup.weighs:
        tips = [partial(transform_move, m.index) for m in BASE_TURNS[:2]]
        yield from _polynomials(run, "base by its load", tips, [LoadMoment(0, 0), LoadMoment(0, 1)], moment_degree)
        for link in run.joints:
            last = link + 1 == run.setup.robot.n_joints
            name = "tool by its load" if last else f"link {link + 1} by its load"
            axes = _axes_across(run, None if last else link + 1)
            bends = _tilts(run, link + 2, None if last else link + 1)
            yield from _polynomials(run, name, bends, [LoadMoment(link + 2, a) for a in axes], moment_degree)


class BeamTwist(BasisFunction, key="beam:STATION:AXIS:PART", loads=True):
    """φ = one of the six numbers by which a link as a beam, bent about an axis of its end, moves what lies beyond.

    The moment goes straight from that at the link's beginning to that at its end, as forces at the end make it: a long
    link is bent most at its beginning, where nobody looks. The end turns by L/(E I) (M₀ + M₁)/2 and sinks by
    L²/(E I) (M₀/3 + M₁/6): Timoshenko, Strength of Materials (1940), art. 35. Parts and unit (L/(E I) is the parameter)
    are those of ``StationTwist``.
    """

    station: int
    axis: int
    part: int

    def __call__(self, c: Context) -> Array:
        """Return the number."""
        at, u = c.stations, c.stations.R[self.station, :, self.axis]
        first = np.einsum("in,ijn,jn->n", u, at.R[self.station - 1], c.moments[self.station - 1])
        last = c.moments[self.station, self.axis]
        if self.part >= 3:
            return np.asarray(u[self.part - 3] * (first + last) / 2)
        p, k, m = at.p[self.station], (self.part + 1) % 3, (self.part + 2) % 3
        arm = p * (first + last) / 2 - (p - at.p[self.station - 1]) * (first / 3 + last / 6)
        return np.asarray(arm[k] * u[m] - arm[m] * u[k])


def beam_laws(run: Excitation) -> Iterator[tuple[str, tuple[Parameter, ...]]]:
    """Yield the parameters of each link as a beam: it bends about all axes by the moments all along.

    The catalogue has it bend across the next joint alone, by the moment there: as a beam it does much of what the
    joints at its two ends do that yield, and only how its end sinks, and turns it, tells it apart.
    """
    for link in run.joints[:-1] if run.setup.weighs else ():
        station = link + 2
        moves = [[BeamTwist(station, axis, part) for part in range(6)] for axis in range(3)]
        loads = [float(np.sqrt(sum(run.values(phi) ** 2 for phi in six[3:])).max()) for six in moves]
        parameters = [
            Parameter(
                f"beam{link + 1}_{'xyz'[axis]}", "rad/Nm", LOAD_TURN.usual / load, f"bending of link {link + 1}",
                tuple(ParameterMove("transform", phi.part, phi) for phi in six),
            )
            for axis, (six, load) in enumerate(zip(moves, loads, strict=True)) if load > LEAST_LOAD
        ]  # fmt: skip
        if parameters:
            yield f"{LINK_BENDING}, link {link + 1}", tuple(parameters)


def _axes_across(run: Excitation, joint: int | None) -> list[int]:
    """Axes of a station across that of a joint; of the flange, ``None``, across its own."""
    turn = 2 if joint is None else run.setup.chain.transforms[run.rotation(joint)].axis
    return [axis for axis in range(3) if axis != turn]


def _tilts(run: Excitation, station: int, joint: int | None) -> list[Mover]:
    return [partial(twist_moves, station, axis) for axis in _axes_across(run, joint)]


def _polynomials(
    run: Excitation,
    name: str,
    movers: Sequence[Mover],
    functions: Sequence[BasisFunction],
    degree: int,
    more: Sequence[BasisFunction] = (),
) -> Iterator[tuple[str, tuple[Parameter, ...]]]:
    """Yield the family if all of its functions vary: polynomials up to a degree in all together, on each mover."""
    low, high = np.array([[run.values(f).min(), run.values(f).max()] for f in functions]).T
    if (high - low < 1e-6).any():  # [Nm, s] nothing varies
        return
    middle, reach = (tuple(np.round(v, 6).tolist()) for v in ((high + low) / 2, (high - low) / 2))
    powers = [p for p in product(range(degree + 1), repeat=len(functions)) if 0 < sum(p) <= degree]
    phis: list[tuple[BasisFunction, float]] = [
        (LegendreOf(tuple(functions), middle, reach, p), float(sum(p))) for p in powers
    ]
    phis += [(phi, 1.0) for phi in more]
    yield name, tuple(_parameters_of(name, movers, phis))


def _waves(name: str, joint: int, movers: Sequence[Mover]) -> tuple[str, tuple[Parameter, ...]]:
    own_waves = 5  # of a joint's own angle, once to five times a turn
    phis = [(JointWave(w, joint, float(k)), float(k)) for k in range(1, own_waves + 1) for w in WAVES]
    return name, tuple(_parameters_of(name, movers, phis))


def _parameters_of(
    name: str, movers: Sequence[Mover], phis: Sequence[tuple[BasisFunction, float]]
) -> Iterator[Parameter]:
    """Yield what moves by each function, the smaller the higher its order is."""
    sizes = 1 / np.array([order for _, order in phis])
    sizes *= 1e-4 / np.sqrt((sizes**2).sum())  # [rad] one sigma of all of it together, as of a gear
    for m, mover in enumerate(movers):
        for k, ((phi, _), size) in enumerate(zip(phis, sizes.tolist(), strict=True)):
            yield Parameter(f"law, {name}, {m}, {k}", "rad", size, f"law of {name}", mover(phi))
