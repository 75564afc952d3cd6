"""Errors of the gauge itself, on its reading: of a bar or wire of length L, or of a tracker's frame."""

from collections.abc import Iterator
from typing import Literal

import numpy as np

from planner.cell.cell import MeasurementSetup
from planner.common.units import Array, to_mm
from planner.effects.basis import BasisFunction, EffectVariable
from planner.effects.catalogue import CONTINUOUS_RUN, Background, Excitation, register
from planner.effects.context import Context
from planner.effects.effect import Effect, Parameter, ParameterMove, Place, ShapeParameter, reading_move
from planner.effects.gauge_unknowns import unknowns_of
from planner.effects.sizes import GAUGE_LAG
from planner.effects.thermal import temperature_variable

KAKINO = "Kakino, Ihara & Nakatsu 1987, CIRP Annals 36(1): errors of double ball bars, some micrometres"
TAPE = "sag correction of surveyor's tapes (Ghilani & Wolf, Elementary Surveying, ch. 6); size estimated"
TRACKER = "Muralikrishnan, Phillips & Sawyer 2016, Precision Engineering 44: laser trackers, some parts in a million"
WARM_GAUGE = "a run with temperature_degC logged while the gauge warms up or cools down and the arm does not"
PLATE = "plates: a printed one holds 0.1 to 0.3 mm, a machined one 0.02 mm; size estimated"


BallEnd = Literal["fixture", "tool"]
ENDS: tuple[tuple[BallEnd, str], ...] = (("fixture", "ball at the fixture"), ("tool", "ball on the tool"))
LOBES = (("ball ovality", 2), ("ball lobing", 4))  # odd ones and the first are much like a ball off its centre


def length_variable(phi: BasisFunction, c: Context) -> EffectVariable:
    """Return the length as the quantity that the effect is drawn against."""
    return EffectVariable("length (mm)", to_mm(c.length))


class BarLength(BasisFunction, key="length", static=False, gauge=True):
    """φ = L [m]: a scale error."""

    plot_variable = length_variable

    def __call__(self, c: Context) -> Array:
        """Return the length."""
        return c.length


class LengthPower(BasisFunction, key="length-power:NUMBER:NUMBER:INDEX", static=False, gauge=True):
    """φ = ((L − about)/span)^power: a scale that is bent over its range."""

    about: float
    span: float
    power: int
    plot_variable = length_variable

    def __call__(self, c: Context) -> Array:
        """Return the power."""
        return np.asarray(((c.length - self.about) / self.span) ** self.power)


class LengthGrowth(BasisFunction, key="growth:NUMBER", static=False, gauge=True, column="temperature"):
    """φ = (T − about)·L [K m]: thermal growth of the bar or of its scale."""

    about: float
    plot_variable = temperature_variable

    def __call__(self, c: Context) -> Array:
        """Return the product."""
        return (c.column("temperature") - self.about) * c.length


class LengthLag(BasisFunction, key="length-lag", static=False, gauge=True, column="speed"):
    """φ = −dL/dt [m/s]: a reading that comes late shows what was."""

    plot_label = "speed of the length (mm/s)"
    plot_factor = float(-to_mm(1.0))

    def __call__(self, c: Context) -> Array:
        """Return minus the rate."""
        return np.asarray(-np.einsum("ni,ni->n", c.velocity, c.bar.direction))


class BallOffset(BasisFunction, key="bar-(fixture|tool):AXIS", static=False, gauge=True):
    """φ = component of the bar's direction along an axis (0, 1, 2) of base or flange: a ball off its centre."""

    end: Literal["fixture", "tool"]
    axis: int

    def __call__(self, c: Context) -> Array:
        """Return the component."""
        return ball_direction(c, self.end)[:, self.axis]


def ball_direction(c: Context, end: "BallEnd") -> Array:
    """Return the bar's direction (n, 3) in the axes of the base, for the fixture's ball, or of the flange."""
    e = c.bar.direction
    return e if end == "fixture" else np.asarray(np.einsum("ni,ian->na", e, c.motion.R))


class BallShape(BasisFunction, key="ball-shape-(fixture|tool):INDEX:INDEX", static=False, gauge=True):
    """φ = real spherical harmonic, at most 1, of the bar's direction in axes of base or flange: a ball out of round.

    The first index is the degree n, the second the order m plus n, 0 … 2n.
    """

    end: "BallEnd"
    degree: int
    index: int

    def __call__(self, c: Context) -> Array:
        """Return the harmonic."""
        from scipy.special import sph_harm_y  # only here

        x, y, z = ball_direction(c, self.end).T
        order = self.index - self.degree
        wave = sph_harm_y(self.degree, abs(order), np.arccos(np.clip(z, -1.0, 1.0)), np.arctan2(y, x))
        size = np.sqrt(4 * np.pi / (2 * self.degree + 1)) * (np.sqrt(2) if order else 1.0)
        return np.asarray(size * (wave.imag if order < 0 else wave.real))


class BarSag(BasisFunction, key="sag:NUMBER", static=False, gauge=True):
    """φ = (L/span)³ · (1 − (e·g)²/g²): a wire or rod that hangs through under its own weight.

    The sag correction of surveyor's tapes, w² L³ cos²(slope) / (24 T²) (Ghilani & Wolf, Elementary Surveying, ch. 6).
    """

    span: float
    plot_variable = length_variable

    def __call__(self, c: Context) -> Array:
        """Return the shape of the correction."""
        down = c.setup.gravity_B / np.linalg.norm(c.setup.gravity_B)
        return np.asarray((c.length / self.span) ** 3 * (1.0 - (c.bar.direction @ down) ** 2))


class ScaleWave(BasisFunction, key="scale-(sin|cos):NUMBER", static=False, gauge=True):
    """φ = sin or cos(2π·reading/period): the interpolation error of a scale, by the length that it read."""

    wave: Literal["sin", "cos"]
    period: float

    def __call__(self, c: Context) -> Array:
        """Return the wave."""
        return np.asarray((np.sin if self.wave == "sin" else np.cos)(2 * np.pi / self.period * c.length))

    def plot_variable(self, c: Context) -> EffectVariable:
        """Draw against the length, folded."""
        period = float(to_mm(self.period))
        return EffectVariable(f"length, folded at {period:.4g} mm (mm)", to_mm(c.length), period)


class GaugeRay(BasisFunction, key="ray:AXIS", static=False, gauge=True):
    """φ = component, along an axis of the base, of the way from gauge to point [m]: scale of a tracker."""

    axis: int

    def __call__(self, c: Context) -> Array:
        """Return the component."""
        return c.ray[:, self.axis]


class BallPlace(BasisFunction, key="ball-place:INDEX:AXIS:AXIS", static=False, gauge=True):
    """φ = −1 at the ball or socket that is nearest, along one of the plate's axes, seen along one of the base's.

    A ball that sits further along than the cell says lets the cell's position read that much less.
    """

    ball: int
    own: int
    axis: int

    def __call__(self, c: Context) -> Array:
        """Return the component at samples of this ball, nought at others."""
        R_BG = c.measurement_setup.R_BG[c.samples.place]
        return np.asarray(np.where(nearest_ball(c) == self.ball, -R_BG[:, self.axis, self.own], 0.0))


def nearest_ball(c: Context) -> np.ndarray:
    """Return which ball of the plate the measured point is nearest to, (n,) int."""
    setup = c.measurement_setup
    p_GM = np.einsum("nji,nj->ni", setup.R_BG[c.samples.place], c.ray)
    return np.asarray(np.argmin(np.linalg.norm(p_GM[:, None] - setup.p_GS[None], axis=2), axis=1))


class RayGrowth(BasisFunction, key="ray-growth:AXIS:NUMBER", static=False, gauge=True, column="temperature"):
    """φ = (T − about) times the component of ``GaugeRay`` [K m]."""

    axis: int
    about: float

    def __call__(self, c: Context) -> Array:
        """Return the product."""
        return np.asarray((c.column("temperature") - self.about) * c.ray[:, self.axis])


class PointLag(BasisFunction, key="point-lag:AXIS", static=False, gauge=True, column="speed"):
    """φ = −velocity of the point along an axis of the base [m/s]: a tracker whose clock runs late."""

    axis: int

    def __call__(self, c: Context) -> Array:
        """Return minus the velocity."""
        return -c.velocity[:, self.axis]


class BeamRefraction(BasisFunction, key="refraction:AXIS", static=False, gauge=True):
    """φ = component along an axis of the base of the bend of a light ray, upwards by its range squared [m²]."""

    axis: int

    def __call__(self, c: Context) -> Array:
        """Return the component."""
        up = -c.setup.gravity_B / np.linalg.norm(c.setup.gravity_B)
        return np.asarray(up[self.axis] * np.einsum("ni,ni->n", c.ray, c.ray))


def clock_offset_parameter(setup: MeasurementSetup) -> Parameter:
    """Return the parameter of the gauge's delay [s] behind the controller, where each was logged by its own clock."""
    what = "lag of the gauge's clock behind the controller's"
    return Parameter("lag", "s", GAUGE_LAG, what, unknowns_of(setup.gauge).lag_moves(), "gauge")


@register()
def own_errors(run: Excitation) -> Iterator[Effect]:
    """Yield the errors of its own that the gauge of the run can have."""
    yield from unknowns_of(run.setup.gauge).errors(run)


@register("gauge scale", by_gauge=True, background=Background.KNOWN)
def length_scale(run: Excitation) -> Iterator[Effect]:
    """Scale of a bar or wire."""
    sentence, most = "the gauge's scale is off, {size} of its length", run.setup.gauge.largest_scale
    yield _of_gauge("gauge scale", "1", reading_move(BarLength()), 1e-4, most, sentence, KAKINO)


@register(
    "gauge nonlinearity",
    "gauge cubic nonlinearity",
    "gauge sag",
    by_gauge=True,
    background=Background.OF_SHAPE,
)
def length_nonlinearity(run: Excitation) -> Iterator[Effect]:
    """A bent scale, and the sag of a bar or wire."""
    length = run.context.length
    about, half = round(float((length.max() + length.min()) / 2), 3), max(round(float(np.ptp(length)) / 2, 3), 1e-3)
    for power, kind, word in ((2, "gauge nonlinearity", "bent"), (3, "gauge cubic nonlinearity", "bent like an S")):
        sentence = f"the gauge's scale is {word}, {{size}} at the ends of its range"
        moves = reading_move(LengthPower(about, half, power))
        yield _of_gauge(kind, "m", moves, 2e-5, 2e-3, sentence, "estimated")
    sentence = "bar or wire hangs through under its own weight, {size} at its middle length"
    yield _of_gauge("gauge sag", "m", reading_move(BarSag(about)), 2e-5, 2e-3, sentence, TAPE)


@register("gauge growth", needs=WARM_GAUGE, by_gauge=True)
def length_growth(run: Excitation) -> Iterator[Effect]:
    """Thermal growth of a bar or wire."""
    if run.varies("temperature"):
        moves, sentence = reading_move(LengthGrowth(run.mean_temperature)), "the gauge grows with temperature, {size}"
        yield _of_gauge("gauge growth", "1/K", moves, 1.2e-5, 2e-4, sentence, "estimated")


@register("gauge lag", needs=CONTINUOUS_RUN, by_gauge=True)
def gauge_lag(run: Excitation) -> Iterator[Effect]:
    """A clock of the gauge that runs late."""
    if run.varies("speed"):
        moves, sentence = unknowns_of(run.setup.gauge).lag_moves(), "the gauge's clock runs {size} late"
        yield _of_gauge("gauge lag", "s", moves, 2e-3, 0.2, sentence, "estimated")


@register("ball centre", by_gauge=True)
def ball_centres(run: Excitation) -> Iterator[Effect]:
    """Balls that are not where their sockets' centres are; geometry usually takes that whole."""
    for end, name in ENDS:
        offsets = tuple(
            Parameter(f"ball_{end}_{a}", "m", 2e-5, f"{name} off centre along {a}", reading_move(BallOffset(end, k)))
            for k, a in enumerate("xyz")
        )
        sentence = f"the {name} is off its centre by {{size}}"
        yield Effect("ball centre", Place(name), offsets, sentence, 1e-3, KAKINO)


@register(*(kind for kind, _ in LOBES), by_gauge=True)
def ball_shapes(run: Excitation) -> Iterator[Effect]:
    """Balls that are not round: even harmonics of the direction from which the bar touches the ball."""
    for kind, degree in LOBES:
        for end, name in ENDS:
            label = f"{kind.replace(' ', '_')}_{end}"
            shape = tuple(
                Parameter(f"{label}_{k}", "m", 5e-6, f"{kind} of the {name}", reading_move(BallShape(end, degree, k)))
                for k in range(2 * degree + 1)
            )
            sentence = f"the {name} is out of round by {{size}}, with {degree} lobes"
            yield Effect(kind, Place(name), shape, sentence, 1e-3, KAKINO)


@register("scale interpolation", by_gauge=True)
def scale_interpolation(run: Excitation) -> Iterator[Effect]:
    """The scale of a bar or wire errs with each of its periods."""
    usual = (1e-5, 2e-5, 4e-5, 1e-4, 2e-4)  # [m] periods of scales below it
    longest = 2e-2  # [m] period of a scale that is scanned
    shortest = 5e-4  # [m] period of a scale that is scanned
    if not run.has("length"):
        return
    # 0.25: of a wave over the range of lengths between neighbours of the scan
    step = 0.25 / max(float(np.ptp(run.context.length)), 1e-3)
    often = np.arange(1 / longest, 1 / shortest, step)
    yield Effect(
        "scale interpolation", Place("gauge"), _scale_waves,
        "the gauge's scale errs by {size} with a period of {inner}", 5e-4, KAKINO,
        ShapeParameter("period", "m", np.concatenate([usual, 1 / often[::-1]]), True),
    )  # fmt: skip


@register("gauge scale", by_gauge=True, background=Background.KNOWN)
def position_scale(run: Excitation) -> Iterator[Effect]:
    """Scale of a tracker, or of the distances in a plate of balls."""
    what = "the plate's distances are" if _in_sockets(run) else "the tracker's scale is"
    moves = _each_axis([GaugeRay(a) for a in range(3)])
    most = run.setup.gauge.largest_scale
    yield _of_gauge("gauge scale", "1", moves, 1e-5, most, f"{what} off, {{size}}", TRACKER)


@register("ball place", by_gauge=True)
def ball_places(run: Excitation) -> Iterator[Effect]:
    """Balls or sockets of a plate that sit elsewhere than the cell says: not measured well, or mistyped."""
    names = run.setup.ball_names
    visited = np.unique(nearest_ball(run.context)) if names else np.arange(0)
    # 3: with two, one that sits elsewhere is the scale of their distance
    for k, ball in ((int(k), names[k]) for k in visited if len(visited) >= 3):
        moves = [_each_axis([BallPlace(k, own, axis) for axis in range(3)]) for own in range(3)]
        offsets = tuple(
            Parameter(f"place_{ball}_{a}", "m", 1e-4, f"ball {ball}: further along the plate's {a}", m)
            for a, m in zip("xyz", moves, strict=True)
        )
        sentence = f"ball or socket {ball} sits {{size}} from where [[balls]] has it in the plate"
        yield Effect("ball place", Place(f"ball {ball}"), offsets, sentence, 0.1, PLATE)


@register("gauge growth", needs=WARM_GAUGE, by_gauge=True)
def position_growth(run: Excitation) -> Iterator[Effect]:
    """Thermal growth of a plate, or of a tracker's scale."""
    if run.varies("temperature"):
        what = "plate" if _in_sockets(run) else "tracker's scale"
        moves = _each_axis([RayGrowth(a, run.mean_temperature) for a in range(3)])
        sentence = f"the {what} grows with temperature, {{size}}"
        yield _of_gauge("gauge growth", "1/K", moves, 1e-5, 2e-4, sentence, TRACKER)


@register("refraction", by_gauge=True)
def refraction(run: Excitation) -> Iterator[Effect]:
    """Light of a tracker that is bent by warm air."""
    if not _in_sockets(run):
        moves = _each_axis([BeamRefraction(a) for a in range(3)])
        sentence = "warm air bends the tracker's beam, {size}"
        yield _of_gauge("refraction", "1/m", moves, 1e-6, 3e-5, sentence, TRACKER)


LENGTH_ERRORS = (
    length_scale,
    length_nonlinearity,
    length_growth,
    gauge_lag,
    ball_centres,
    ball_shapes,
    scale_interpolation,
)
POSITION_ERRORS = (position_scale, ball_places, position_growth, gauge_lag, refraction)


def _in_sockets(run: Excitation) -> bool:
    return len(run.setup.p_GS) > 0


def _of_gauge(
    kind: str, unit: str, moves: tuple[ParameterMove, ...], prior: float, largest: float, sentence: str, source: str
) -> Effect:
    parameter = Parameter(kind.replace(" ", "_"), unit, prior, kind, moves)
    return Effect(kind, Place("gauge"), (parameter,), sentence, largest, source)


def _each_axis(phis: list[BasisFunction]) -> tuple[ParameterMove, ...]:
    return tuple(ParameterMove("reading", axis, phi) for axis, phi in enumerate(phis))


def _scale_waves(period: float) -> tuple[Parameter, ...]:
    label, what = f"scale_{period * 1e3:.8g}mm", f"error of the scale with period {period * 1e3:.8g} mm"
    return (
        Parameter(f"{label}_sin", "m", 5e-6, f"{what}, sine", reading_move(ScaleWave("sin", period))),
        Parameter(f"{label}_cos", "m", 5e-6, f"{what}, cosine", reading_move(ScaleWave("cos", period))),
    )
