"""Errors of a gauge of any smooth shape: polynomials of a bar's length and direction, or of the way from a tracker.

They have no name and are never sought; beside them an error that nobody wrote down does not go into the arm's lengths.
A gauge of lengths is less linear than it repeats, and one of 1 µm does not err like a wire: the size goes with the
declared noise. Both are estimates, of which the run says how far they are off.
What such an error is on average over directions, as of a bar that always hangs through, looks partly like a scale and a
zero, beside those that the cell declares: the lengths of an arm are known no better than the gauge errs. The shapes in
the length are Legendre's, so that one of them is a scale and the others are none: of powers each holds a scale, and all
together twice what one sigma of them says.
Gravity is the one direction that is known beforehand to matter: a bar or wire hangs through, its ends and the stand
give way, the more the flatter it lies. That has a size of its own: as part of a shape in any direction, whose many
terms share one size, it would count as improbable, and an arm takes up three quarters of it.
"""

from collections.abc import Iterator
from itertools import product

import numpy as np
from numpy.polynomial import Legendre

from planner.common.units import Array
from planner.effects.basis import BasisFunction
from planner.effects.catalogue import Excitation
from planner.effects.context import Context
from planner.effects.effect import Parameter, ParameterMove
from planner.effects.sizes import BAR_SHAPE, RAY_SHAPE

GAUGE_SHAPE = "gauge of any shape"
GAUGE_HANGING = "gauge that hangs"


class BarShape(BasisFunction, key="bar-shape:NUMBER:NUMBER:INDEX:INDEX:INDEX:INDEX", static=False, gauge=True):
    """φ = √(2k + 1) P_k((L − about)/span) · eₓ^x e_y^y e_z^z, of the length L and the bar's direction e in the base.

    P_k is Legendre's polynomial of degree ``length``: over lengths about ± span its mean square is 1/(2k + 1).
    """

    about: float
    span: float
    length: int
    x: int
    y: int
    z: int

    def __call__(self, c: Context) -> Array:
        """Return the product."""
        e = c.bar.direction
        scaled = (c.length - self.about) / self.span
        turned = e[:, 0] ** self.x * e[:, 1] ** self.y * e[:, 2] ** self.z
        return np.asarray(Legendre.basis(self.length)(scaled) * np.sqrt(2 * self.length + 1) * turned)


class HangingShape(BasisFunction, key="hanging-shape:NUMBER:NUMBER:INDEX:INDEX", static=False, gauge=True):
    """φ = √(2k + 1) P_k((L − about)/span) · (1 − u²) uⁱ, of the length L and the part u = −e·g/g by which it rises.

    P_k is Legendre's polynomial of degree ``length``, i is ``rise``. Where the bar stands upright all is as it was.
    """

    about: float
    span: float
    length: int
    rise: int

    def __call__(self, c: Context) -> Array:
        """Return the product."""
        up = -c.setup.gravity_B / np.linalg.norm(c.setup.gravity_B)
        rise = c.bar.direction @ up
        scaled = (c.length - self.about) / self.span
        along = Legendre.basis(self.length)(scaled) * np.sqrt(2 * self.length + 1)
        return np.asarray(along * (1 - rise**2) * rise**self.rise)


class RayShape(BasisFunction, key="ray-shape:INDEX:INDEX:INDEX", static=False, gauge=True):
    """φ = rₓ^x r_y^y r_z^z of the way r [m] from gauge to point in the base frame."""

    x: int
    y: int
    z: int

    def __call__(self, c: Context) -> Array:
        """Return the product."""
        r = c.ray
        return np.asarray(r[:, 0] ** self.x * r[:, 1] ** self.y * r[:, 2] ** self.z)


def gauge_shapes(run: Excitation) -> Iterator[tuple[str, tuple[Parameter, ...]]]:
    """Yield families, by name, of smooth errors of a length from a fixture, or of a position; else none."""
    if run.setup.gauge.is_attached:
        yield GAUGE_SHAPE, tuple(_bar_shapes(run))
        yield GAUGE_HANGING, tuple(_hanging_shapes(run))
    elif run.setup.gauge.width > 1:
        yield GAUGE_SHAPE, tuple(_ray_shapes(run))


def _hanging_shapes(run: Excitation) -> Iterator[Parameter]:
    # 3 and 2: shapes in the length, and one side of a bar may be heavier than the other
    about, span = _middle_and_half(run)
    degrees = list(product(range(3), range(2)))
    size = _usual_size(run) / np.sqrt(len(degrees))
    for length, rise in degrees:
        move = ParameterMove("reading", 0, HangingShape(about, span, length, rise))
        yield Parameter(f"gauge_hanging_{length}{rise}", "m", float(size), "error of the gauge as it hangs", (move,))


def _middle_and_half(run: Excitation) -> tuple[float, float]:
    """Return the middle of the range of lengths, and half of it [m]."""
    length = run.context.length
    ends = float(length.min()), float(length.max())
    return round(sum(ends) / 2, 3), max(round((ends[1] - ends[0]) / 2, 3), 1e-3)


def _usual_size(run: Excitation) -> float:
    """Return what gauges of lengths usually err by [m]."""
    # 5e-6: [m] ball bars err by some micrometres, however well they repeat (Kakino et al. 1987, CIRP Annals 36(1))
    return max(BAR_SHAPE * float(run.setup.gauge.sigmas[0]), 5e-6)


def _bar_shapes(run: Excitation) -> Iterator[Parameter]:
    about, span = _middle_and_half(run)
    # e is a unit vector: higher powers of its last component say nothing more
    degree = 3  # of the polynomial in place and direction
    powers = [p for p in product(range(degree + 1), repeat=4) if 0 < sum(p) <= degree and p[3] < 2]
    size = _usual_size(run) / np.sqrt(len(powers))
    for p in powers:
        move = ParameterMove("reading", 0, BarShape(about, span, *p))
        name = f"gauge_shape_{''.join(map(str, p))}"
        yield Parameter(name, "m", float(size), "smooth error of the gauge", (move,))


def _ray_shapes(run: Excitation) -> Iterator[Parameter]:
    reach = max(float(np.linalg.norm(run.context.ray, axis=1).max()), 1e-3)
    degree = 3  # of the polynomial in the reading's coordinates
    powers = [p for p in product(range(degree + 1), repeat=3) if 1 < sum(p) <= degree]
    for axis, p in product(range(3), powers):
        size = RAY_SHAPE / np.sqrt(len(powers)) / reach ** sum(p)
        name = f"gauge_shape_{'xyz'[axis]}_{''.join(map(str, p))}"
        move = ParameterMove("reading", axis, RayShape(*p))
        yield Parameter(name, "1", float(size), "smooth error of the gauge", (move,))
