"""Readings on a circle by their harmonics, each with a noise of its own.

Turns differ from their repeats by smooth curves. On a circle a noise that is alike at all angles has independent
harmonics, so generalised least squares weighs each by the inverse of its own variance. What all loads have in common
is taken off first, which is the same as a free offset at every angle.

The arm on a loaded circle: where it comes to stand when its joints yield, and which circle it has driven.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from planner.cell.cell import MeasurementSetup
from planner.cell.placement import Targets
from planner.circular.plan import NEAR_CIRCLE
from planner.common.errors import InputError
from planner.common.units import MM, Array, read_only
from planner.effects.compliance import compliance_parameters
from planner.effects.context import Context
from planner.kinematics.geometry import fit_circle_in_space
from planner.loaded.assumptions import DEFLECTION, SAMPLES
from planner.loaded.types import AveragedCurves, CentringOffset, Combination, DrivenCircle, JointCompliances
from planner.model.model import Model
from planner.runs.run import Run, Samples
from planner.simulation.equilibrium import BALANCE_ROUNDS


def deflect_joints(setup: MeasurementSetup, samples: Samples, value: Array) -> Samples:
    """Return the samples with the angles to which the joints yield under weight, payload and the bar's pull.

    The torques are those at the place where the arm comes to stand, not where it was sent: the bar's direction
    follows the deflection, by up to a percent, and the weights' levers a little.

    Args:
        setup: with the fixture where it is.
        samples: as driven.
        value: compliance of every joint, (N,) [rad/Nm].
    """
    back = np.linalg.inv(setup.robot.coupling_matrix)
    q = samples.q
    for _ in range(BALANCE_ROUNDS):
        torque = Context(setup, replace(samples, q=q)).load_torque
        q = samples.q + (torque * value) @ back.T
    return replace(samples, q=read_only(q))


def lower_fixture(setup: MeasurementSetup, curves: AveragedCurves, value: Array) -> MeasurementSetup:
    """Return the setup with a circle's fixture as much lower as the weights alone bend the arm.

    Where the fixture stands is known from the arm itself, which sags as much when it is driven there.
    """
    samples = samples_of(curves, loaded=False)
    sagged = deflect_joints(setup, samples, value)
    by = (measured_points(setup, sagged.q) - measured_points(setup, samples.q)).mean(axis=0)
    return _move_fixture(setup, curves.circle.place, by)


def raise_fixture(setup: MeasurementSetup, curves: AveragedCurves, height: float) -> MeasurementSetup:
    """Return the setup with the fixture of a circle higher along the circle's normal [m]."""
    return _move_fixture(setup, curves.circle.place, height * curves.circle.axes[2])


def _move_fixture(setup: MeasurementSetup, place: int, by: Array) -> MeasurementSetup:
    p_BX = np.array(setup.p_BX)
    p_BX[place] += by
    return replace(setup, p_BX=read_only(p_BX))


def samples_of(curves: AveragedCurves, loaded: bool = True) -> Samples:
    """Every angle, load and sense of a circle as a sample, with the bar's pull or without."""
    n = curves.length.size
    force = curves.force.ravel() if loaded else np.zeros(n)
    return Samples(q=read_only(curves.q.reshape(n, -1)), place=np.full(n, curves.circle.place), force=read_only(force))


def measured_points(setup: MeasurementSetup, q: Array) -> Array:
    """Measured point of the nominal setup, (n, 3) [m]."""
    tool = setup.p_FM[0]
    return setup.robot.chain.carry(setup.robot.theta(q), np.asarray(tool))


def find_circle(setup: MeasurementSetup, run: Run, place: int, x: Array) -> DrivenCircle:
    """Fit plane, centre and radius to the points x (n, 3) [m] of one place; strays such as ways there are left out.

    Angle 0 lies along the base's x axis (y where the circle stands across x), and the normal points up, or along +x.

    Raises:
        InputError: the points do not lie on a circle.
    """
    centre, axes, radius = fit_circle_in_space(x)
    for _ in range(8):  # rounds of taking the samples near the circle
        size = _distance_off(x, centre, axes[2], radius)
        on = size <= max(float(np.quantile(size, SAMPLES.on_circle_share)), 1e-4 * radius) * 3.0
        centre, axes, radius = fit_circle_in_space(x[on])
    off = _distance_off(x, centre, axes[2], radius)
    if radius > 10.0 or float(np.mean(off < NEAR_CIRCLE * radius)) < SAMPLES.on_circle_share:
        raise InputError(
            f"{run.name}: the arm does not run on a circle at fixture '{setup.place_names[place]}': half of the "
            f"samples lie {float(np.median(off)) / MM:.1f} mm or more off the best one (radius {radius / MM:.1f} mm); "
            "only circles can be evaluated here"
        )
    p_BX, name = read_only(setup.p_BX[place]), setup.place_names[place]
    return DrivenCircle(read_only(centre), read_only(_axes(axes[2])), float(radius), p_BX, name, place)


def _distance_off(x: Array, centre: Array, normal: Array, radius: float) -> Array:
    """Distance of points from the circle, (n,) [m]."""
    r = x - centre
    height = r @ normal
    return np.asarray(np.hypot(np.linalg.norm(r - height[:, None] * normal, axis=1) - radius, height))


def _axes(normal: Array) -> Array:
    """Right-handed axes with the normal last, its largest part positive."""
    normal = normal * np.sign(normal[int(np.argmax(np.round(np.abs(normal), 6)))])
    helper = np.eye(3)[1 if abs(normal[0]) > 0.7 else 0]
    first = helper - normal * (helper @ normal)
    first = first / np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first), normal])


def centring_offset(theta: Array, y: Array) -> CentringOffset:
    """Fit a sin(θ − φ) to y (B,) [m] over whole turns θ (B,) [rad]: linear, so that there is nothing to guess.

    A centre that is off its ball shows once a turn and no otherwise, so that b of eq. 9 is 1.
    """
    A = np.column_stack([np.sin(theta), np.cos(theta)])
    (along, across), *_ = np.linalg.lstsq(A, y)
    rms = float(np.sqrt(np.mean((y - A @ np.array([along, across])) ** 2)))
    return CentringOffset(float(np.hypot(along, across)), float(np.arctan2(-across, along)), rms)


Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class CircleInformation:
    """What one circle says of the compliances, its fixture's height left open within its prior.

    Attributes:
        information: (N, N); ``pulled``: rows against residual, (N,), about the compliances looked at.
        height_row: (N + 1,): what the height is at no change of the compliances [m], and how it follows them.
    """

    information: Array
    pulled: Array
    height_row: Array

    def height(self, step: Array) -> float:
        """Likeliest height [m] for a change ``step`` (N,) of the compliances."""
        return float(self.height_row[0] - self.height_row[1:] @ step)


@dataclass(frozen=True)
class Harmonics:
    """Rows and residuals of a circle, harmonic by harmonic, what all loads have in common taken off.

    Attributes:
        rows: of N compliances and the height, (D, K, H, N + 1); residual: (D, K, H) [m].
        weight: repeats of every turn, (D, K).
        count: how often a harmonic counts, (H,).
    """

    rows: Complex
    residual: Complex
    weight: Array
    count: Array

    @classmethod
    def of(cls, columns: Array, weight: Array) -> "Harmonics":
        """Take the rows and, last, the residual, (D, K, B, C), of turns driven ``weight`` (D, K) times."""
        common = np.einsum("dk,dkbn->dbn", weight / weight.sum(axis=1, keepdims=True), columns)
        waves = np.fft.rfft(columns - common[:, None], axis=2, norm="ortho")
        return cls(waves[..., :-1], waves[..., -1], weight, harmonic_counts(columns.shape[2]))

    @property
    def readings(self) -> int:
        """Numbers that are left when the loads' common part is taken off."""
        D, K = self.weight.shape
        return int(D * (K - 1) * self.count.sum())

    @property
    def scatter(self) -> Array:
        """Variance of one turn's harmonics by what the loads differ, (H,) [m²]; the lowest, as fitted, pooled."""
        D, K = self.weight.shape
        square = (self.weight[..., None] * np.abs(self.residual) ** 2).sum(axis=(0, 1)) / (D * (K - 1))
        pooled = float(
            (self.count * square)[: DEFLECTION.low_harmonics].sum() / self.count[: DEFLECTION.low_harmonics].sum()
        )
        return np.concatenate(
            [np.full(DEFLECTION.low_harmonics, pooled), smooth_spectrum(square)[DEFLECTION.low_harmonics :]]
        )

    def subtract_change(self, step: Array, height: float) -> "Harmonics":
        """Return the harmonics that remain after a change of the compliances (N,) and of the height [m]."""
        return Harmonics(self.rows, self.residual - self.rows @ np.append(step, height), self.weight, self.count)

    def information(self, noise: Array, prior: float, height: float = 0.0) -> CircleInformation:
        """Say what the circle tells.

        Args:
            noise: variance of a turn's harmonics, (H,) [m²].
            prior: one-sigma size of the fixture's height [m]; ``height`` the one looked at.
        """
        w = self._weights(noise)
        A = np.einsum("dkh,dkhi,dkhj->ij", w, self.rows.conj(), self.rows).real
        b = np.einsum("dkh,dkhi,dkh->i", w, self.rows.conj(), self.residual).real
        open_ = A[-1, -1] + 1.0 / prior**2
        b[-1] -= height / prior**2
        across = A[:-1, -1] / open_
        information = A[:-1, :-1] - np.outer(across, A[-1, :-1])
        return CircleInformation(information, b[:-1] - across * b[-1], np.append(b[-1] / open_, across))

    def misfit(self, noise: Array) -> float:
        """Weighted sum of the squares of the harmonics."""
        return float((self._weights(noise) * np.abs(self.residual) ** 2).sum())

    def mean_variance(self, noise: Array) -> Array:
        """Variance of an averaged reading, for every sense and load, (D, K) [m²]."""
        return np.asarray((noise * self.count).sum() / self.count.sum() / self.weight)

    def _weights(self, noise: Array) -> Array:
        return np.asarray(self.weight[..., None] * self.count / noise)


def turn_noise(turns: Array) -> Array:
    """Squares of the harmonics of turns (R, B) [m] about their mean, (B // 2 + 1,) [m²], summed over the turns."""
    return np.asarray((np.abs(np.fft.rfft(turns - turns.mean(axis=0), axis=1, norm="ortho")) ** 2).sum(axis=0))


def harmonic_counts(bins: int) -> Array:
    """How often each of the harmonics of an even grid counts in a sum over angles, (bins // 2 + 1,)."""
    out = np.full(bins // 2 + 1, 2.0)
    out[0] = 1.0
    if bins % 2 == 0:
        out[-1] = 1.0
    return out


def smooth_spectrum(square: Array) -> Array:
    """Average a spectrum (H,) over neighbours, but for the mean and the first harmonic, which have causes of their own.

    The higher the harmonic, the wider: a spectrum changes by its octaves.
    """
    return np.array(list(_windows(square)))


def _windows(square: Array) -> Iterator[float]:
    floor = 1e-6 * float(np.mean(square)) + 1e-30
    for n in range(len(square)):
        reach = 0 if n < 2 else max(1, n // 4)
        first = n if n < 2 else max(2, n - reach)
        yield max(float(np.mean(square[first : n + reach + 1])), floor)


@dataclass(frozen=True)
class ComplianceFit:
    """Compliances, and how much higher each circle's fixture stands than stated, (S,) [m]."""

    compliances: JointCompliances
    heights: Array


def fit_compliances(setup: MeasurementSetup, curves: Sequence[AveragedCurves]) -> ComplianceFit:
    """Fit the compliance of every joint to all circles together.

    How far below the circle the fixture's ball lies decides where the load points. It is known as well as the cell
    says, and what that leaves open counts in the uncertainties.
    """
    model = Model(setup, tuple(compliance_parameters(setup)))
    value, prior = np.zeros(len(model.parameters)), model.prior
    heights, noise, misfit = np.zeros(len(curves)), [np.full(1, np.nan)] * len(curves), 1.0
    sizes = [float(setup.place_prior[c.circle.place]) for c in curves]
    for k in range(6):  # rounds: linear but for what the deflection itself changes of the arm's pose, and for the noise
        moved = [replace(model, setup=raise_fixture(setup, c, h)) for c, h in zip(curves, heights, strict=True)]
        waves = [harmonics_of(m, c, value) for m, c in zip(moved, curves, strict=True)]
        noise = noise if k else [_first_noise(w, c) for w, c in zip(waves, curves, strict=True)]
        told = [w.information(s, p, h) for w, s, p, h in zip(waves, noise, sizes, heights, strict=True)]
        information = np.asarray(sum(t.information for t in told))
        pulled = np.asarray(sum(t.pulled for t in told)) + information @ value
        change = np.linalg.solve(information * np.outer(prior, prior) + np.eye(len(prior)), pulled * prior)
        step, value = prior * change - value, prior * change
        raise_by = np.array([t.height(step) for t in told])
        heights = heights + raise_by
        left = [w.subtract_change(step, h) for w, h in zip(waves, raise_by, strict=True)]
        misfit = _misfit(left, curves, len(value))
        noise = [_noise(w, c, misfit) for w, c in zip(left, curves, strict=True)]
        if (
            k > 1
            and np.abs(step / prior).max() < DEFLECTION.still_share
            and np.abs(raise_by).max() < DEFLECTION.still_share * MM
        ):
            break
    size = np.sqrt(np.mean([np.mean(w.mean_variance(_first_noise(w, c))) for w, c in zip(left, curves, strict=True)]))
    found = compliance_posterior(model.names, prior, information, pulled, float(size), float(np.sqrt(misfit)))
    return ComplianceFit(found, read_only(heights))


def _first_noise(waves: Harmonics, curves: AveragedCurves) -> Array:
    """Variance of one turn's harmonics, (H,) [m²], by the repeats, or without any flat, by what differs."""
    if np.all(np.isfinite(curves.noise)):
        return curves.noise
    return np.full_like(waves.scatter, float(np.mean(waves.scatter)))


def _misfit(left: Sequence[Harmonics], curves: Sequence[AveragedCurves], parameters: int) -> float:
    """How much more variance the loads' curves have about the fit than the repeats about their mean; 1 without any."""
    known = [(w, c) for w, c in zip(left, curves, strict=True) if np.all(np.isfinite(c.noise))]
    if not known:
        return 1.0
    return sum(w.misfit(c.noise) for w, c in known) / max(1, sum(w.readings for w, _ in known) - parameters)


def _noise(left: Harmonics, curves: AveragedCurves, misfit: float) -> Array:
    """Variance of one turn's harmonics to weigh by, (H,) [m²].

    Where the curves differ a little more than the repeats all of it is scaled (Birge 1932). Where they differ by much
    more the cause lies in some harmonics, the low ones mostly, and each has the variance that is left in it.
    """
    if not np.all(np.isfinite(curves.noise)):
        return left.scatter
    return (
        curves.noise * max(1.0, misfit)
        if misfit < DEFLECTION.noise_variance_ratio
        else np.maximum(curves.noise, left.scatter)
    )


def harmonics_of(model: Model, curves: AveragedCurves, value: Array) -> Harmonics:
    """Rows and residuals of a circle about some compliances, the fixture's height last."""
    setup = lower_fixture(model.setup, curves, value)
    samples = deflect_joints(setup, samples_of(curves), value)
    about = replace(model, setup=setup).linearize(samples, Targets(length=curves.length.ravel()))
    up, down = (
        _length(raise_fixture(model.setup, curves, h), curves, value)
        for h in (DEFLECTION.height_step, -DEFLECTION.height_step)
    )
    columns = np.column_stack([about.rows[:, 0], (up - down) / (2 * DEFLECTION.height_step), about.residual[:, 0]])
    return Harmonics.of(columns.reshape(*curves.length.shape, -1), curves.repeats.astype(float))


def _length(setup: MeasurementSetup, curves: AveragedCurves, value: Array) -> Array:
    """Predicted readings, (D·K·B,) [m], of an arm in balance with its loads."""
    setup = lower_fixture(setup, curves, value)
    samples = deflect_joints(setup, samples_of(curves), value)
    return -Model(setup, ()).residual(samples, Targets(length=np.zeros(len(samples))))[:, 0]


def bar_deflection(setup: MeasurementSetup, curves: AveragedCurves, value: Array) -> Array:
    """Change of the reading by the bar's whole load, (D, K, B) [m], with joints of the compliances (N,) [rad/Nm]."""
    free = replace(curves, force=np.zeros_like(curves.force))
    change = _length(setup, curves, value) - _length(setup, free, value)
    return np.asarray(change.reshape(curves.length.shape))


def compliance_posterior(
    names: tuple[str, ...], prior: Array, information: Array, pulled: Array, noise: float, misfit: float
) -> JointCompliances:
    """Put what the deflections tell (N, N), (N,) beside the prior sigmas (N,) [rad/Nm]."""
    scaled = information * np.outer(prior, prior)
    covariance = np.linalg.inv(scaled + np.eye(len(prior)))
    value = prior * (covariance @ (pulled * prior))
    std = prior * np.sqrt(np.diag(covariance))
    return JointCompliances(
        names, read_only(value), read_only(std), read_only(prior), read_only(information), read_only(pulled),
        compliance_combinations(names, scaled), noise, misfit,
    )  # fmt: skip


def compliance_combinations(names: tuple[str, ...], scaled: Array) -> tuple[Combination, ...]:
    """Directions of an information matrix in prior sigmas (N, N), from the best known to the least."""
    size, axes = np.linalg.eigh(scaled)
    out = []
    for k in np.argsort(-size, kind="stable"):
        axis = axes[:, k] * np.sign(axes[int(np.argmax(np.round(np.abs(axes[:, k]), 9))), k])
        seen = max(float(size[k]), DEFLECTION.faintest_information * float(size.max()), 1e-300)
        out.append(Combination(names, read_only(axis), float(1.0 / np.sqrt(seen))))
    return tuple(out)
