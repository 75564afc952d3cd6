"""What every robot has in some size, whether poses show it or not: these families always act.

A cause that acts only where no pose was measured leaves no residual, and one that acts alike at all poses is fitted as
geometry. Of neither does the run say anything, so their prior sizes stand in what is known of the robot. The base turns
with the place of the tool and of the flange: bolts, floor and bearings give way to a load that no table of masses
has. A geared joint turns through its lost motion with the sign of its load. And beyond the loads that the run has
visited a joint need not follow the law that it has shown.
"""

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np

from planner.common.units import Array
from planner.effects.backlash import is_loaded_both_ways
from planner.effects.basis import BasisFunction, EffectVariable
from planner.effects.catalogue import Excitation
from planner.effects.compliance import LEAST_LOAD, LoadTorque
from planner.effects.context import Context
from planner.effects.effect import BASE_TURNS, Parameter, transform_move
from planner.effects.sizes import BASE_TURN, LOST_MOTION, UNSEEN_LOAD
from planner.runs.run import Samples

BASE_BY_PLACE = "base by the place of the "  # first words of their names
TYPICAL_FACTOR = 0.25  # [1] on their sizes: most robots have little and few much, so sums of several mostly are
LOST_MOTION_OF, BEYOND_LOADS = "lost motion, joint ", "loads not measured, joint "


def is_usual(family: str) -> bool:
    """Tell whether a family, by its name, is one of :func:`usual_errors`."""
    return family.startswith((BASE_BY_PLACE, LOST_MOTION_OF, BEYOND_LOADS))


def usual_factors() -> tuple[Array, Array]:
    """Return factors (k,) on the size of such a family and their probabilities: most robots have little, few much."""
    factors = 2.0 ** np.arange(-7, 4, dtype=float)
    # normal in the log, of mean −2.5 and sigma 1.75: half have less than a twelfth, one in thirteen more than the whole
    weight = np.exp(-0.5 * ((np.log(factors) + 2.5) / 1.75) ** 2)
    return factors, weight / weight.sum()


class PlacePower(BasisFunction, key="place-(tool|flange):NUMBER:INDEX:INDEX"):
    """φ = (x/reach)^i (y/reach)^j of the place of the tool's point, or of the flange, in the base frame."""

    of: str
    reach: float
    x: int
    y: int

    def __call__(self, c: Context) -> Array:
        """Return the product."""
        p = (c.motion.x if self.of == "tool" else c.stations.p[-1]) / self.reach
        return np.asarray(p[0] ** self.x * p[1] ** self.y)


class LoadSide(BasisFunction, key="load-side:JOINT:NUMBER", loads=True):
    """φ = tanh(torque/knee): on which side of its lost motion a joint lies; between the sides it goes gradually."""

    joint: int
    knee: float

    def __call__(self, c: Context) -> Array:
        """Return the side, −1 … 1."""
        return np.asarray(np.tanh(c.load_torque[:, self.joint] / self.knee))

    def plot_variable(self, c: Context) -> EffectVariable | None:
        """Draw against the torque."""
        return LoadTorque(self.joint).plot_variable(c)


class LoadBeyond(BasisFunction, key="load-(above|below):JOINT:NUMBER:NUMBER", loads=True):
    """φ = tanh of how far a joint's load is above, or below, an end of the loads measured, over a span; else 0."""

    side: str
    joint: int
    end: float
    span: float

    def __call__(self, c: Context) -> Array:
        """Return the function, 0 … 1."""
        sign = 1.0 if self.side == "above" else -1.0
        beyond = sign * (c.load_torque[:, self.joint] - self.end) / self.span
        return np.asarray(np.tanh(np.maximum(beyond, 0.0)))

    def plot_variable(self, c: Context) -> EffectVariable | None:
        """Draw against the torque."""
        return LoadTorque(self.joint).plot_variable(c)


def usual_errors(run: Excitation, planned: bool = False) -> Iterator[tuple[str, tuple[Parameter, ...]]]:
    """Yield families of parameters, by name.

    Of a run they are what its samples have not shown, beside the causes of the catalogue. Poses that are ``planned``
    are to show them: joints have lost motion whatever the samples, and another law beyond half of their largest load.
    """
    anywhere = _Anywhere(run)
    for of in ("tool", "flange"):
        yield f"{BASE_BY_PLACE}{of}", tuple(_base_by_place(of, anywhere.reach(of)))
    for joint in run.turning if run.setup.weighs else ():
        most = float(np.abs(anywhere.torque[:, joint]).max())
        if most > LEAST_LOAD:
            if planned or not is_loaded_both_ways(run, joint):  # else play by load stands for it
                yield f"{LOST_MOTION_OF}{joint + 1}", (_lost_motion(run, joint, most),)
            load = np.array([-0.5, 0.5]) * most if planned else run.context.load_torque[:, joint]
            yield f"{BEYOND_LOADS}{joint + 1}", tuple(_beyond(run, joint, load, most))


class _Anywhere:
    """Loads and places at states within the joints' ranges, no more than a turn each."""

    def __init__(self, run: Excitation) -> None:
        robot, states = run.setup.robot, 500  # enough for a largest load that is right to some per cent
        q = np.random.default_rng(0).uniform(*robot.one_turn, (states, robot.n_joints))
        self.context = Context(run.setup, Samples(q, np.zeros(states, dtype=int)))

    @cached_property
    def torque(self) -> Array:
        """Loads of the joints, (n, N) [Nm]."""
        return self.context.load_torque

    def reach(self, of: str) -> float:
        """Return how far out the tool, or the flange, stands at most [m]."""
        p = self.context.motion.x if of == "tool" else self.context.stations.p[-1]
        return round(float(np.hypot(p[0], p[1]).max()), 3)


def _base_by_place(of: str, reach: float) -> Iterator[Parameter]:
    """Yield turns of the base about its three axes by powers of a place, of all together the usual size at the reach.

    Tilts come by the first power, and half as large by the second; turns about the vertical are half as large.
    """
    powers = [(1, 0), (0, 1), (2, 0), (1, 1), (0, 2)]
    share = np.array([1.0 if i + j == 1 else 0.5 for i, j in powers])
    for move, own in zip(BASE_TURNS, (1.0, 1.0, 0.5), strict=True):
        for (i, j), size in zip(powers, (BASE_TURN.usual * own * share).tolist(), strict=True):
            moves = transform_move(move.index, PlacePower(of, reach, i, j))
            what = f"turn of the base {move.words} by the place of the {of}"
            yield Parameter(f"base_by_{of}_{move.name}_{i}{j}", "rad", size, what, moves)


def _lost_motion(run: Excitation, joint: int, most: float) -> Parameter:
    # 0.1: of the largest load, within which a gear goes from one side of its lost motion to the other
    moves = transform_move(run.rotation(joint), LoadSide(joint, round(0.1 * most, 6)))
    what = f"lost motion of joint {joint + 1}, to either side"
    return Parameter(f"lost_motion{joint + 1}", "rad", LOST_MOTION.usual, what, moves)


def _beyond(run: Excitation, joint: int, load: Array, most: float) -> Iterator[Parameter]:
    ends: Sequence[tuple[str, float]] = (("above", float(load.max())), ("below", float(load.min())))
    for side, end in ends:
        moves = transform_move(run.rotation(joint), LoadBeyond(side, joint, round(end, 6), round(0.3 * most, 6)))
        what = f"turn of joint {joint + 1} by loads {side} those measured"
        yield Parameter(f"load_{side}{joint + 1}", "rad", UNSEEN_LOAD.usual, what, moves)
