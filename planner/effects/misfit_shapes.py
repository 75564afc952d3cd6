"""What moves the tool and has no name: turns of the parts of an arm as smooth functions of how it stands.

They are the discrepancy between arm and catalogue (Kennedy and O'Hagan 2001, J. R. Statist. Soc. B 63(3)): beside them
an error that the catalogue lacks is not taken for geometry, and what is known of the tool tells of it. A cause acts
where an arm yields, is worn or is pulled: each part may turn with the direction in which its weight pulls, whatever the
law, and with the angle of any other joint. What it does with the angle of its own joint the catalogue has. The base
stands always alike to gravity: it turns by how far the arm leans to which side.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from planner.common.units import Array
from planner.effects.basis import BasisFunction
from planner.effects.catalogue import Excitation
from planner.effects.compliance import LEAST_LOAD, twist_moves
from planner.effects.context import Context
from planner.effects.effect import BASE_TURNS, Parameter, transform_move
from planner.effects.gears import WAVES, JointWave
from planner.effects.sizes import GEAR_WAVE, PART_TURN


class GravityHarmonic(BasisFunction, key="gravity:STATION:INDEX:INDEX", loads=True):
    """φ = a real spherical harmonic of gravity's direction in the axes of a station, scaled to a mean square of 1.

    The first index is the degree n, the second the order m plus n, 0 … 2n.
    """

    station: int
    degree: int
    index: int

    def __call__(self, c: Context) -> Array:
        """Return the harmonic."""
        from scipy.special import sph_harm_y  # only here

        down = c.setup.gravity_B / np.linalg.norm(c.setup.gravity_B)
        x, y, z = np.einsum("jin,j->in", c.stations.R[self.station], down)
        order = self.index - self.degree
        wave = sph_harm_y(self.degree, abs(order), np.arccos(np.clip(z, -1.0, 1.0)), np.arctan2(y, x))
        size = np.sqrt(4 * np.pi) * (np.sqrt(2) if order else 1.0)
        return np.asarray(size * (wave.imag if order < 0 else wave.real))


class LeanWave(BasisFunction, key="lean-(sin|cos):INDEX", loads=True):
    """φ = moment [Nm] by which the arm leans over its base, times a wave of the side to which it leans."""

    wave: str
    number: int

    def __call__(self, c: Context) -> Array:
        """Return the product."""
        x, y = c.moments[0, :2]
        side = self.number * np.arctan2(y, x)
        return np.asarray(np.hypot(x, y) * (np.sin if self.wave == "sin" else np.cos)(side))


def misfit_shapes(run: Excitation) -> Iterator[tuple[str, tuple[Parameter, ...]]]:
    """Yield families of parameters by name: a part that turns with gravity, or with the angle of another joint."""
    if run.setup.weighs and (lean := run.largest(LeanWave("cos", 0))) > LEAST_LOAD:
        yield "base by its load", tuple(_by_lean(lean, (0, 2, 3, 4)))
    for joint in run.joints:
        if run.setup.weighs:
            yield f"part {joint + 1} by gravity", tuple(_by_gravity(joint + 1))
        for other in run.moving_joints:
            if other != joint:
                yield f"part {joint + 1} by joint {other + 1}", tuple(_by_joint(joint + 1, _across(run, joint), other))


def shapes_without_catalogue(run: Excitation) -> Iterator[tuple[str, tuple[Parameter, ...], bool]]:
    """Yield the same families for an estimate that has no catalogue beside them, and whether the catalogue names them.

    What it names is among them: a base that yields to all sides, gears that err once or twice a turn, bearings that tip
    with the angle of their own joint, joints that turn with another one.
    """
    if run.setup.weighs and (lean := run.largest(LeanWave("cos", 0))) > LEAST_LOAD:
        yield "base by its load", tuple(_by_lean(lean, range(5))), True
    for joint in run.joints:
        if run.setup.weighs:
            yield f"part {joint + 1} by gravity", tuple(_by_gravity(joint + 1)), False
        for other in run.moving_joints:
            if other != joint:
                yield f"part {joint + 1} by joint {other + 1}", tuple(_by_joint(joint + 1, [0, 1, 2], other)), False
        if joint in run.moving_joints:
            yield f"part {joint + 1} by its joint", tuple(_by_joint(joint + 1, _across(run, joint), joint)), True
            for number in (1, 2) if not run.setup.robot.slides[joint] else ():
                yield f"gear {joint + 1}, wave {number}", tuple(_gear_waves(run.rotation(joint), joint, number)), True


def _across(run: Excitation, joint: int) -> list[int]:
    """Return the axes about which a part turns beside its joint."""
    turn = run.setup.chain.transforms[run.rotation(joint)].axis
    return [axis for axis in range(3) if axis != turn or run.setup.robot.slides[joint]]


def _gear_waves(rotation: int, joint: int, number: int) -> Iterator[Parameter]:
    """Yield sine and cosine of a joint's own error, so many waves in a turn."""
    for wave in WAVES:
        moves = transform_move(rotation, JointWave(wave, joint, float(number)))
        name = f"misfit_gear{joint + 1}_{wave}{number}"
        yield Parameter(name, "rad", GEAR_WAVE.usual, f"gear of joint {joint + 1}, wave {number}", moves)


def _by_gravity(station: int) -> Iterator[Parameter]:
    """Yield turns about all axes of a station, each degree of the harmonics as large as the square of 1/n says."""
    # 3: degree of the harmonics of gravity's direction: odd ones above the first tell a switch from a bend
    degrees = np.arange(1, 3 + 1)
    share = np.sqrt((2 * degrees + 1) / degrees**2)
    sizes = PART_TURN / degrees / np.sqrt((share**2).sum())
    for axis in range(3):
        for n, size in zip(degrees.tolist(), sizes.tolist(), strict=True):
            for k in range(2 * n + 1):
                name = f"misfit{station}_{'xyz'[axis]}_gravity{n}_{k}"
                moves = twist_moves(station, axis, GravityHarmonic(station, n, k))
                yield Parameter(name, "rad", size, f"turn of part {station} by gravity", moves)


def _by_lean(lean: float, numbers: Sequence[int]) -> Iterator[Parameter]:
    """Yield turns of the base by the side to which the arm leans ``lean`` [Nm] at most, the k-th wave by k² smaller.

    Once around is a soft base, which the catalogue has; a base that opens to one side has every even one as well.
    """
    waves = [(k, wave) for k in numbers for wave in WAVES if k or wave == "cos"]
    share = np.array([1 / max(k, 1) ** 2 for k, _ in waves])
    square = np.array([0.5 if k else 1.0 for k, _ in waves])  # mean square of each around the base
    sizes = PART_TURN * share / np.sqrt((square * share**2).sum()) / lean
    for move in BASE_TURNS[:2]:
        for (k, wave), size in zip(waves, sizes.tolist(), strict=True):
            moves = transform_move(move.index, LeanWave(wave, k))
            yield Parameter(f"misfit_base_{move.name}_{wave}{k}", "rad/Nm", size, "turn of the base by its load", moves)


def _by_joint(station: int, axes: list[int], joint: int) -> Iterator[Parameter]:
    """Yield turns about some axes of a station by waves of a joint's angle, the k-th by k smaller."""
    waves = np.arange(1, 2 + 1)  # waves of another joint's angle: once and twice a turn
    sizes = PART_TURN / waves / np.sqrt((2.0 / waves**2).sum())
    for axis in axes:
        for k, size in zip(waves.tolist(), sizes.tolist(), strict=True):
            for wave in WAVES:
                name = f"misfit{station}_{'xyz'[axis]}_{wave}{k}_joint{joint + 1}"
                moves = twist_moves(station, axis, JointWave(wave, joint, float(k)))
                yield Parameter(name, "rad", size, f"turn of part {station} by joint {joint + 1}", moves)
